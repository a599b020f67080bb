//! The numbers by which a filter decides on a guarantee at a sample: margins, deadlines, time, and the deviation of the
//! plant.
//!
//! What a plan has to meet beside the margins here stands in `plan::check::tolerances`, how plans are searched for in
//! `plan::settings`. The numbers of `choice` are not here: they say which input is preferred, and every one of them has a
//! plan behind it. A field says what a number is, and its unit; [`DECISIONS`] has the values, each with the reason for its
//! size.

use crate::plan::{CheckTolerances, TOLERANCES};

/// What a filter promises, and when it withdraws that. A part of something has no unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct DecisionSettings {
    // Margins.
    /// Margin of a plan, as a part of the size of h at the first sample.
    pub(super) margin: f64,
    /// The least margin: the change of h if each state moves by the first number (in its unit), plus the second as a part of
    /// its size.
    pub(super) resolved: [f64; 2],
    /// The largest margin, as a part of the largest h that is found.
    pub(super) room: f64,
    /// Largest number of steps uphill in the search for that h.
    pub(super) climbs: u32,
    /// Largest number of halvings of such a step that does not climb.
    pub(super) climb_halvings: u32,
    /// Margin of rows with plans behind them, in units of the margin of the plans. A new plan also keeps that part of the
    /// user's margin in reserve (1/`ample`), and a state with less than `ample` margins has a period to leave the edge.
    pub(super) ample: f64,
    /// By how much the integral may miss its limit, as a part of the limit.
    pub(super) limit_round_off: f64,

    // Deadlines.
    /// Parts of the deadlines for which a plan is sought if none is found for the deadlines themselves; such a plan keeps
    /// them too.
    pub(super) shorter: [f64; 1],
    /// The approximate largest number of points of a plan's trajectory at which its arrival is looked for.
    pub(super) most_points: f64,
    /// How much later the deadline may be than the plan's arrival, as factors that are tried in turn.
    pub(super) arrived: [f64; 2],
    /// The least and the largest factor on deadlines that is tried.
    pub(super) factors: [f64; 2],
    /// Ratio of two factors below which a nearby search is no longer worthwhile.
    pub(super) fine: f64,
    /// Least ratio of the factor found to the one that failed at which a search is made that does not start nearby.
    pub(super) wide: f64,
    /// Largest number of these searches.
    pub(super) searches: u32,
    /// The part of the time until the end of a plan after which the filter tries again to prolong it, if that failed before.
    pub(super) sooner: f64,

    // Missions.
    /// The largest number of ways to take alternatives that are compared, and of those that are tried.
    pub(super) most_choices: usize,
    pub(super) choices: usize,
    /// The largest number of visits of which every order is compared, and the number of orders that are tried.
    pub(super) all_orders: usize,
    pub(super) orders: usize,
    /// How much more time the way to a place gets that was not reached, and how often.
    pub(super) slower: f64,
    pub(super) repairs: u32,
    /// The slowest and the fastest pace in lengths of the path per s, and halvings between them.
    pub(super) paces: [f64; 2],
    pub(super) halvings: u32,

    // Time.
    /// How late a measured clock may be, as a part of a hold. Two intervals that differ by no more are meant to be the same.
    pub(super) jitter: f64,
    /// Part of a hold added to the next one if the clock was not exact.
    pub(super) headroom: f64,
    /// Longest interval that counts as shorter than usual, as a part of a hold.
    pub(super) quicker: f64,
    /// Number of such intervals in a row, equal to within `jitter`, that become the new usual ones.
    pub(super) alike: u32,
    /// Round-off of a difference of two times, as a part of the time.
    pub(super) time_round_off: f64,
    /// The largest round-off of a time at which samples can be distinguished, as a part of the hold.
    pub(super) distinct: f64,
    /// The shortest hold that plans distinguish from none, as a part of the period. A shorter one is planned as this.
    pub(super) shortest: f64,
    /// The same behind an integrator.
    pub(super) shortest_integrated: f64,

    /// How far in s a plan for an uncertain plant reaches past the last deadline and the sample, if nothing else is asked
    /// for.
    pub(super) uncertain_horizon: f64,
    /// The same where a barrier follows a measured point, which may be nearer the later it is.
    pub(super) following_horizon: f64,
    /// The part of it that is left when another plan is sought.
    pub(super) nearly_over: f64,

    // The plant beside its model.
    /// Shortest time over which a deviation is measured, as a part of a period.
    pub(super) stretch: f64,
    /// Deviation over a hold that every plan has a margin for, as a part of 1 plus a state's size (1 in its unit).
    pub(super) covered: f64,
    /// How far the plant may deviate from the model in the next hold, in units of the deviation seen in earlier ones.
    pub(super) gusts: f64,

    // Sets that move.
    /// Times in s at which h is compared with its first value, at some states.
    pub(super) times: [f64; 4],
    /// The number of these states.
    pub(super) trials: usize,
    /// Largest difference of h that is none, as a part of 1 plus |h| (1 in the unit of h).
    pub(super) unmoved: f64,
}

/// The decisions of every filter.
pub(super) const DECISIONS: DecisionSettings = DecisionSettings {
    // For what the model leaves out between two samples. The other numbers of the check are small compared with it. With
    // more, narrow sets are refused; with less, a plan is sooner lost. There is no measurement for its size.
    margin: 1e-4,
    // Plans are no better resolved: ten times the residual of a trajectory (`CheckTolerances::residual`), and four times the
    // round-off of a state (`CheckTolerances::round_off`).
    resolved: [1e-7, 64.0 * f64::EPSILON],
    // A small set that is far away has no room for more: its margin would be a part of the distance
    // (`small_sets_are_promised_from_far_away`). The search asks for three times as much (`SearchSettings::searched`), which
    // is then a seventh of the depth. With more, such sets are refused; with less, they are kept by less than they have room
    // for.
    room: 0.05,
    // Limits of time. What is not found by then makes the margin smaller, which is less cautious, and no less sound: it is
    // still at most `room` of an h that there is.
    climbs: 60,
    climb_halvings: 30,
    // A plan has to stand behind the answer of the rows at the edge of a set too, so that the input settles there
    // (`at_the_edge_the_input_does_not_chatter`). With 1 the two would meet exactly, and round-off decide; with more, rows
    // stay farther away, and less of the user's margin is in reserve.
    ample: 2.0,
    // Half of the last digit of the limit at most: a value at the limit may differ from it by round-off. With more, the
    // integral may leave its limits visibly; with 0, an integral at its limit is refused for round-off.
    limit_round_off: 0.25 * f64::EPSILON,

    // A search for an earlier deadline may find what one for the deadline does not. Each part prolongs a refusal by as much
    // as the first search: there were three, 0.9, 0.8 and 0.6, which took too long.
    shorter: [0.8],
    // A limit of time. On a plan of more periods arrival is known to a four-thousandth of its length, and then checked.
    most_points: 4000.0,
    // Later than the arrival at a point of the trajectory, since the deadline has to be kept between these points too. Each
    // is checked, so that more of them only cost checks. Nearer to 1, fewer pass; farther, the answer is later than it has
    // to be.
    arrived: [1.001, 1.02],
    // Limits of time: the first ends the halving if every deadline is kept, the second the doubling if none is and the
    // caller sets no limit.
    factors: [1e-3, 1e6],
    // The answer is accurate to a fiftieth, as is said of it (`Planning::earliest_deadline`). With less, more searches.
    fine: 1.02,
    // Another trajectory may arrive sooner than any near the one found. Each of these searches takes as long as a first one,
    // which a tenth is not worth. Three of them halve the logarithm of the ratio three times.
    wide: 1.1,
    searches: 3,
    // After each quarter of the time that is left, so more and more often until the end (docs/theory.md#horizon). Each
    // attempt costs as much as a first search: with less there are more of them, with more a plan that appears late is
    // missed.
    sooner: 0.25,

    // A comparison of a way takes microseconds to milliseconds, with many visits; a trial as long as a first search, up to seconds.
    most_choices: 4096,
    choices: 8,
    // 720 orders of six visits; of more, the nearest one is next.
    all_orders: 6,
    orders: 2,
    // A plant at rest needs longer for the first metres, and a distance does not say so.
    slower: 1.5,
    repairs: 3,
    // From a millionth of a second to a fortnight for the whole path; the times are known to a millionth of that.
    paces: [1e-6, 1e6],
    halvings: 48,

    // A measured clock may jitter by a few percent (docs/guarantees.md). With more, a late sample is not noticed, and the
    // plant has moved on unplanned by that much; with less, jitter ends guarantees (`a_measured_clock_keeps_the_promise`).
    jitter: 0.05,
    // The next hold is planned as slightly longer than any so far, since a sample that comes early continues the plan, and
    // one that comes late does not. With more, plans are made for holds that do not come; with less, more samples are late.
    headroom: 0.02,
    // A single early sample changes nothing, since it continues the plan. Eight in a row are a faster clock
    // (`a_faster_clock_becomes_the_usual_one`). More take longer to be believed; fewer make bursts the usual. There is no
    // measurement for either.
    quicker: 0.9,
    alike: 8,
    // Two times, each rounded by half an epsilon of it, and the sum of one and a hold: 1.5 epsilon. With less, exact clocks
    // are irregular far from 0.
    time_round_off: 2.0 * f64::EPSILON,
    // A fifth of `jitter`. With more, round-off is taken for lateness, or hides it.
    distinct: 1e-2,
    // A plan may continue even if a sample comes sooner, so that steps of any length go on with it
    // (`steps_of_any_length_go_on_with_the_plan`). With less, a hold comes near to the part of a period that counts as none
    // (`CheckTolerances::on_time`); with more, less is known of where a short one leads.
    shortest: 1e-3,
    // Plans account for every hold of an integral, so that short ones multiply the cost: up to eight holds for each usual
    // one.
    shortest_integrated: 0.125,

    // The tube of a vehicle at rest grows slowly, and every sample that lets another input pass begins a new one. With more, a
    // search takes longer; with less, a promise ends sooner if no other input passes any more.
    uncertain_horizon: 3.0,
    // With the reserve of a search, as far as above. A point that may accelerate soon may be anywhere.
    following_horizon: 2.0,
    // The law prolongs a plan long before (`Planner::prolonged`). With more, searches come early; with less, they have fewer
    // samples to find a plan.
    nearly_over: 0.6,

    // Over less it is round-off: a deviation is a difference of states divided by the time.
    stretch: 0.5,
    // The remainder of a plan keeps half (`CheckTolerances::kept`) of the least margin, `resolved`. More has no margin
    // behind it; with less, round-off of a plant of another integrator is taken for a drift.
    covered: 5e-8,
    // The flag falls before a drift leaves a set, if the drift grows by no more than half from a hold to the next
    // (`the_flag_falls_before_a_drift_leaves_a_set`). With 1 it would fall after a drift that grows. Messages and documents
    // name this number.
    gusts: 1.5,

    // Times without a common period, over an hour. Enclosures over all times say more, where there are any; these are for
    // sources without. With fewer states, a set that moves only in places is not seen before a search, whose plans find no
    // end then.
    times: [0.0, 0.7, 31.0, 4e3],
    trials: 4,
    // Round-off of an expression that does not depend on time, with terms that cancel. It refuses a filter, so it is wider
    // than that of an equilibrium (`CheckTolerances::unmoved`), which only refuses a plan.
    unmoved: 1e-9,
};

// Numbers whose size is said to follow from others.
const _: () = {
    let DecisionSettings { resolved: [least, part], covered, shortest, distinct, jitter, .. } = DECISIONS;
    let CheckTolerances { kept, residual, round_off, spreads, on_time, .. } = TOLERANCES;
    assert!(residual < kept * least && round_off < kept * part && covered <= kept * least);
    assert!(round_off * spreads[1] < kept * least && on_time < shortest && distinct < jitter);
};
