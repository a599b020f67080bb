"""Asks an optimiser with many starts, Ipopt by way of CasADi, whether a vehicle can do its mission with time to spare.

    missions.py CASES.json

CASES.json is what `PUNCTUAL_ORACLE=CASES.json PUNCTUAL_MISSIONS=200 cargo test --release -p punctual-core --test all --
missions::` writes. The optimiser gets the instants of the visits, drawn anew for every try; every deadline is a tenth
earlier than the mission's. A mission counts as possible if inputs are found whose path, integrated anew in fine steps,
does it and ends at rest. So what counts as possible is; what does not may be. Prints how many of the possible missions
the filter accepted, and every one that it refused. Fails below 90 %.
"""

import json
import sys

import casadi
import numpy as np
from optimise import step

# Part of the possible missions that has to be accepted.
ACCEPTED = 0.9
# Part of the time until a deadline that the optimiser may use.
USED = 0.9
# Holds until the end of the mission, and after it in parts of them.
HOLDS, AFTER = 60, 0.2
# Schedules tried; Ipopt's answers depend on them.
TRIES = 10
# How far outside a path may be in m, and the speed in m/s at rest: Ipopt's tolerance of 1e-8, and what follows from it.
SOLVED = 1e-6
# Steps of Runge and Kutta in a hold: of the programme, and of the check.
STEPS, CHECKED = 2, 40


def rate(x, u, is_point, cos=casadi.cos, sin=casadi.sin):
    """The derivative of (x, y, v_x, v_y) or (x, y, heading, speed)."""
    if is_point:
        return x[2], x[3], u[0], u[1]
    return x[3] * cos(x[2]), x[3] * sin(x[2]), u[1], u[0]


def schedule(case, random):
    """The instant of each visit that is made, by its part; None if the drawn ones are not in order."""
    visits = [i for i, part in enumerate(case["parts"]) if part["kind"] == "visit"]
    if case["one_of"]:
        visits.remove(case["one_of"][random.integers(2)])
    instants = {}
    for i in visits:
        begin, end = case["parts"][i]["window"]
        if begin > USED * end:
            return None
        # Late ones are done more easily.
        instants[i] = begin + (USED * end - begin) * random.uniform(0, 1) ** 0.5
    if case["order"] and instants[case["order"][0]] >= instants[case["order"][1]]:
        return None
    return instants


def demands(case, instants):
    """What the path has to do: a disc, whether inside of it, from when and until when."""
    for i, part in enumerate(case["parts"]):
        begin, end = part["window"]
        outside = np.hypot(*(np.array(case["start"][:2]) - part["centre"])) - part["radius"]
        if part["kind"] == "visit" and i in instants:
            yield part, True, instants[i], instants[i] + part["stay"]
        elif part["kind"] == "reach":
            yield part, True, USED * end, np.inf
        # What begins at once is promised to who begins outside.
        elif part["kind"] == "avoid" and (begin > 0 or outside >= 0):
            yield part, False, begin, np.inf if end is None else end
        elif part["kind"] == "closed" and outside >= 0:
            yield part, False, 0.0, instants.get(part["until"], np.inf)


def programme(case, instants):
    """The nonlinear programme: states, inputs, the worst distance outside, and the times of the nodes."""
    opti = casadi.Opti()
    count = HOLDS + int(AFTER * HOLDS)
    # A visit is at a node: the grid is bent to it.
    times = np.linspace(0, case["end"] * (1 + AFTER), count + 1)
    for instant in instants.values():
        times[1 + np.argmin(np.abs(times[1:-1] - instant))] = instant
    x, u, outside = opti.variable(4, count + 1), opti.variable(2, count), opti.variable()
    opti.subject_to(x[:, 0] == case["start"])
    opti.subject_to(outside >= -0.05)
    wanted = list(demands(case, instants))

    def demand(state, at):
        for part, inside, begin, end in wanted:
            if begin - 1e-9 <= at <= end + 1e-9:
                away = casadi.sumsqr(state[:2] - np.array(part["centre"]))
                radius = part["radius"]
                opti.subject_to(away <= (radius + outside) ** 2 if inside else away >= (radius - outside) ** 2)

    for k, hold in enumerate(np.diff(times)):
        end = x[:, k]
        for part in range(STEPS):
            end = step(lambda s: casadi.vertcat(*rate(s, u[:, k], case["is_point"])), end, hold / STEPS)
            if part + 1 < STEPS:
                demand(end, times[k] + hold * (part + 1) / STEPS)
        opti.subject_to(x[:, k + 1] == end)
        opti.subject_to(opti.bounded(-np.array(case["bounds"]), u[:, k], case["bounds"]))
        demand(x[:, k + 1], times[k + 1])
    opti.subject_to(x[3, count] == 0)
    if case["is_point"]:
        opti.subject_to(x[2, count] == 0)
    opti.minimize(outside + 1e-4 * casadi.sumsqr(u) / count)
    quiet = {"print_level": 0, "max_iter": 300, "tol": 1e-8, "sb": "yes"}
    opti.solver("ipopt", {"print_time": False, "expand": True}, quiet)
    return opti, x, u, outside, times


def guess(case, instants, times, random):
    """States along straight ways between the visits, bent to a side at random."""
    ways = [(0.0, case["start"][:2])] + [(t, case["parts"][i]["centre"]) for i, t in instants.items()]
    ways += [(USED * part["window"][1], part["centre"]) for part in case["parts"] if part["kind"] == "reach"]
    ways.sort(key=lambda way: way[0])
    knots = [way[0] for way in ways]
    path = np.array([np.interp(times, knots, [way[1][axis] for way in ways]) for axis in (0, 1)])
    phase = np.interp(times, knots, np.arange(len(knots)))
    path += random.normal(0, 2, (2, 1)) * np.sin(np.pi * phase)
    speed = np.gradient(path, times, axis=1)
    if case["is_point"]:
        return np.vstack([path, speed])
    return np.vstack([path, np.unwrap(np.arctan2(speed[1], speed[0])), np.hypot(*speed)])


def outside_at_most(case, instants, times, inputs):
    """How far outside of what it has to do the path is at worst, in m; infinite if it is not at rest in the end."""
    x, worst = np.array(case["start"], dtype=float), -np.inf
    wanted = list(demands(case, instants))
    for k, hold in enumerate(np.diff(times)):
        for part in range(CHECKED):
            x = step(lambda s: np.array(rate(s, inputs[:, k], case["is_point"], np.cos, np.sin)), x, hold / CHECKED)
            at = times[k] + hold * (part + 1) / CHECKED
            for place, inside, begin, end in wanted:
                if begin - 1e-9 <= at <= end + 1e-9:
                    beyond = np.hypot(*(x[:2] - place["centre"])) - place["radius"]
                    worst = max(worst, beyond if inside else -beyond)
    return worst if np.max(np.abs(x[2 if case["is_point"] else 3 :])) < SOLVED else np.inf


def is_possible(case, random):
    """Whether some schedule leads to a path that does the mission."""
    for _ in range(TRIES):
        drawn = (schedule(case, random) for _ in range(50))
        instants = next((found for found in drawn if found is not None), None)
        if instants is None:
            return False
        opti, x, u, outside, times = programme(case, instants)
        opti.set_initial(x, guess(case, instants, times, random))
        opti.set_initial(outside, 1.0)
        try:
            opti.solve()
        except RuntimeError:
            # Not converged: what it came to may do all the same.
            pass
        bounds = np.array(case["bounds"])[:, None]
        found = np.clip(opti.debug.value(u), -bounds, bounds)
        if np.all(np.isfinite(found)) and outside_at_most(case, instants, times, found) < SOLVED:
            return True
    return False


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        cases = json.load(file)
    random = np.random.default_rng(1)
    possible = accepted = found_none = 0
    for case in cases:
        if is_possible(case, random):
            possible += 1
            accepted += case["accepted"]
            if not case["accepted"]:
                print(f"refused, possible: {json.dumps(case)}", flush=True)
        elif case["accepted"]:
            found_none += 1
    print(
        f"{len(cases)} missions, {possible} possible with a tenth of the time to spare, {accepted} of them accepted "
        f"({100 * accepted / max(1, possible):.1f} %); {found_none} accepted of which the optimiser knew no way"
    )
    sys.exit(3 * possible < len(cases) or accepted < ACCEPTED * possible)


if __name__ == "__main__":
    main()
