//! The numbers that decide what the check of a plan accepts: its tolerances, reserves, round-off and limits of effort.
//!
//! A field says what a number is, and its unit; [`TOLERANCES`] has the values, each with the reason for its size. What a
//! promise rests on beside these are the margins of its requirements: `DecisionSettings` in `core/src/filter/backup`.

/// What the check of a plan accepts. A part of something has no unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CheckTolerances {
    // Margins, in units of those that a new plan keeps.
    /// Margins of the remainder of a plan that was checked before.
    pub(crate) kept: f64,
    /// Margins behind another input if the next sample may come at any time.
    pub(crate) wary: f64,
    /// Margins of a plan that is followed though it is lost.
    pub(crate) nearly: f64,
    /// Margin of a state that begins at the edge of a set, until it has to have left the edge.
    pub(crate) edge: f64,

    // Time.
    /// Difference of a sample from its time that counts as none, as a part of the period. Round-off of a time itself is
    /// separate.
    pub(crate) on_time: f64,

    // The states along a piece.
    /// Change of a state over a hold that is round-off, as a part of its size.
    pub(crate) round_off: f64,
    /// Perturbation of a state or an input for differentiation, as a part of 1 plus its size (1 in its unit).
    pub(crate) difference: f64,
    /// Largest last terms of a state's expansion at the end of a piece, as a part of 1 plus its size (1 in the state's
    /// unit).
    pub(crate) truncated: f64,
    /// Largest residual of a state's expansion over a piece, as a part of 1 plus its change there (1 in the state's unit).
    pub(crate) residual: f64,
    /// Growth from a halved piece to the longest next one. For the piece after that it is squared, and so on.
    pub(crate) longer: f64,
    /// Largest number of pieces of a rollout.
    pub(crate) most_pieces: u32,
    /// The same between samples: a number, or, if that is more, a multiple of the number of the current plan.
    pub(crate) hurried: [u32; 2],

    // h along a piece.
    /// Number of instants of a piece at which the expansion of h is compared with h.
    pub(crate) instants: u32,
    /// Factor on the largest error at these instants, for the times between them.
    pub(crate) missed: f64,
    /// Halvings of a piece whose bound does not decide.
    pub(crate) halvings: u32,
    /// The number of these that may only sharpen the bound.
    pub(crate) sharper: u32,
    /// Least bound of a piece that is sharp enough, as a part of the least value seen.
    pub(crate) sharp: f64,
    /// The part that the turning of h on a piece may have in its fall in a tube, and the number of halvings that lessen it.
    pub(crate) turned: f64,
    pub(crate) turns: u32,

    // The perturbed plant.
    /// How many times a deviation may grow along a new plan, and along the remainder of one.
    pub(crate) spreads: [f64; 2],
    /// Perturbation of the plant to see how a deviation grows, as a part of a state's size. That size is 1 (in its unit),
    /// plus the distance from where the rollout began, plus the part `far` of the state itself.
    pub(crate) perturbation: f64,
    /// The part of a state that counts in its size.
    pub(crate) far: f64,
    /// Largest last term of a step along which the perturbed plant is followed, as a part of the deviation.
    pub(crate) bent: f64,
    /// The shortest such step, as a part of a piece.
    pub(crate) shortest: f64,

    // The equilibrium at the end.
    /// Largest rate of a state that counts as an equilibrium, as a part of its largest along the plan.
    pub(crate) at_equilibrium: f64,
    /// Number of holds over which a drift at an equilibrium must not leave any set.
    pub(crate) drift: f64,
    /// Largest number of holds of the stopping controller after a reference.
    pub(crate) stopping_holds: usize,
    /// Number of holds of the stopping controller over which the remaining motion at an equilibrium is followed.
    pub(crate) settling: usize,
    /// The time in s for which a motion that does not die away must not leave any set. For the remainder of a plan `kept`
    /// times that.
    pub(crate) long: f64,
    /// Change of a number in a window of that motion that is round-off, as a part of the numbers that it is computed from.
    pub(crate) settled: f64,
    /// Largest number of pieces in which a hold of the stopping controller at an equilibrium is followed.
    pub(crate) crept: u32,
    /// The part of a piece in which a kink is passed by a step of the model.
    pub(crate) kink: f64,
    /// Halvings of the extrapolated motion of the states, over which h is enclosed.
    pub(crate) path_halvings: u32,
    /// Number of intervals between the instants of the extrapolated motion at which the plant has to be at an equilibrium,
    /// and h is evaluated if it is not enclosed.
    pub(crate) path_instants: u32,
    /// Perturbation of a state to see whether a deviation from an equilibrium grows, as a part of 1 plus its size (1 in the
    /// state's unit).
    pub(crate) beside: f64,
    /// Largest growth of that deviation, as a part of it, over all the time that is promised.
    pub(crate) grows: f64,
    /// Largest eigenvalue over a hold at which an equilibrium counts as staying without feedback.
    pub(crate) stays: f64,
    /// Largest number of steps of an eigenvalue decomposition.
    pub(crate) rotations: usize,
    /// Later times at which a set that does not move has the same h: as parts of the plan's length, and in s.
    pub(crate) later: [[f64; 4]; 2],
    /// Largest difference of h at such a time that is none, as a part of 1 plus |h| (1 in the unit of h).
    pub(crate) unmoved: f64,
}

/// The tolerances of every check.
pub(crate) const TOLERANCES: CheckTolerances = CheckTolerances {
    // The plant deviates from the model by round-off at least, so a plan whose tightest place is exactly at its margin has
    // to stay a plan at the next sample. Half of the margin is left for that, and half is kept between a plan and h = 0.
    // With 1 round-off ends guarantees; with 0 nothing is left of the margin, and the probes beside the trajectory are off.
    kept: 0.5,
    // What exceeds `kept` is room for the plan to move, since its holds end elsewhere at every such sample. With more, fewer
    // inputs pass at irregular samples; with less, more guarantees end as irregular. There is no measurement for 4 itself.
    wary: 4.0,
    // A margin is 1e-4 of |h| at the first sample, so h may fall short by a hundredth of that. Nearer to 0 the rows take
    // over sooner: with the rows in place of the law after every loss, misses went up to 13.7 m (docs/guarantees.md).
    // Farther from 0 the law drives even where it leads far out of a set. There is no measurement for 100 itself.
    nearly: -100.0,
    // A shortfall by round-off is allowed. At an edge the margin is the change of h if each state moves by 1e-7
    // (`DecisionSettings::resolved`), and a millionth of that is 450 epsilon of a state of size 1. Starts on the edge are
    // promised and kept (`a_start_at_the_edge_is_not_lost_to_round_off`). With more, a state that leaves the edge may be
    // outside for a period, by that much.
    edge: -1e-6,

    // Importers add up their steps, so that a sample is not quite a multiple of the period. Requirements begin this much
    // earlier, so that no gap is left. With more, a requirement asks for something before its time; with less, round-off
    // makes samples irregular. It is below `SearchSettings::on_node`, with which such a requirement is still at a node.
    on_time: 1e-6,

    // The Horner sum of ten coefficients has eighteen operations, each within half an epsilon: nine epsilon. The rest is for
    // the coefficients.
    round_off: 16.0 * f64::EPSILON,
    // Central differences err by the third derivative times 1e-12, and by round-off of about ε/1e-6 = 2e-10. The sum is least
    // near the cube root of ε, 6e-6. The check itself differentiates nothing by it. But the margins of a promise are made of
    // slopes of h, and so is what a deviation of the plant may take off h; the search takes its linear models from it.
    difference: 1e-6,
    // Only the first length of a piece, which `residual` then checks. At two orders less than that, the terms left out alone
    // do not make it halve: the rate of the tenth errs by ten times itself. With more there are more halvings, with less
    // more pieces.
    truncated: 1e-10,
    // A tenth of the least margin, which is the change of h if each state moves by 1e-7 (`DecisionSettings::resolved`). With
    // more, a plan may lead where the plant does not go, as past a wind on a short stretch
    // (`a_large_residual_lets_a_plan_through_that_the_plant_breaks`). With less, pieces get shorter.
    residual: 1e-8,
    // Cost, and one more decision. After a halved piece the next is tried at that length, since what curved it is still
    // there. The factors 1.2, 1.44, 2.07, ... soon lift that limit. Until it overflows, after a dozen pieces, the plant also
    // needs an expansion beside its state.
    longer: 1.2,
    // A limit of time alone. With more, a refusal may take longer; with less, long plans of short periods are refused as too
    // long. There is no measurement for its size.
    most_pieces: 100_000,
    // A rollout behind another input that takes many more pieces than the plan at hand makes a step long, and the plan at
    // hand is as good. With more, some inputs pass that do not now, in longer steps. There is no measurement for its size.
    hurried: [1000, 4],

    // Where h has enclosures, those decide, and the instants say where to halve. Without enclosures they are an assumption:
    // h is curved as four instants show, and errs by at most four times as much between them. There is no measurement for
    // either; more of either costs evaluations or halvings, and less trusts such a source more.
    instants: 4,
    missed: 4.0,
    // A piece that is still open after 14 halvings, at 6e-5 of its length, counts as broken. So fewer refuse more, and more
    // cost time where h nearly touches its margin. With 14 there are plans past small discs and thin walls on a long way
    // (`small_things_on_a_long_way_are_seen`, `a_thin_wall_is_seen_wherever_it_stands`).
    halvings: 14,
    // These two decide how sharp the reported tightest place is, and with it what is comfortable, but not what is accepted.
    // If three halvings do not bring the bound within a fifth of the values seen, it stays as it is.
    sharper: 3,
    sharp: 0.8,
    // A bound on the fall is sound on any part, so that fewer halvings only refuse more. Three divide the turning by eight.
    turned: 0.1,
    turns: 3,

    // A deviation begins with `residual`, far more than round-off. Plans of the vehicles, the arm and the cart-pole stay at
    // or below 100 (docs/theory.md#backup-plan), and the limit for new plans leaves two orders above that. What was accepted
    // must not be lost to a growth that is computed anew at every sample, hence two orders more. There round-off,
    // `round_off` of 1, grows to 4e-9, still below what `kept` leaves of the least margin, 5e-8. With more, a plan may be
    // followed that round-off loses (`what_round_off_would_lose_is_not_followed`).
    spreads: [1e4, 1e6],
    // Far above round-off, so that the difference of two rates is not round-off of the rates, and small enough that the two
    // plants feel the same slopes. It is also how near to a place without an expansion, such as an empty tank, a plan may
    // lead.
    perturbation: 1e-6,
    // Far from the origin a deviation still exceeds round-off: a millionth of a millionth is 4500 epsilon. And a position
    // does not depend on the choice of the origin: at 1000 km its size is that near the origin, plus 1
    // (`a_place_far_from_the_origin_is_no_other_place`).
    far: 1e-6,
    // (λτ)⁴/4 of a mode that grows, or dies away, with λ: so no step is longer than 1/λ. A fourth-order step becomes
    // unstable at λτ = 2.8, and then a deviation that dies away within a hold seems to grow
    // (`a_lag_far_shorter_than_a_hold_is_promised`).
    bent: 0.25,
    // A limit of time: a thousand steps for each piece. With more, lags that are far shorter than a piece seem to grow, and
    // their plans are refused.
    shortest: 1e-3,

    // A motion that dies away as e^(−t/τ) needs 14 τ for it. It is no promise by itself: the drift and the remaining motion
    // have to stay in all sets too. With more, plans end sooner and these two have more to bear; with less, plans are
    // longer.
    at_equilibrium: 1e-6,
    // With `at_equilibrium` the drift leads as far as a thousandth of a hold at the largest rate of the plan. What comes
    // later is seen by the extrapolated motion. There is no measurement for its size.
    drift: 1e3,
    // A limit of time: a refusal takes all of them. With less, plants that stop slowly are refused.
    stopping_holds: 200,
    // Four windows of up to 32 holds. Modes that look like one within them are told apart in longer windows only, and end
    // the guarantee when they show (docs/theory.md#backup-plan). More of them cost as many more holds at the end of every
    // rollout that does not settle sooner.
    settling: 128,
    // More than a day, 86 400 s: what "from then on" claims (docs/guarantees.md). A creep of h is multiplied by it. With
    // more, round-off in the creep refuses equilibria that stay.
    long: 1e5,
    // Changes are compared by second differences, v₁ − 2v₂ + v₃, which add up four times the `round_off` of a value.
    settled: 64.0 * f64::EPSILON,
    // A limit of time for motions that die away far faster than a hold. The rest of the hold is one prediction of the model.
    crept: 1000,
    // A piece is halved at most four times before a kink is passed by the model's own step, which needs no expansion. With
    // less, the step across the kink is shorter and costs more pieces.
    kink: 1.0 / 16.0,
    // Both divide the motion of the next `long` seconds. An enclosure is sound on any part, so that fewer halvings only
    // refuse more. Between the instants a force that acts on a short stretch is not seen, which ends the guarantee when it
    // shows (docs/theory.md#backup-plan): fewer see less. There is no measurement for either.
    path_halvings: 6,
    path_instants: 32,
    // Round-off of a hold (`settled`) over this perturbation blurs the growth by 1.4e-9, so that `grows` stays visible over
    // 7e7 holds. With less, round-off looks like growth. An unstable point nearer to a kink than this is not seen
    // (docs/theory.md#backup-plan).
    beside: 1e-5,
    // What is lost by growth is then no more than a tenth of a deviation. With less, round-off of an eigenvalue 1 counts as
    // growth; with more, a slow unstable point counts as an equilibrium (`an_unstable_equilibrium_does_not_count`).
    grows: 0.1,
    // 1, and round-off: a double eigenvalue, as of position and speed, splits by the root of the error of the matrix, and
    // √(ε / `CheckTolerances::difference`) is 1.5e-5. With more, an unstable plant without a measurement counts as assured
    // past the end of its plan; with less, a vehicle counts as unstable, and is held by feedback.
    stays: 1.0 + 1e-4,
    // A decomposition takes a few for each state. Where none is found the growth counts as infinite, so that the plan is
    // refused.
    rotations: 1000,
    // Ratios and times without a simple common period, so that a set that turns is not seen in the same place every time.
    // The last is a day. Enclosures over all times say more, where there are any; these are for sources without.
    later: [[0.1234, 0.618, 1.7, 3.3], [3.7, 61.7, 1013.0, 86413.0]],
    // 4500 epsilon: round-off of an expression that does not depend on time, by terms that cancel. With more, a set that
    // moves by less is taken for still; with less, one that is still is refused.
    unmoved: 1e-12,
};

#[cfg(test)]
mod tests {
    use alloc::sync::Arc;

    use super::{CheckTolerances, TOLERANCES};
    use crate::barriers::StateBound;
    use crate::dynamics::ControlAffine;
    use crate::lie;
    use crate::plan::check::{Grid, Walk};
    use crate::plan::model::Model;
    use crate::plan::settings::SETTINGS;
    use crate::plan::{Failure, Requirement};
    use crate::qp::Bounds;
    use crate::scalar::Scalar;

    /// A boat (m, m) that its input (m/s) moves along the first axis. A stream 0.2 m wide at 3 m moves it along the second.
    #[derive(Clone, Copy, Debug)]
    struct Stream;

    impl ControlAffine<2, 1> for Stream {
        fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
            let within = -((x[0] - 3.0) / 0.1).squared() + 1.0;
            [S::zero(), within.max(S::zero())]
        }

        fn input_map<S: Scalar>(&self, _x: &[S; 2]) -> [[S; 1]; 2] {
            [[S::one()], [S::zero()]]
        }
    }

    /// With a residual that hides the stream, the check follows the boat to a place where it does not go. Small steps of the
    /// plant, which know neither expansions nor tolerances, lead out of the set.
    #[test]
    fn a_large_residual_lets_a_plan_through_that_the_plant_breaks() {
        const CROSSING: f64 = 10.0;
        let beside = StateBound::at_most(1, 0.1).expect("valid bound");
        let source = lie::along(Arc::new(Stream), beside, 2).expect("valid source");
        let plant = source.predict().expect("a plant");
        let until = f64::INFINITY;
        let kept = Requirement {
            barrier: 0,
            is_limit: false,
            model: plant,
            from: 0.0,
            until,
            margin: 1e-6,
            firm: 0.0,
            reserve: 0.0,
        };
        let (bounds, requirements) = (Bounds::NONE, [kept]);
        let model = Model {
            plant,
            dims: [2, 1],
            bounds: &bounds,
            integral: None,
            settings: &SETTINGS,
            step: CROSSING,
        };
        let checked = |tolerances: &CheckTolerances| {
            let grid = Grid { period: CROSSING, even: true };
            let mut walk = Walk::new(model, tolerances, &requirements, 1.0, grid, (0.0, &[0.0; 2]))?;
            walk.hold_until(&[1.0], CROSSING)
        };
        let refused = checked(&TOLERANCES);
        assert!(matches!(refused, Err(Failure::Broken { .. })), "{refused:?}");
        assert_eq!(checked(&CheckTolerances { residual: 1e3, ..TOLERANCES }), Ok(()));

        let (mut x, mut rate, dt) = ([0.0; 2], [0.0; 2], 1e-4);
        for _ in 0..100_000 {
            plant.rate(&x, &[1.0], &mut rate);
            x = [x[0] + dt * rate[0], x[1] + dt * rate[1]];
        }
        // The integral of 1 − (s/0.1)² over the stream is 4/30.
        assert!((x[1] - 4.0 / 30.0).abs() < 1e-3 && plant.value(CROSSING, &x) < 0.0, "{x:?}");
    }
}
