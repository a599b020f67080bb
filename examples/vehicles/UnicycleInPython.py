"""A unicycle as an FMU written in Python: a plant whose code is not Punctual's.

    pythonfmu build -f UnicycleInPython.py --no-external-tool
    LD_PRELOAD=/path/to/libpython3.11.so punctual run foreign.toml --out out

The library that pythonfmu puts into the FMU expects Python in the process. FMPy is Python; `punctual` needs
LD_PRELOAD with the path of the libpython that belongs to the `python3` on the PATH, and PYTHONPATH where
pythonfmu is installed in a virtual environment.
"""

from math import cos, sin

from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class UnicycleInPython(Fmi2Slave):
    description = "A unicycle that starts at rest in the origin"
    states = ["x.x_p", "x.y_p", "x.theta", "x.v"]  # m, m, rad, m/s
    inputs = ["u.a", "u.omega"]  # m/s², rad/s
    default_experiment = DefaultExperiment(start_time=0.0, stop_time=20.0, step_size=0.001)

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.values = dict.fromkeys(self.states + self.inputs, 0.0)
        for name in self.states + self.inputs:
            is_state = name in self.states
            self.register_variable(
                Real(
                    name,
                    causality=Fmi2Causality.output if is_state else Fmi2Causality.input,
                    variability=Fmi2Variability.continuous,
                    start=None if is_state else 0.0,
                    getter=lambda name=name: self.values[name],
                    setter=lambda value, name=name: self.values.update({name: value}),
                ),
                nested=False,
            )

    def do_step(self, current_time, step_size):
        """The classical Runge-Kutta method, one step, the input held."""
        a, omega = (self.values[name] for name in self.inputs)
        x = [self.values[name] for name in self.states]

        def derivative(x):
            _, _, theta, v = x
            return [v * cos(theta), v * sin(theta), omega, a]

        def moved(h, k):
            return [xi + h * ki for xi, ki in zip(x, k)]

        k1 = derivative(x)
        k2 = derivative(moved(step_size / 2, k1))
        k3 = derivative(moved(step_size / 2, k2))
        k4 = derivative(moved(step_size, k3))
        slope = [(p + 2 * q + 2 * r + s) / 6 for p, q, r, s in zip(k1, k2, k3, k4)]
        self.values.update(zip(self.states, moved(step_size, slope)))
        return True
