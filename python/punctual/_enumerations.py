"""Numbers that leave a filter, by their names: the enumerations of the filter FMU."""

from enum import IntEnum


class Status(IntEnum):
    """How a step ended, and so what its input means."""

    UNCHANGED = 0
    """u_ref satisfies every constraint and is passed through, bit for bit."""
    FILTERED = 1
    """u is the safe input nearest to u_ref."""
    INFEASIBLE = 2
    """Not possible within the input bounds: the input of least violation."""
    NO_AUTHORITY = 3
    """The barrier cannot be influenced at this state: the input of least violation, or the best that was found."""
    INVALID_INPUT = 4
    """Time, state or u_ref is not a number or infinite: the admissible input nearest 0."""
    SINGULAR = 5
    """The model is not finite at this state: the admissible input nearest 0."""
    WRONG_RELATIVE_DEGREE = 6
    """An input enters a derivative of h too early, so the constraint would be wrong: the input nearest 0."""
    SOLVER_FAILED = 7
    """The solver did not converge: u_ref within its bounds."""
    BACKUP = 8
    """The constraints are not met, or lead where no way on is left: a plan decides, and keeps every promise."""
    NOT_ARMED = 9
    """Not armed yet (`arm_after`): nothing is asked or promised, u_ref within its bounds."""


class Assurance(IntEnum):
    """Status of the guarantee of a filter that follows plans."""

    UNDECIDED = 0
    """No step with a valid state yet, or not armed."""
    ASSURED = 1
    """A plan keeps every promise, whatever u_ref is."""
    REFUSED = 2
    """No plan was found at the start: nothing is promised."""
    LOST = 3
    """Was assured: the plant is not where the model led."""
    IRREGULAR = 4
    """Was assured: a step came late, or early without a plan from there."""
    EXPIRED = 5
    """Was assured until now: no plan was found beyond."""


class Phase(IntEnum):
    """Phase of a barrier's promise."""

    WAITING = 0
    """Not begun: no step with valid inputs yet, or not armed."""
    APPROACH = 1
    """Approaching, before the deadline."""
    LATE = 2
    """The deadline passed outside the set; the approach continues."""
    STAY = 3
    """Inside, and kept there."""
    LEFT = 4
    """Outside again; pulled back without a deadline."""
    RELEASED = 5
    """Released: nothing is required any more."""
