"""Asks an optimiser with many starts, Ipopt by way of CasADi, whether a unicycle or bicycle can keep its promise.

    optimise.py CASES.json

CASES.json is what `PUNCTUAL_ORACLE=CASES.json cargo test --release --test theory -- what_a_manoeuvre_can_do` writes. A case
counts as possible if inputs are found whose path, integrated anew in fine steps, is inside the disc from the deadline on
and ends at rest. So what counts as possible is; what does not may be. Prints how many of the possible starts the filter
accepted, and every one that it refused. Fails below 95 %.
"""

import json
import sys

import casadi
import numpy as np

# Part of the possible starts that has to be accepted.
ACCEPTED = 0.95
# Holds after the deadline.
AFTER = 20
# First guesses; Ipopt's answers depend on them.
GUESSES = 10
# How far outside a path may be, in m: Ipopt's tolerance of 1e-8, for ways of some 100 m.
SOLVED = 1e-6
# Speed at rest as a part of what the input changes in a hold.
REST = 1e-6
# Steps of Runge and Kutta in a hold: of the programme, and of the check.
STEPS, CHECKED = 2, 40


def rate(x, u, length, cos=casadi.cos, sin=casadi.sin):
    """The derivative of (x, y, heading, speed)."""
    turning = u[1] if length is None else x[3] * u[1] / length
    return x[3] * cos(x[2]), x[3] * sin(x[2]), turning, u[0]


def step(f, x, dt):
    """One step of Runge and Kutta of order 4."""
    a = f(x)
    b = f(x + dt / 2 * a)
    c = f(x + dt / 2 * b)
    d = f(x + dt * c)
    return x + dt / 6 * (a + 2 * b + 2 * c + d)


def times(case):
    """The length of every hold: even ones until the deadline, then multiples of the period until any speed is lost."""
    until = case["deadline"] / case["holds"]
    # From the edge to rest along a diameter takes sqrt(4 R / a); as long again to turn.
    after = 2 * np.sqrt(4 * case["radius"] / case["bounds"][0]) / AFTER
    periods = max(1, np.ceil(after / case["period"]))
    return [until] * case["holds"] + [periods * case["period"]] * AFTER


def programme(case):
    """The nonlinear programme: states and inputs of every hold, and how far outside the path is at worst."""
    opti = casadi.Opti()
    holds = times(case)
    x, u, outside = opti.variable(4, len(holds) + 1), opti.variable(2, len(holds)), opti.variable()
    opti.subject_to(x[:, 0] == case["start"])
    # Position is measured in radii, so that all numbers are of one size.
    inside = (case["radius"] + outside) ** 2
    opti.subject_to(outside >= -0.9 * case["radius"])
    for k, hold in enumerate(holds):
        end = x[:, k]
        for part in range(STEPS):
            end = step(lambda s: casadi.vertcat(*rate(s, u[:, k], case["l_r"])), end, hold / STEPS)
            if k >= case["holds"] and part + 1 < STEPS:
                opti.subject_to(casadi.sumsqr(end[:2]) <= inside)
        opti.subject_to(x[:, k + 1] == end)
        opti.subject_to(opti.bounded(-np.array(case["bounds"]), u[:, k], case["bounds"]))
        if k >= case["holds"]:
            opti.subject_to(casadi.sumsqr(x[:2, k]) <= inside)
    opti.subject_to(casadi.sumsqr(x[:2, len(holds)]) <= inside)
    opti.subject_to(x[3, len(holds)] == 0)
    opti.minimize(outside)
    quiet = {"print_level": 0, "max_iter": 200, "tol": 1e-8, "sb": "yes"}
    opti.solver("ipopt", {"print_time": False, "expand": True}, quiet)
    return opti, x, u, outside


def simulated(case, inputs, steps, seen=None):
    """The states at the ends of the holds under these inputs; `seen` gets all that are looked at from the deadline on."""
    x = np.array(case["start"], dtype=float)
    states = [x]
    for k, hold in enumerate(times(case)):
        for _ in range(steps):
            if seen is not None and k >= case["holds"]:
                seen.append(x)
            x = step(lambda s: np.array(rate(s, inputs[:, k], case["l_r"], np.cos, np.sin)), x, hold / steps)
        states.append(x)
    if seen is not None:
        seen.append(x)
    return np.array(states).T


def guesses(case, random):
    """Inputs: none, ahead and back with the wheel straight or to either side, and some at random; then braked."""
    count, before = len(times(case)), case["holds"]
    sides = [(0, 0), (1, 0), (-1, 0), (1, 0.5), (1, -0.5), (-1, 0.5), (-1, -0.5)]
    sides += [tuple(random.uniform(-1, 1, 2)) for _ in range(GUESSES - len(sides))]
    for ahead, turning in sides:
        inputs = np.zeros((2, count))
        inputs[0, : before // 2] = 0.5 * ahead * case["bounds"][0]
        inputs[0, before // 2 : before] = -0.5 * ahead * case["bounds"][0]
        inputs[1, : before // 2] = turning * case["bounds"][1]
        yield inputs


def outside_at_best(case, random):
    """How far outside the best path found is, in m; less than 0 as soon as one is inside."""
    opti, x, u, outside = programme(case)
    best = np.inf
    for inputs in guesses(case, random):
        opti.set_initial(u, inputs)
        opti.set_initial(x, simulated(case, inputs, STEPS))
        opti.set_initial(outside, 1.0)
        try:
            opti.solve()
        except RuntimeError:
            # Not converged: what it came to may do all the same.
            pass
        bounds = np.array(case["bounds"])[:, None]
        found = np.clip(opti.debug.value(u), -bounds, bounds)
        if not np.all(np.isfinite(found)):
            continue
        seen = []
        end = simulated(case, found, CHECKED, seen)[:, -1]
        if abs(end[3]) > REST * max(1.0, case["bounds"][0] * times(case)[-1]):
            continue
        best = min(best, max(np.hypot(s[0], s[1]) for s in seen) - case["radius"])
        if best < -SOLVED:
            break
    return best


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        cases = json.load(file)
    random = np.random.default_rng(1)
    failed = False
    for name, kind in [("unicycle", lambda c: c["l_r"] is None), ("bicycle", lambda c: c["l_r"] is not None)]:
        chosen = [case for case in cases if kind(case)]
        possible = accepted = found_none = 0
        for case in chosen:
            outside = outside_at_best(case, random)
            if outside < -SOLVED:
                possible += 1
                accepted += case["accepted"]
                if not case["accepted"]:
                    print(f"{name} refused, possible with {-outside:.6f} m: {json.dumps(case)}", flush=True)
            elif case["accepted"]:
                found_none += 1
        print(
            f"{name}: {len(chosen)} starts, {possible} possible, {accepted} of them accepted "
            f"({100 * accepted / max(1, possible):.1f} %); {found_none} accepted of which the optimiser knew no way"
        )
        failed |= 4 * possible < len(chosen) or accepted < ACCEPTED * possible
    sys.exit(failed)


if __name__ == "__main__":
    main()
