"""A cart in Python that is 7 % heavier than its model, with 40 % less friction, integrated by Euler's method at 1 ms."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

MASS, FRICTION = 2.14, 0.3  # kg, kg/s


class HeavyCart(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.position = self.speed = self.force = 0.0
        for name in ["position", "speed", "force"]:
            is_input = name == "force"
            causality = Fmi2Causality.input if is_input else Fmi2Causality.output
            start = 0.0 if is_input else None
            self.register_variable(
                Real(name, causality=causality, variability=Fmi2Variability.continuous, start=start)
            )

    def do_step(self, current_time, step_size):
        steps = max(1, round(step_size / 0.001))
        for _ in range(steps):
            rate = (self.force - FRICTION * self.speed) / MASS
            self.position += step_size / steps * self.speed
            self.speed += step_size / steps * rate
        return True
