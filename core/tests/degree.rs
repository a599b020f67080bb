//! The relative degree that is found, and the ones that the builder refuses.

use crate::support;

use std::sync::Arc;

use punctual_core::barrier::Barrier;
use punctual_core::barriers::{DistanceDisc, Outside};
use punctual_core::dynamics::{ControlAffine, DynPlant, IntegratedInput, rk4_step};
use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder};
use punctual_core::lie::{self, Derivatives, RelativeDegree, detected, relative_degree};
use punctual_core::plants::{KinematicBicycle, PointMass, SmallSlipBicycle, Steering, Unicycle};
use punctual_core::scalar::Scalar;
use punctual_core::{Error, ErrorKind};
use punctual_reference::simulation::{Schedule, closed_loop};
use support::{
    Cart, Chain4, Chain8, Exponential, Logarithmic, MovingDisc, Powers, SecondState, SpeedLimit, Uncoupled,
    bicycle, distance_disc, quadratic_disc,
};

fn small_slip() -> SmallSlipBicycle {
    SmallSlipBicycle::new(10.0).expect("valid bicycle")
}

fn kinematic() -> KinematicBicycle {
    KinematicBicycle::new(1.2, 1.6).expect("valid bicycle")
}

fn filter_of<P, B, const NX: usize, const NU: usize>(plant: P, barrier: B) -> Result<Filter, Error>
where
    P: ControlAffine<NX, NU> + Send + Sync + 'static,
    B: Barrier<NX> + Send + 'static,
{
    let settings = BarrierSettings::within(5.0).margin(0.02);
    Filter::builder(plant).barrier("goal", barrier, settings).and_then(FilterBuilder::build)
}

#[test]
fn position_barriers_of_the_plants_have_degree_two() {
    let obstacle = || Outside(distance_disc());
    for (name, found) in [
        ("point mass, quadratic", detected(&PointMass, &quadratic_disc())),
        ("point mass, distance", detected(&PointMass, &distance_disc())),
        ("point mass, obstacle", detected(&PointMass, &obstacle())),
        ("unicycle, quadratic", detected(&Unicycle, &quadratic_disc())),
        ("unicycle, distance", detected(&Unicycle, &distance_disc())),
        ("unicycle, moving", detected(&Unicycle, &MovingDisc)),
        ("bicycle, quadratic", detected(&bicycle(), &quadratic_disc())),
        ("bicycle, distance", detected(&bicycle(), &distance_disc())),
        ("kinematic, quadratic", detected(&kinematic(), &quadratic_disc())),
        ("kinematic, distance", detected(&kinematic(), &distance_disc())),
        ("small slip with rate", detected(&small_slip().with_rate(), &distance_disc())),
        ("small slip with rate, obstacle", detected(&small_slip().with_rate(), &obstacle())),
    ] {
        assert_eq!(found, RelativeDegree::Uniform(2), "{name}");
    }
}

#[test]
fn other_systems_have_theirs() {
    assert_eq!(detected(&Unicycle, &SpeedLimit), RelativeDegree::Uniform(1), "steering never enters");
    assert_eq!(detected(&small_slip(), &SpeedLimit), RelativeDegree::Uniform(1), "nor does slip");
    assert_eq!(detected(&Cart, &Powers), RelativeDegree::Uniform(2));
    let x = [0.25, 0.5, -1.0, 1.5];
    assert_eq!(relative_degree(&Chain4, &Logarithmic, 0.0, &[x]), RelativeDegree::Uniform(4));
    let x = [0.5, -0.25, 0.75, 1.0, -0.5, 0.125, -1.25, 2.0];
    assert_eq!(relative_degree(&Chain8, &Exponential, 0.0, &[x]), RelativeDegree::Uniform(8));
}

#[test]
fn it_does_not_exist_where_no_input_reaches() {
    assert_eq!(detected(&Uncoupled, &SecondState), RelativeDegree::Unreached);
    // More derivatives than are taken.
    assert_eq!(
        detected::<_, _, 9, 1>(&IntegratedInput::<_, 8>::new(Chain8, 0), &FirstOfNine),
        RelativeDegree::Unreached
    );
    let not_finite = [f64::NAN, 0.0];
    assert_eq!(relative_degree(&Cart, &Powers, 0.0, &[not_finite]), RelativeDegree::NotFinite);
    assert_eq!(relative_degree(&Cart, &Powers, 0.0, &[]), RelativeDegree::NotFinite);
}

/// h = x₁ of nine states.
struct FirstOfNine;

impl Barrier<9> for FirstOfNine {
    fn value<S: Scalar>(&self, _t: S, x: &[S; 9]) -> S {
        x[0]
    }
}

/// At one sample the row can vanish by accident; its neighbours decide.
#[test]
fn a_singular_sample_does_not_mislead() {
    let centre = [45.0, 45.0, 0.0, 0.0];
    assert_eq!(relative_degree(&PointMass, &quadratic_disc(), 0.0, &[centre]), RelativeDegree::Uniform(2));
    let standing_across = [0.0, 0.0, 2.0, 0.0];
    assert_eq!(
        relative_degree(&Unicycle, &quadratic_disc(), 0.0, &[standing_across]),
        RelativeDegree::Uniform(2)
    );
}

#[test]
fn the_small_slip_bicycle_is_mixed_and_refused() {
    let mixed = RelativeDegree::Mixed(vec![Some(2), Some(1)]);
    assert_eq!(detected(&small_slip(), &quadratic_disc()), mixed);
    let error = filter_of(small_slip(), distance_disc()).err().expect("refused");
    assert_eq!(error.kind(), ErrorKind::RelativeDegree);
    assert_eq!(error.relative_degree(), Some(&mixed));
    assert_eq!(
        error.to_string(),
        "goal.relative_degree: is mixed: u[2] enters derivative 1, u[1] enters derivative 2 of h; one constraint \
         cannot use both, so put an integrator before the input that enters first (dynamics::IntegratedInput)"
    );
}

/// A force that acts on the right of x = 0 directly, on the left through a valve.
struct Valve;

impl ControlAffine<2, 1> for Valve {
    fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
        [if x[0].value() > 0.0 { S::zero() } else { x[1] }, S::zero()]
    }
    fn input_map<S: Scalar>(&self, x: &[S; 2]) -> [[S; 1]; 2] {
        let direct = if x[0].value() > 0.0 { S::one() } else { S::zero() };
        [[direct], [S::one()]]
    }
}

/// h = x₁.
struct First;

impl<const NX: usize> Barrier<NX> for First {
    fn value<S: Scalar>(&self, _t: S, x: &[S; NX]) -> S {
        x[0]
    }
}

#[test]
fn a_degree_that_differs_between_regions_is_refused() {
    assert_eq!(detected(&Valve, &First), RelativeDegree::Varying(vec![1, 2]));
    let error = filter_of(Valve, First).err().expect("refused");
    assert_eq!(
        error.to_string(),
        "goal.relative_degree: differs between sample states: the first derivative of h with an input is of \
         order 1 or 2"
    );
}

#[test]
fn what_no_input_reaches_is_refused() {
    let error = filter_of(Uncoupled, SecondState).err().expect("refused");
    assert_eq!(
        error.to_string(),
        "goal.relative_degree: does not exist: no input enters a derivative of h up to order 8"
    );
}

#[test]
fn a_declared_degree_is_compared() {
    let declared = |n: usize, samples: &[[f64; 4]]| {
        Filter::builder(Unicycle)
            .barrier_of_degree("goal", distance_disc(), (n, samples), BarrierSettings::within(5.0))
            .and_then(FilterBuilder::build)
            .map(|f| f.relative_degrees().collect::<Vec<_>>())
    };
    let x = [[1.0, 2.0, 3.0, 4.0]];
    assert_eq!(declared(2, &x), Ok(vec![2]));
    for n in [0, 1, 3] {
        assert_eq!(
            declared(n, &x).expect_err("refused").to_string(),
            format!("goal.relative_degree: is 2, declared is {n}")
        );
    }
    assert_eq!(
        declared(2, &[]).expect_err("refused").to_string(),
        "goal.relative_degree: is not known: model or barrier is not finite at any sample state, declared is 2; \
         provide your own samples"
    );
}

#[test]
fn the_degree_found_is_the_one_used() {
    let degrees = |f: &Filter| f.relative_degrees().collect::<Vec<_>>();
    assert_eq!(degrees(&filter_of(Unicycle, SpeedLimit).expect("valid")), [1]);
    assert_eq!(degrees(&filter_of(Cart, Powers).expect("valid")), [2]);
}

/// The way out for the small slip angle, and the exact kinematics: both reach the disc by the deadline
/// and stay, steered by rates.
#[test]
fn bicycles_steered_by_rates_arrive_and_stay() {
    let slip = arrives(small_slip().with_rate(), 5.0);
    let kinematic = arrives(kinematic(), 5.0);
    assert!(slip && kinematic);
}

fn arrives<P>(plant: P, deadline: f64) -> bool
where
    P: ControlAffine<5, 2> + Send + Sync + Copy + 'static,
{
    let disc = DistanceDisc::new([20.0, 10.0], 2.0, 2.0).expect("valid disc");
    let mut filter = filter_of(plant, disc).expect("uniform");
    let schedule = Schedule { step: 1e-3, steps: 10_000, substeps: 1 };
    let x0 = [0.0, 0.0, 0.4, 3.0, 0.0];
    let mut kept = true;
    // Damping of the speed; the wheel is turned back.
    let nominal = |_: f64, x: &[f64; 5]| [-x[3], -2.0 * x[4]];
    closed_loop(&mut filter, &plant, x0, schedule, nominal, |t, _, _, report| {
        kept &= report.status.is_satisfied() && (t < deadline || report.barriers[0].h >= 0.0);
    })
    .expect("valid schedule");
    kept
}

/// A held slip angle is the state that its integrator holds: both models move alike.
#[test]
fn an_integrated_input_is_the_input() {
    let mut held = [1.0, -2.0, 0.5, 4.0];
    let mut state = [1.0, -2.0, 0.5, 4.0, 0.125];
    for _ in 0..100 {
        held = rk4_step(&small_slip(), &held, &[0.75, 0.125], 0.01);
        state = rk4_step(&small_slip().with_rate(), &state, &[0.75, 0.0], 0.01);
    }
    assert_eq!(state[..4], held);
    assert_eq!(state[4], 0.125);
}

/// For small angles the kinematic bicycle is the small-slip one: they differ in the second order.
#[test]
fn the_kinematic_bicycle_is_the_small_slip_one_for_small_angles() {
    const DELTA: f64 = 1e-3;
    let beta = DELTA * 1.6 / 2.8;
    let x = [3.0, 1.0, 0.7, 5.0];
    let exact = kinematic().drift(&[x[0], x[1], x[2], x[3], DELTA]);
    let small = SmallSlipBicycle::new(1.6).expect("valid").derivative(&x, &[0.0, beta]);
    for i in 0..4 {
        assert!((exact[i] - small[i]).abs() <= x[3] * beta * beta, "{i}: {} {}", exact[i], small[i]);
    }
}

/// Steered by the angle itself, in either form, the kinematic bicycle is the one whose angle is a state that rests.
#[test]
fn a_steered_bicycle_is_one_with_an_angle_at_rest() {
    const DELTA: f64 = 0.4;
    let mut state = [1.0, -2.0, 0.5, 4.0, DELTA];
    let [mut by_angle, mut by_slip] = [[1.0, -2.0, 0.5, 4.0]; 2];
    let beta = (1.6 / 2.8 * DELTA.tan()).atan();
    assert!((kinematic().steering_angle(beta) - DELTA).abs() < 1e-15);
    for _ in 0..100 {
        state = rk4_step(&kinematic(), &state, &[0.75, 0.0], 0.01);
        kinematic().steered(Steering::Angle).rk4_step(&mut by_angle, &[0.75, DELTA], 0.01).unwrap();
        kinematic().steered(Steering::SlipAngle).rk4_step(&mut by_slip, &[0.75, beta], 0.01).unwrap();
    }
    assert_eq!(state[..4], by_angle);
    // β is rounded once more.
    assert!(by_angle.iter().zip(by_slip).all(|(a, b)| (a - b).abs() < 1e-13), "{by_angle:?} {by_slip:?}");
    let refused = kinematic().steered(Steering::Angle).rk4_step(&mut by_angle, &[0.0; 3], 0.1);
    assert_eq!(refused.unwrap_err().to_string(), "u: has 3 components, must have 2");
}

/// Seen from a point that moves with the disc the disc stands still. Exact in exact arithmetic; the
/// subtraction of the motion rounds once more.
#[test]
fn a_moving_disc_is_a_disc_at_rest_for_who_moves_along() {
    let (centre, velocity, t) = ([40.5, -3.25], [3.0, -0.75], 2.5);
    let x = [44.0, 1.5, -2.0, 6.25];
    let relative = [x[0] - velocity[0] * t, x[1] - velocity[1] * t, x[2] - velocity[0], x[3] - velocity[1]];
    let disc = || DistanceDisc::new(centre, 2.5, 0.75).expect("valid disc");
    let of = |disc: DistanceDisc, t: f64, x: [f64; 4]| {
        let mut found = Derivatives::ZERO;
        lie::along(Arc::new(PointMass), disc, 2).expect("in range").evaluate(t, &x, &mut found);
        found
    };
    let moving = of(disc().moving(velocity).expect("finite"), t, x);
    let at_rest = of(disc(), 0.0, relative);
    for k in 0..3 {
        let (a, b) = (moving.drift[k], at_rest.drift[k]);
        assert!((a - b).abs() <= 1e-14 * (1.0 + b.abs()), "order {k}: {a} {b}");
    }
    assert_eq!(moving.row, at_rest.row);
    assert_eq!(of(disc().moving([0.0; 2]).expect("finite"), t, x), of(disc(), 0.0, x), "no velocity");
}

#[test]
fn velocities_must_be_finite() {
    let error = distance_disc().moving([0.0, f64::NAN]).expect_err("refused");
    assert_eq!(error.to_string(), "velocity[2]: is NaN, must be finite");
    assert!(quadratic_disc().moving([f64::INFINITY, 0.0]).is_err());
}

/// A point mass catches a disc that drives away at 3 m/s by the deadline and then rides along, past an
/// obstacle that comes towards it.
#[test]
fn a_point_mass_stays_in_a_moving_disc() {
    let velocity = [3.0, 1.0];
    let goal = DistanceDisc::new([20.0, 5.0], 2.0, 2.0).and_then(|d| d.moving(velocity)).expect("valid");
    let mut filter = filter_of(PointMass, goal).expect("valid");
    let schedule = Schedule { step: 1e-3, steps: 10_000, substeps: 1 };
    let mut outside = 0.0_f64;
    let nominal = |_: f64, x: &[f64; 4]| [velocity[0] - x[2], velocity[1] - x[3]];
    closed_loop(&mut filter, &PointMass, [0.0, 0.0, -2.0, 1.0], schedule, nominal, |t, x, _, report| {
        assert!(report.status.is_satisfied() && report.barriers[0].on_course, "at {t}");
        if t >= 5.0 {
            let distance = (x[0] - 20.0 - 3.0 * t).hypot(x[1] - 5.0 - t);
            outside = outside.max(distance - 2.0);
        }
    })
    .expect("valid schedule");
    assert_eq!(outside, 0.0, "from the deadline on");
}

/// The point mass wants to cross the obstacle's path and is kept clear of it.
#[test]
fn an_obstacle_on_the_move_is_avoided() {
    let obstacle = DistanceDisc::new([10.0, 0.5], 2.0, 0.5).and_then(|d| d.moving([-1.0, 0.0]));
    let mut filter = filter_of(PointMass, Outside(obstacle.expect("valid"))).expect("valid");
    let schedule = Schedule { step: 1e-3, steps: 10_000, substeps: 1 };
    let mut closest = f64::INFINITY;
    let nominal = |_: f64, x: &[f64; 4]| [2.0 - x[2], -x[1] - x[3]];
    closed_loop(&mut filter, &PointMass, [0.0, 0.0, 2.0, 0.0], schedule, nominal, |t, x, _, report| {
        assert!(report.status.is_satisfied(), "{:?} at {t}", report.status);
        closest = closest.min((x[0] - 10.0 + t).hypot(x[1] - 0.5) - 2.0);
    })
    .expect("valid schedule");
    assert!((0.0..0.5).contains(&closest), "it passes at {closest} m");
}
