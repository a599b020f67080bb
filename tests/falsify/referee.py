"""Compares tubes with those of an interval reachability tool of others, immrax.

    referee.py PLANS.json

PLANS.json is what `PUNCTUAL_PLANS=PLANS.json cargo test --release -p punctual-core --lib plans_for_a_referee` writes: plans of uncertain
vehicles with their laws, how far the tube of each reaches in every state at every sample, and deviations of runs that are among
the worst. immrax encloses the derivatives of a hold over a set of deviations; the set is a box in coordinates that turn with the
hold (Lohner's method). Each tube has to contain every run. Prints how wide ours is in units of its. Fails if a run is outside
either, or ours is wider than it should be.
"""

import json
import sys

import immrax as irx
import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)

# How wide ours may be in units of theirs, in a position.
WIDER = 1.5
# The error of the integrators of runs and holds.
INTEGRATED = 1e-7
# A tube that reaches as far has run away: it then contains anything.
AWAY = 100.0
# Steps of Runge and Kutta in a hold.
STEPS = 2
# The distance of the bicycle's centre from its rear axle in m.
LENGTH = 2.5


def point_mass(x, u):
    return jnp.array([x[2], x[3], u[0], u[1]])


def unicycle(x, u):
    return jnp.array([x[3] * jnp.cos(x[2]), x[3] * jnp.sin(x[2]), u[1], u[0]])


def bicycle(x, u):
    return jnp.array([x[3] * jnp.cos(x[2]), x[3] * jnp.sin(x[2]), x[3] * u[1] / LENGTH, u[0]])


PLANTS = {"point mass": point_mass, "unicycle": unicycle, "bicycle": bicycle}


def derivatives(rate):
    """Of the state after a hold by deviation, error of measurement, rates and gains: as intervals."""

    def hold(e, error, added, gain, z, v, law, h):
        seen = e + error
        u = [v[i] + sum(law[i, j] * seen[j] for j in range(4)) for i in range(2)]
        arrives = jnp.array([u[i] * gain[i] for i in range(2)])
        x = z + e
        step = h / STEPS
        for _ in range(STEPS):
            k1 = rate(x, arrives) + added
            k2 = rate(x + 0.5 * step * k1, arrives) + added
            k3 = rate(x + 0.5 * step * k2, arrives) + added
            k4 = rate(x + step * k3, arrives) + added
            x = x + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        return x

    return jax.jit(irx.natif(jax.jacfwd(hold, argnums=(0, 1, 2, 3))))


def box(middle, half):
    middle, half = jnp.asarray(middle, float), jnp.asarray(half, float)
    return irx.interval(middle - half, middle + half)


def tube(plan, of):
    """How far each state may be from the plan at every sample."""
    rates, errors, gains = (np.array(plan[key]) for key in ("rates", "errors", "gains"))
    middle, half = gains.mean(axis=1), np.diff(gains, axis=1)[:, 0] / 2.0
    # Deviations are turned @ y, with |y| <= r.
    turned, r = np.eye(4), errors.copy()
    found, times = [r.copy()], np.diff(plan["times"])
    for k, h in enumerate(times[:-1]):
        reach = found[-1]
        if not reach.max() < AWAY:
            found.append(np.full(4, np.inf))
            continue
        law = np.reshape(plan["gain"][k], (2, 4)) if plan["gain"][k] else np.zeros((2, 4))
        sets = (box(np.zeros(4), reach), box(np.zeros(4), errors), box(np.zeros(4), rates), box(middle, half))
        at = (box(plan["states"][k], 0.0), box(plan["inputs"][k], 0.0), box(law, 0.0), box(h, 0.0))
        parts = [(np.asarray(part.lower), np.asarray(part.upper)) for part in of(*sets, *at)]
        middles = [0.5 * (low + high) for low, high in parts]
        halves = [0.5 * (high - low) for low, high in parts]
        by_state, width = middles[0], halves[0]
        others = width @ reach
        for mid, wide, size in zip(middles[1:], halves[1:], (errors, rates, half), strict=True):
            others = others + (np.abs(mid) + wide) @ size
        moved = by_state @ turned
        order = np.argsort(-np.linalg.norm(moved * r, axis=0))
        q, _ = np.linalg.qr(moved[:, order] * np.maximum(r[order], 1e-12))
        r = np.abs(q.T @ moved) @ r + np.abs(q.T) @ others
        turned = q
        found.append(np.abs(turned) @ r)
    return np.array(found)


def main():
    plans = json.loads(open(sys.argv[1], encoding="utf-8").read())
    known = {name: derivatives(rate) for name, rate in PLANTS.items()}
    is_good, widest = True, []
    for plan in plans:
        theirs, ours = tube(plan, known[plan["plant"]]), np.array(plan["reach"])
        runs = np.abs(np.array(plan["runs"]))
        in_theirs, in_ours = ((runs <= tube[: runs.shape[1]] + INTEGRATED).all() for tube in (theirs, ours))
        ratio = (ours / theirs)[1:, :2]
        is_good &= bool(in_theirs and in_ours and ratio.max() <= WIDER)
        widest.append(ratio.max())
        stays = np.isfinite(theirs[1:, 0])
        print(
            f"{plan['plant']}: {len(runs)} runs in theirs {in_theirs}, in ours {in_ours}; theirs stays near for "
            f"{plan['times'][stays.sum()]:.2f} of {plan['times'][-2]:.2f} s; ours in units of it, in a position: median "
            f"{np.median(ratio[stays]):.2f}, at most {ratio.max():.2f}"
        )
    print(f"{len(plans)} plans, ours at most {max(widest):.2f} times as wide")
    if not is_good:
        sys.exit("a run is outside a tube, or ours is too wide")


if __name__ == "__main__":
    main()
