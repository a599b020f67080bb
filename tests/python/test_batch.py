"""`punctual.FilterBatch`: many loops, each with the bits of a `Filter` of its own."""

import copy
import os
import pickle
import signal
import subprocess
import sys

import numpy as np
import punctual
import pytest

from conftest import ASSURED, FILTER, ROOT, STEP, exactly, goal

STEPS = 60


def drawn(n, steps=STEPS):
    """States along which n unicycles might go, and their wanted inputs: (steps, n, 4) and (steps, n, 2)."""
    random = np.random.default_rng(7)
    x = random.uniform([-5.0, -5.0, -3.0, 0.0], [25.0, 15.0, 3.0, 8.0], (n, 4)) + np.zeros((steps, 1, 1))
    x[:, :, :2] += 0.05 * np.cumsum(random.uniform(-1.0, 1.0, (steps, n, 2)), axis=0)
    return x, random.uniform(-3.0, 3.0, (steps, n, 2))


# One row, fewer and more than a part takes, and a number that no number of parts divides.
@pytest.mark.parametrize("n", [1, 15, 257])
def test_every_row_is_that_of_a_filter_of_its_own(n):
    x, u_ref = drawn(n)
    batch, singles = punctual.FilterBatch(FILTER, n), [punctual.Filter(FILTER) for _ in range(n)]
    statuses = set()
    for k in range(STEPS):
        if k == STEPS // 2:
            chosen = np.arange(n) % 3 == 0
            batch.rearm(chosen)
            for single, again in zip(singles, chosen):
                if again:
                    single.rearm()
        u, status, h = batch.step(k * STEP, x[k], u_ref[k])
        assert (u.shape, status.shape, h.shape) == ((n, 2), (n,), (n, 2))
        for i, single in enumerate(singles):
            step = single.step(k * STEP, x[k, i], u_ref[k, i])
            assert step.u.tolist() == u[i].tolist(), (k, i)
            assert step.status == status[i]
            assert [barrier.h for barrier in step.barriers.values()] == h[i].tolist()
        statuses |= set(status.tolist())
    assert punctual.Status.FILTERED in statuses
    if n > 1:
        assert len(statuses) > 1


def test_every_row_may_have_a_time_of_its_own():
    n = 40
    moving = FILTER["barrier"] + [{"name": "cart", "shape": "obstacle", "centre": [9.0, 9.0], "velocity": [0.5, -1.0], "radius": 1.0}]
    configuration = FILTER | {"barrier": moving}
    x, u_ref = drawn(n)
    batch, singles = punctual.FilterBatch(configuration, n), [punctual.Filter(configuration) for _ in range(n)]
    begin = 7.0 * np.random.default_rng(3).random(n)
    for k in range(STEPS):
        t = begin + k * STEP
        u, status, h = batch.step(t.tolist() if k % 2 else t, x[k], u_ref[k])
        for i, single in enumerate(singles):
            step = single.step(t[i], x[k, i], u_ref[k, i])
            assert (step.u.tolist(), int(step.status)) == (u[i].tolist(), status[i]), (k, i)
            assert [barrier.h for barrier in step.barriers.values()] == h[i].tolist()
    # One time for all, in every way that a number may be held.
    kinds = [float, int, np.float32, np.int64, np.array, lambda t: np.full(n, t), lambda t: [t] * n]
    assert len({copy.copy(batch).step(kind(9), x[0])[0].tobytes() for kind in kinds}) == 1
    for wrong, words in [(t[:-1], r"^t: has shape \(39,\), must have \(40,\) \(s\)$"), ("now", "^t: is str, must be a real number")]:
        with pytest.raises((TypeError, ValueError), match=words):
            batch.step(wrong, x[0])


def test_an_integrated_input_belongs_to_its_row():
    file, n = ROOT / "examples" / "vehicles" / "car-filter.toml", 40
    x, u_ref = drawn(n)
    batch, singles = punctual.FilterBatch(file, n), [punctual.Filter(file) for _ in range(n)]
    for k in range(STEPS):
        if k == STEPS // 2:
            chosen = np.arange(n) % 2 == 0
            batch.reset(chosen)
            [single.reset() for single in singles[::2]]
        u, _, _ = batch.step(k * STEP, x[k], u_ref[k])
        assert u.tolist() == [s.step(k * STEP, x[k, i], u_ref[k, i]).u.tolist() for i, s in enumerate(singles)]


def test_all_is_forgotten_by_reset():
    x, u_ref = drawn(20)
    batch = punctual.FilterBatch(FILTER, 20)
    assert len(batch) == 20 and list(batch.states) == ["x_p", "y_p", "theta", "v"]
    assert list(batch.inputs) == ["a", "omega"] and list(batch.barriers) == ["goal", "post"]
    first = [batch.step(k * STEP, x[k], u_ref[k]) for k in range(5)]
    batch.reset()
    for k, before in enumerate(first):
        for a, b in zip(before, batch.step(k * STEP, x[k], u_ref[k])):
            assert a.tobytes() == b.tobytes()


def test_u_ref_is_zero_by_default_and_type_and_layout_do_not_matter():
    given = [*zip(exactly(range(80), (20, 4)), exactly([0.0] * 40, (20, 2)))]
    given.append((given[0][0], None))
    answers = [[a.tobytes() for a in punctual.FilterBatch(FILTER, 20).step(0.0, *g)] for g in given]
    assert answers == [answers[0]] * len(given)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda own: pickle.loads(pickle.dumps(own))])
@pytest.mark.parametrize("configuration", [FILTER, ASSURED], ids=["rows", "plans"])
def test_a_copy_goes_on_with_the_same_bits(configuration, copied):
    n = 20
    x, u_ref = drawn(n, 8)
    batch, straight = punctual.FilterBatch(configuration, n), punctual.FilterBatch(configuration, n)

    def said(own, k, wanted):
        return [a.tobytes() for a in own.step(k * STEP, x[k], wanted)] + [own.guaranteed.tobytes()]

    begun = [said(batch, k, u_ref[k]) for k in range(4)]
    again = copied(batch)
    assert (len(again), again.step_size) == (n, STEP) and again.guaranteed.tobytes() == batch.guaranteed.tobytes()
    gone = [said(again, k, u_ref[k]) for k in range(4, 8)]
    other = [said(batch, k, -u_ref[k]) for k in range(4, 8)]
    assert [said(straight, k, u_ref[k]) for k in range(8)] == begun + gone
    assert gone != other
    again.reset()
    assert [said(again, k, u_ref[k]) for k in range(4)] == begun


def test_guarantees_are_those_of_the_rows():
    n = 12
    x, u_ref = drawn(n, 3)
    # It starts inside the post, which is then not promised.
    x[:, 0, :2] = [8.0, 5.0]
    batch, singles = punctual.FilterBatch(ASSURED, n), [punctual.Filter(ASSURED) for _ in range(n)]
    assert batch.guaranteed.tolist() == [[False, False]] * n
    for k in range(3):
        batch.step(k * STEP, x[k], u_ref[k])
        steps = [own.step(k * STEP, x[k, i], u_ref[k, i]) for i, own in enumerate(singles)]
        assert batch.guaranteed.tolist() == [[b.guaranteed for b in step.barriers.values()] for step in steps]
    assert batch.guaranteed.any() and not batch.guaranteed.all()
    # What restarts has no promise until its next step.
    told, chosen = batch.guaranteed, batch.guaranteed.any(axis=1) & (np.arange(n) % 2 == 0)
    assert chosen.any()
    batch.rearm(chosen)
    assert batch.guaranteed.tolist() == (told & ~chosen[:, None]).tolist()
    batch.reset()
    assert not batch.guaranteed.any()


def test_the_number_of_threads_changes_no_bit():
    script = """
import sys; import numpy as np, punctual; sys.path.append(sys.argv[1])
from conftest import FILTER
from test_batch import drawn
x, u_ref = drawn(300, 3)
batch = punctual.FilterBatch(FILTER, 300)
print([a.tobytes().hex() for k in range(3) for a in batch.step(k * 0.01, x[k], u_ref[k])])
"""
    folder = os.path.dirname(__file__)
    outputs = {
        subprocess.run(
            [sys.executable, "-c", script, folder],
            env=os.environ | {"RAYON_NUM_THREADS": threads},
            check=True,
            capture_output=True,
        ).stdout
        for threads in ["1", "3"]
    }
    assert len(outputs) == 1


def test_a_forked_process_has_threads_of_its_own():
    x, u_ref = drawn(300, 2)
    batch = punctual.FilterBatch(FILTER, 300)
    batch.step(0.0, x[0], u_ref[0])
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        # A pool of the parent would let it wait for ever.
        signal.alarm(20)
        os.write(write, batch.step(STEP, x[1], u_ref[1])[0].tobytes()[:4000])
        os._exit(0)
    _, status = os.waitpid(child, 0)
    assert status == 0
    assert os.read(read, 4000) == batch.step(STEP, x[1], u_ref[1])[0].tobytes()[:4000]


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ((np.zeros((3, 4)),), ValueError, r"x: has shape \(3, 4\), must have \(5, 4\) \(x_p, y_p, theta, v\)"),
        ((np.zeros(20),), ValueError, r"x: has shape \(20,\), must have \(5, 4\)"),
        ((np.zeros((5, 4)), np.zeros((5, 4))), ValueError, r"u_ref: has shape \(5, 4\), must have \(5, 2\) \(a, omega\)"),
        (([[0.0] * 4] * 4,), ValueError, r"x: has shape \(4, 4\), must have \(5, 4\)"),
        (([[0.0] * 4, [0.0]],), ValueError, r"x: is list of no shape, must be real numbers .* of shape \(5, 4\)"),
        ((np.zeros((5, 4), complex),), TypeError, r"x: is ndarray of complex128, must be real numbers .* of shape \(5, 4\)"),
        ((np.zeros((5, 4), bool),), TypeError, "x: is ndarray of bool, must be real numbers"),
        ((np.ma.zeros((5, 4)),), TypeError, r"x: is MaskedArray, must be real numbers .* \(x_p, y_p, theta, v\) without a mask"),
        ((np.zeros((5, 4)), np.full((5, 2), "a")), TypeError, "u_ref: is ndarray of <U1, must be real numbers"),
        ((np.zeros((5, 4)), np.zeros((5, 2), object)), TypeError, "u_ref: is ndarray of object, must be real numbers"),
    ],
)
def test_other_arrays_are_refused(arguments, error, words):
    with pytest.raises(error, match=words):
        punctual.FilterBatch(FILTER, 5).step(0.0, *arguments)


def test_other_arguments_are_refused():
    for n in [0, -1, 1 << 70]:
        with pytest.raises(ValueError, match=f"^n: is {n}, must be >= 1, and at most "):
            punctual.FilterBatch(FILTER, n)
    for n in [True, 1.5, "5", None]:
        with pytest.raises(TypeError, match=f"^n: is {n!r}, must be a whole number >= 1$"):
            punctual.FilterBatch(FILTER, n)
    # 500 TB, more than a process has addresses; and more bytes than there are numbers for.
    for n in [1 << 40, 1 << 62]:
        with pytest.raises(MemoryError, match=f"^n: is {n}, more rows than there is memory for$"):
            punctual.FilterBatch(FILTER, n)
    assert len(punctual.FilterBatch(FILTER, np.int64(5))) == 5
    with pytest.raises(punctual.Error, match=r"^barrier\[0\]\.deadline: "):
        punctual.FilterBatch(FILTER | {"barrier": [goal(deadline=0.0)]}, 2)
    batch = punctual.FilterBatch(FILTER, 5)
    with pytest.raises(ValueError, match=r"rows: has shape \(4,\), must have \(5,\)"):
        batch.rearm(np.zeros(4, bool))
    with pytest.raises(TypeError, match=r"rows: is ndarray of int64, must be bool of shape \(5,\)"):
        batch.reset(np.zeros(5, int))
    for t, words in [(True, "t: is bool, "), ("0", "t: is str, "), (np.ma.zeros(5), "t: is MaskedArray, ")]:
        with pytest.raises(TypeError, match=f"^{words}"):
            batch.step(t, np.zeros((5, 4)))
    with pytest.raises(TypeError, match=r"^rows: is MaskedArray, must be bool of shape \(5,\) without a mask$"):
        batch.reset(np.ma.zeros(5, bool))
    batch.reset([True, False, True, False, True])
