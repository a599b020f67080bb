//! The numbers that decide how the search for plans proceeds: grids, guesses, rounds, weights and steps.
//!
//! None of them decides a guarantee: what the search finds is checked by the [tolerances](super::check::CheckTolerances)
//! alone. They decide what is found, and how long that takes. A field says what a number is, and its unit; [`SETTINGS`] has
//! the values, each with the reason for its size.

use super::check::TOLERANCES;

/// How the search for plans proceeds. A part of something has no unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchSettings {
    // Grids.
    /// Grids, in order. Each has the part of the time until each deadline after which the search already requires its set,
    /// and the number of holds until the last deadline and after it.
    pub(crate) grids: [(f64, [usize; 2]); 3],
    /// The last grid, if there is a deadline.
    pub(crate) slow_grid: (f64, [usize; 2]),
    /// The length of a hold in periods if there is no deadline.
    pub(crate) undated: usize,
    /// Longer holds in periods, on the first grid, if there is no deadline.
    pub(crate) undated_longer: [usize; 2],
    /// The part of a period, or of a hold, by which a deadline may lie before a node and still count as at the node.
    pub(crate) on_node: f64,
    /// Largest number of samples until a deadline.
    pub(crate) most_samples: usize,
    /// The number of samples in a usual period above which a plan has longer holds.
    pub(crate) frequent: f64,
    /// Growth of a deviation over a hold of the search above which its grid is refined.
    pub(crate) led: f64,
    /// Largest refinement of that grid.
    pub(crate) finest: usize,
    /// How far a plan without an equilibrium is sought, in units of how far it has to reach.
    pub(crate) ample: f64,

    // Guesses, and how far they are followed.
    /// First guesses: inputs as a part of their bounds, and the part of the time for which they are held.
    pub(crate) guesses: [[f64; 2]; 4],
    /// Largest number of inputs with which several guesses are followed at once; with more, the first is followed alone before.
    pub(crate) at_once: usize,
    /// The rounds of a guess that is followed alone.
    pub(crate) alone: [(usize, u32); 2],
    /// The quadratic programs for ways that ignore what is in the way.
    pub(crate) unhindered: u32,
    /// The number of guesses that push these ways to the sides, and how hard, as a part of the bounds.
    pub(crate) pushes: u32,
    pub(crate) pushed: f64,
    /// The rounds of these guesses.
    pub(crate) passed: [(usize, u32); 2],
    /// Largest number of inputs of which a guess moves one at a time.
    pub(crate) one_by_one: usize,
    /// Largest number of evaluations of a policy over a hold of the search, which uses their mean.
    pub(crate) asked: f64,
    /// Rounds of a search: the number of guesses that continue, nearest first, and the quadratic programs for each of them.
    pub(crate) rounds: [(usize, u32); 3],
    /// One more round for the nearest guess, if it nearly does.
    pub(crate) polishing: (usize, u32),
    /// The same for guesses that lead to an equilibrium within the sets.
    pub(crate) aimed_rounds: [(usize, u32); 2],
    /// The same for guesses near a plan that was found.
    pub(crate) beside_rounds: [(usize, u32); 2],
    /// The number of grids for these guesses.
    pub(crate) beside_grids: usize,
    /// Largest violation at which a trajectory is worth the exact check, as a part of the size of h.
    pub(crate) worth: f64,

    // Margins.
    /// Margins in the search, in units of those of the check.
    pub(crate) searched: f64,
    /// Margin at a limit of an integral in the search, as a part of the distance to it at the start.
    pub(crate) room: f64,
    /// Margin that is added for a shortfall, in units of the shortfall.
    pub(crate) tighter: f64,
    /// Largest number of checks of a trajectory, each after the first with more margin.
    pub(crate) tightened: u32,
    /// Parts of a hold between which many vehicles are looked at, before they are tightened.
    pub(crate) between: u32,
    /// The number of quadratic programs between two checks.
    pub(crate) tightening: u32,
    /// Largest number of consecutive checks whose shortfall hardly decreases.
    pub(crate) stuck: u32,
    /// A shortfall hardly decreases if it stays above this part of the least one so far.
    pub(crate) less: f64,

    // The model of the search.
    /// Error of the model over a hold, as a part of 1 plus the size of a state (1 in its unit): for trajectories, and for
    /// the laws that end them.
    pub(crate) resolved: [f64; 2],
    /// The longest step of the model, in sampling periods.
    pub(crate) coarse: f64,
    /// The number of steps in a hold with the longest step of the model, if that step is longer than `coarse` periods.
    pub(crate) fine: f64,
    /// Halvings of the model's step until it is resolved.
    pub(crate) step_halvings: u32,

    // Equilibria.
    /// Largest number of Gauss-Newton steps to an equilibrium.
    pub(crate) equilibrium_steps: u32,
    /// Largest rate of a state at an equilibrium, beside round-off, in its unit per s.
    pub(crate) equilibrium_rate: f64,
    /// Least singular value of such a step that counts, as a part of the largest.
    pub(crate) rank: f64,
    /// The depth inside a set that the equilibrium aims at, in units of the required depth.
    pub(crate) beyond: f64,
    /// How many times as deep inside the sets as the last one the next equilibrium is sought, and how often.
    pub(crate) deeper: (f64, usize),

    // Quadratic programs.
    /// Price of a violation as large as h along the trajectory, in units of the price of full inputs all the time.
    pub(crate) penalty: f64,
    /// A row counts as near its edge up to this part of the largest h along the trajectory.
    pub(crate) near: f64,
    /// Least price of a row that counts, in units of that of a violation.
    pub(crate) priced: f64,
    /// Price of a row that a rejected step broke, in the same unit.
    pub(crate) learned: f64,
    /// What is left of such a price after an accepted step.
    pub(crate) fading: f64,
    /// Least size of a requirement that is nearly met, as a part of the largest |h| along the trajectory.
    pub(crate) least_size: f64,
    /// Largest rate at the end that counts as none, as a part of the largest of that state along the trajectory.
    pub(crate) end_rate: f64,
    /// Initial trust region, as a part of half the width of the bounds.
    pub(crate) trust: f64,
    /// Least trust region, in the same unit.
    pub(crate) least_trust: f64,
    /// Least part of the expected gain at which a step counts as one that went as expected.
    pub(crate) as_expected: f64,
    /// Largest curvature of a trajectory, as a part of its change, for which the linear model counts.
    pub(crate) bent: f64,
    /// Largest number of iterations of the solver.
    pub(crate) iterations: u32,
    /// Gap between the solver's answer and its bound, absolute and as a part of the merit: in a search that has time, and in
    /// a quick one or one for many inputs.
    pub(crate) gaps: [f64; 2],
    /// Residual of the solver's constraints, absolute and as a part of their terms.
    pub(crate) feasible: f64,

    // Laws.
    /// Price of an input, in units of what one hold of it gains. Near 0 the plant is stopped in as few holds as possible.
    pub(crate) gentleness: f64,
    /// Largest number of steps of the Riccati equation until it counts as settled.
    pub(crate) riccati: u32,
    /// Smallest relative to largest part of a deviation that moves over a hold, above which an equilibrium counts as
    /// isolated.
    pub(crate) sole: f64,
    /// Growth of a deviation from an equilibrium over the longest hold that still stabilises it.
    pub(crate) lost: f64,
    /// How fast the law approaches an equilibrium that does not stay, relative to how fast the plant leaves it (an
    /// exponent).
    pub(crate) haste: f64,
    /// Largest movement of one state over a hold, as a part of another state, that is round-off of a difference.
    pub(crate) still: f64,

    // A search that is spread over samples.
    /// The number of holds of its grid until the last deadline and after it.
    pub(crate) renewal_holds: [usize; 2],
    /// The number of its guesses: one that follows the current plan, one for each of `wanted`, and the first ones of a
    /// search.
    pub(crate) renewal_guesses: u32,
    /// The parts of the time until the last deadline for which a guess holds the wanted input.
    pub(crate) wanted: [f64; 2],
    /// The number of quadratic programs for which a guess is pursued.
    pub(crate) followed: u32,
    /// A guess is pursued further if a sample leaves less than this part of its violation.
    pub(crate) left: f64,
}

/// The settings of every search.
pub(crate) const SETTINGS: SearchSettings = SearchSettings {
    // The first is for a plant that stops soon, the second for one that does not, the third for deadlines that leave much
    // time, for which long holds are too coarse. More holds are finer, and cost as much more in every program. Two more
    // grids, for sooner deadlines, made refusals take too long and were given up.
    grids: [(1.0, [32, 12]), (1.0, [16, 28]), (0.35, [32, 12])],
    // For a plant that takes many times as long as its deadline to reach an equilibrium: ten times here.
    slow_grid: (1.0, [4, 40]),
    // 12 holds of five periods; at 1 ms that is 0.06 s, and a vehicle that needs 0.4 s to stop was refused. How long a plant takes to stop does not depend on the period. Each of the longer ones lasts eight times as
    // long. They come last, since some starts are kept by short holds only (`a_wall_is_promised_at_every_period`).
    undated: 5,
    undated_longer: [40, 320],
    // A deadline that is a whole number of periods stays one despite round-off, and despite the millionth of a period by
    // which requirements begin earlier (`CheckTolerances::on_time`). So it is more than that. The rest of a hold is too
    // short to matter.
    on_node: 1e-5,
    // A limit of arithmetic: so many samples fit an integer of 32 bits, and times keep their digits. The number of nodes
    // does not depend on it.
    most_samples: 100_000_000,
    // Up to four times as many holds cost up to four times as much; above that the holds of a plan are as long as usual, so
    // that the cost does not grow (`the_cost_of_a_step_does_not_grow_as_it_gets_shorter`).
    frequent: 4.0,
    // Above `lost`, since a program foresees what comes after a hold and a law does not. With less, grids are finer and
    // programs larger, and more plants need more than `finest` times as many holds. With more, linear models of a hold are
    // worse. There is no measurement for either.
    led: 1.8,
    finest: 3,
    // The next search is that much later: each of them costs as much as that of a first sample. With more, a plan is harder
    // to find; with less, it is sought more often.
    ample: 1.5,

    // To either side: for a third of the time, briefly, and as a nudge of two holds. The last is a hard turn, which no other
    // guess leads to (`a_hard_turn_is_found`). Each costs a rollout per side, and may displace others in `rounds`.
    guesses: [[0.4, 0.35], [0.6, 0.1], [0.5, 0.0], [1.0, 0.6]],
    // With two inputs a program takes milliseconds and the first guess seldom leads around an obstacle; with those of four
    // vehicles it takes a tenth of a second, and they mostly pass one another.
    at_once: 2,
    alone: [(1, 6), (1, 20)],
    // Ways without one another are nearly straight, and take few programs. Ten robots on a circle that swap places meet in its middle, and
    // none of their ways gives way until they are pushed (`ten_robots_swap_places`).
    unhindered: 6,
    pushes: 6,
    pushed: 0.3,
    passed: [(6, 4), (3, 16)],
    // Each guess is followed once, and a team of ten would have eighty of each size.
    one_by_one: 8,
    // A limit of time: a policy may be slow, and a hold of the search has thousands of samples at short periods.
    asked: 16.0,
    // A few programs show which guesses lead somewhere, and only those get more. Up to 24 + 30 + 36 programs on each grid
    // are what a refusal costs. (14, 2), (5, 6), (3, 20) were tried together with two more grids, and given up with them:
    // refusals took too long.
    rounds: [(12, 2), (5, 6), (3, 12)],
    // Several visits among obstacles converge slowly once they miss by millimetres. It only prolongs a search that has failed.
    polishing: (1, 30),
    // Usually one of the two guesses is a plan as it is, so that few programs are needed.
    aimed_rounds: [(2, 2), (2, 6)],
    // There are three such guesses. The rounds were (3, 2), (1, 6) once, and were raised twice to find sooner deadlines
    // (`the_earliest_deadline_is_near_what_physics_allows`). With less, the earliest deadline found is later.
    beside_rounds: [(3, 4), (2, 20)],
    // A limit of time: the search for the earliest deadline makes many of these searches, and most of them find nothing.
    // There is no measurement for its size.
    beside_grids: 2,
    // A hundred times the margin of a check, so that what the check finds can be corrected by `tighter`. With more, checks
    // are made that fail; with less, trajectories are given up that only need another margin.
    worth: 0.01,

    // More than the margins of the check, so that the answer passes it: the sketch errs by up to 1e-5 (`resolved`), a tenth
    // of a margin, and h dips between two nodes. With more, less room is left in narrow sets.
    searched: 3.0,
    // At a limit the check asks for no margin, so the search has to have one of its own. With more, less of the integral can
    // be used; with less, round-off of the search fails the check. There is no measurement for its size.
    room: 1e-3,
    // More than what is missing, since the next answer dips elsewhere. With 1 the next check most likely fails again, by
    // less.
    tighter: 1.5,
    // A trajectory is tightened as long as less and less is missed. The first limit is one of time. A set that is small
    // compared with its distance needs several (`small_sets_are_promised_from_far_away`).
    tightened: 12,
    // Two vehicles that meet in a hold are nearest in its middle or close to it.
    between: 8,
    // As few as show whether the shortfall decreases. With more, a trajectory that gets nowhere costs more.
    tightening: 4,
    // Three checks in a row that win less than 30 % each: the trajectory gets nowhere.
    stuck: 3,
    less: 0.7,

    // A sketch is enough for trajectories: it errs by a tenth of a usual margin (1e-4), and the check follows the plant
    // itself. Laws take equilibria and eigenvalues from the second, which is as exact as the check
    // (`CheckTolerances::residual`). With less, steps are shorter; with more of the first, answers fail the check.
    resolved: [1e-5, 1e-8],
    // With few samples in a hold a step is four periods, with many a thirty-second of the hold, so that the cost of a hold
    // does not grow with its samples. `step_halvings` makes either as fine as `resolved` asks.
    coarse: 4.0,
    fine: 32.0,
    // 64 times as fine as at first. A model that this does not resolve is refused as singular. With more, stiff plants take
    // longer, up to twice for each.
    step_halvings: 7,

    // Newton's method takes a few; thirty allow for bounds that stop inputs. None found means another guess, or no law.
    equilibrium_steps: 30,
    // It ends a plan if the largest rate is 1e-3 or more, since a millionth of that counts as none
    // (`CheckTolerances::at_equilibrium`). That is one reason for units in which states are about 1 (docs/guarantees.md).
    equilibrium_rate: 1e-9,
    // Round-off of a difference is 2e-10 (`CheckTolerances::difference`), and what is below it is none. With less, a step along a direction
    // that moves nothing is taken, and far; with more, slow states are left where they are.
    rank: 1e-9,
    // Deeper than required, so that round-off does not miss the set, and Newton's method arrives inside of a curved one.
    beyond: 1.5,
    // As deep as there is room, up to a million times the margin of the search (4¹⁰). A larger factor misses the depth of a
    // small set by more, a smaller one takes more searches.
    deeper: (4.0, 10),

    // An exact penalty has to exceed the multipliers of the rows, so that a violation is never worth the inputs that it
    // saves. With less, trajectories stop short of a set; with more, the merit is dominated by violations, and steps along
    // an edge are seldom accepted. There is no measurement for its size.
    penalty: 300.0,
    // These two decide cost: a row that was left out comes in if the answer would break it, and the curvature of a row
    // without a price adds nothing.
    near: 0.1,
    priced: 1e-6,
    // Enough that no input is worth it; and less than what is broken already. Without it a program for ten robots leaves a round goal
    // sideways, since nothing but a price tells it that the goal is round. There is no measurement for its size.
    learned: 0.1,
    fading: 0.5,
    // A small set far away: its size is that of h near it, of which nearly nothing is left if it is nearly met. So one whose
    // h falls to 1e-4 keeps a size. With less, a violation of round-off counts as large.
    least_size: 1e-4,
    // The stopping controller takes over at the end, and brakes what is left. With less, programs are spent on what it does
    // anyway; with more, it needs the time for it.
    end_rate: 0.01,
    // With more, the first answers are farther from their linear model, which costs the programs that shrink the region;
    // with less, it takes programs to come to the bounds. There is no measurement for its size.
    trust: 0.7,
    // The end of a descent: a thousandth of the bounds changes little.
    least_trust: 1e-3,
    // Below it the step is tried again with feedback along its linear model, and above it the trust region grows. With more,
    // feedback is tried where it gains little; with less, trust grows though the linear model errs. There is no measurement.
    as_expected: 0.7,
    // An input that turns a vehicle curves its trajectory, one that accelerates it does not, and only the first loses trust.
    // There is no measurement for its size.
    bent: 0.2,
    // A limit of time. What is not solved by then makes the trust region shrink.
    iterations: 60,
    // A descent ends at gains below a hundredth of the merit: 1e-4 is a hundredth of that, and 1e-6 leaves nothing to ask. A
    // quick search is also without iterative refinement, since every sample waits for it.
    gaps: [1e-6, 1e-4],
    // Constraints are those of the linear model, scaled to 1; the rollout that follows is without this error.
    feasible: 1e-6,

    // With less, a plant is stopped sooner, by larger inputs; with more, a stop takes longer. There is no measurement for
    // its size.
    gentleness: 0.3,
    // It settles to 1e-12. A closed loop that loses 1 % of a deviation in each hold takes 1400 steps for that (0.99²ⁿ =
    // 1e-12). What has not settled by then is used as it is.
    riccati: 2000,
    // Far above round-off of a difference, 2e-10, so that a vehicle, which can stop anywhere, is not isolated
    // by it. It decides which guesses come first, and not which there are.
    sole: 1e-6,
    // A deviation grows by a third until feedback acts again. With more, the bounds are sooner too narrow to catch the
    // plant; with less, holds are shorter, down to the period, and rollouts have more of them. There is no measurement for
    // its size.
    lost: 1.35,
    // Below 1 the law approaches more slowly than the plant leaves. With more, its inputs are larger, and sooner at their
    // bounds; with less, plans take longer to their end. There is no measurement for its size.
    haste: 0.6,
    // Fifty times the round-off of a difference, 2e-10. What does not move has no price, so that nothing is braked there.
    still: 1e-8,

    // Fewer than those of a first search, since a program takes as much longer as there are holds, and a sample has time for
    // `search_budget` of them.
    renewal_holds: [20, 10],
    // 1 + 2 + 9: with one input all nine first guesses of a search, with two the stop and the eight sides of the first.
    // States hold its number, so that another one changes which states are valid.
    renewal_guesses: 12,
    // The same parts as in `guesses`.
    wanted: [0.35, 0.1],
    // Five samples with the default budget of three. With more, a guess that gets nowhere delays the next ones; with less,
    // some are given up too soon.
    followed: 15,
    // A fifth in a sample. With more, a guess that converges slowly is pursued up to `followed`.
    left: 0.8,
};

// Numbers whose size is said to follow from others.
const _: () = {
    let SearchSettings { on_node, lost, led, rank, wanted, guesses, renewal_guesses, .. } = SETTINGS;
    assert!(TOLERANCES.on_time < on_node && lost < led && f64::EPSILON / TOLERANCES.difference < rank);
    assert!(wanted[0] == guesses[0][1] && wanted[1] == guesses[1][1]);
    assert!(renewal_guesses as usize == 1 + wanted.len() + 1 + 2 * guesses.len());
};
