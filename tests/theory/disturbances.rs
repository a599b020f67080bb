//! Worst-case disturbances, with and without a bound on them in the settings.

use punctual_core::barrier::Barrier;
use punctual_core::barriers::StateBound;
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::{BarrierSettings, Filter};
use punctual_core::plants::PointMass;
use punctual_core::scalar::Scalar;
use punctual_reference::simulation::{Schedule, closed_loop};

use super::distance;
use super::starts::{DEADLINE, drawn};

const STEP: f64 = 0.01;
const MARGIN: f64 = 0.02;

/// A point mass that is pushed with this many m/s² directly away from the centre of [`distance`].
#[derive(Clone, Copy)]
struct PushedAway(f64);

impl ControlAffine<4, 2> for PushedAway {
    fn drift<S: Scalar>(&self, x: &[S; 4]) -> [S; 4] {
        let (x_c, y_c) = (x[0] - 45.0, x[1] - 45.0);
        let distance = (x_c * x_c + y_c * y_c).sqrt();
        [x[2], x[3], x_c / distance * self.0, y_c / distance * self.0]
    }

    fn input_map<S: Scalar>(&self, x: &[S; 4]) -> [[S; 2]; 4] {
        PointMass.input_map(x)
    }
}

/// A car steered by its jerk, which loses this many m/s³.
#[derive(Clone, Copy)]
pub(super) struct JerkCar(pub(super) f64);

impl ControlAffine<3, 1> for JerkCar {
    fn drift<S: Scalar>(&self, x: &[S; 3]) -> [S; 3] {
        [x[1], x[2], S::from(-self.0)]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 3]) -> [[S; 1]; 3] {
        [[S::zero()], [S::zero()], [S::one()]]
    }
}

/// Numbers of runs that were late, and of runs outside at some sample from the deadline until 2T.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Failures {
    pub(super) late: usize,
    pub(super) outside: usize,
    /// Steps that did not meet their constraint.
    pub(super) unmet: usize,
}

fn failures<M, P, B, const NX: usize, const NU: usize>(
    [model, plant]: [M; 2],
    barrier: B,
    settings: BarrierSettings,
    starts: impl Iterator<Item = [f64; NX]>,
    nominal: P,
) -> Failures
where
    M: ControlAffine<NX, NU> + Copy + Send + Sync + 'static,
    B: Barrier<NX> + Copy + Send + 'static,
    P: Fn(&[f64; NX]) -> [f64; NU],
{
    let mut failures = Failures::default();
    for start in starts {
        let mut filter = Filter::builder(model)
            .barrier("goal", barrier, settings)
            .and_then(|b| b.build())
            .expect("a valid filter");
        let deadline = settings.deadline.expect("a deadline");
        let steps = (2.0 * deadline / STEP).round() as usize;
        let (mut arrival, mut outside) = (None, false);
        let schedule = Schedule { step: STEP, steps, substeps: 2 };
        closed_loop(
            &mut filter,
            &plant,
            start,
            schedule,
            |_, x| nominal(x),
            |t, _, _, report| {
                let b = &report.barriers[0];
                arrival = b.arrival_time;
                // Half a step early, so that round-off in t cannot skip the sample at the deadline.
                outside |= t > deadline - STEP / 2.0 && b.h < 0.0;
                failures.unmet += usize::from(!report.status.is_satisfied());
            },
        )
        .expect("a valid schedule");
        failures.late += usize::from(arrival.is_none_or(|t| t > deadline));
        failures.outside += usize::from(outside);
    }
    failures
}

/// Failures from `count` starts with and without the disturbance in the settings: for a point mass pushed
/// with 2 m/s² (|∇h| ≤ 1, so that is the bound on ḧ), and for a car that loses 10 m/s³ and whose u_ref leads
/// back.
fn table(count: usize) -> [[Failures; 2]; 2] {
    let settings = |disturbance: f64| {
        BarrierSettings::within(DEADLINE).rate(5.0).stay_rate(5.0).margin(MARGIN).disturbance(disturbance)
    };
    let line = StateBound::at_least(0, 45.0).expect("a valid barrier");
    let starts = drawn(count);
    [true, false].map(|robust| {
        let settings = |bound: f64| settings(if robust { bound } else { 0.0 });
        let places = starts.iter().copied();
        let damping = |x: &[f64; 4]| [-x[2], -x[3]];
        let pushed = failures([PushedAway(0.0), PushedAway(2.0)], distance(), settings(2.0), places, damping);
        let places = starts.iter().map(|x0| [x0[0], x0[2], x0[3] / 5.0]);
        let car = failures([JerkCar(0.0), JerkCar(10.0)], line, settings(10.0), places, |_| [-20.0]);
        [pushed, car]
    })
}

/// The row of the documentation: with the bound in the settings everything is kept, whatever pushes. Without
/// it, the margin of 0.02 m is lost to 2/5² = 10/5³ = 0.08 m (lemma 3).
#[test]
#[allow(clippy::print_stdout, reason = "the figures of the documentation")]
fn table_of_disturbances_at_their_worst() {
    let count = if std::env::var_os("PUNCTUAL_TABLES").is_some() { 1000 } else { 20 };
    let [robust, plain] = table(count);
    println!("of {count}, point mass and jerk car: with the bound {robust:?}, without {plain:?}");
    assert_eq!(robust, [Failures::default(); 2], "with the bound, of {count}");
    for lost in plain {
        assert_eq!(lost.unmet, 0, "{lost:?}: a constraint was not met, so it is not the disturbance");
        assert!(lost.outside > count / 2, "{lost:?} of {count}: the disturbance does nothing");
    }
}
