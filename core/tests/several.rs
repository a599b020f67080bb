//! Several barriers: one after the other, side by side, and in each other's way.

use punctual_core::barriers::{DistanceDisc, HalfPlane, NormBound, Outside, StateBound};
use punctual_core::dynamics::rk4_step;
use punctual_core::filter::{BarrierSettings, Begin, End, Filter, FilterBuilder, Phase, Status};
use punctual_core::plants::PointMass;

fn disc(x: f64, y: f64) -> DistanceDisc {
    DistanceDisc::new([x, y], 2.0, 2.0).expect("valid disc")
}

/// Runs with damping at 100 Hz until `end`; `check` sees time, state and the filter after each step.
fn run(filter: &mut Filter, x0: [f64; 4], end: f64, mut check: impl FnMut(f64, &[f64; 4], &Filter)) {
    let (mut x, mut u, step) = (x0, [0.0; 2], 0.01);
    for k in 0..=(end / step).round() as u32 {
        let t = f64::from(k) * step;
        let u_ref = [-x[2], -x[3]];
        filter.step(t, &x, &u_ref, &mut u).expect("right dimensions");
        check(t, &x, filter);
        x = rk4_step(&PointMass, &x, &u, step);
    }
}

/// In A by 5 s, then in B by 10 s; A is let go on arrival, or by the clock.
#[test]
fn one_after_the_other() {
    let by_arrival = [(Begin::AtOnce, End::OnArrival), (Begin::AfterArrival(0), End::Never)];
    let by_clock = [(Begin::AtOnce, End::At(5.0)), (Begin::At(5.0), End::Never)];
    for windows in [by_arrival, by_clock] {
        let mut filter = Filter::builder(PointMass)
            .barrier("A", disc(20.0, 0.0), BarrierSettings::within(5.0))
            .and_then(|b| b.window(windows[0].0, windows[0].1))
            .and_then(|b| b.barrier("B", disc(-10.0, 15.0), BarrierSettings::within(10.0)))
            .and_then(|b| b.window(windows[1].0, windows[1].1))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut in_a = f64::INFINITY;
        run(&mut filter, [0.0, 3.0, 1.0, 0.0], 15.0, |t, x, filter| {
            let report = filter.report();
            let [a, b] = [report.barriers[0], report.barriers[1]];
            assert!(report.status.is_satisfied(), "{:?} at {t}", report.status);
            if disc_holds(x, 20.0, 0.0) {
                in_a = in_a.min(t);
            }
            let let_go = a.phase == Phase::Released;
            let by_then = if windows[0].1 == End::OnArrival { in_a } else { 5.0 };
            assert_eq!(let_go, t >= by_then - 1e-9, "{windows:?}: A at {t}");
            assert_eq!(b.phase != Phase::Waiting, let_go, "B begins where A ends, at {t}");
            assert!(!let_go || a.slack == 0.0 && a.unmet_steps == 0);
            assert!(b.phase != Phase::Approach || (b.time_left - (10.0 - t)).abs() < 1e-9, "at {t}");
            assert!(t < 10.0 || disc_holds(x, -10.0, 15.0), "outside B at {t}");
        });
        assert!(in_a <= 5.0, "in A at {in_a}");
    }
}

fn disc_holds(x: &[f64; 4], cx: f64, cy: f64) -> bool {
    (x[0] - cx).hypot(x[1] - cy) <= 2.0
}

/// A goal reached by its deadline through a corridor, past two obstacles, below a speed limit and a bound
/// on one velocity: relative degrees 1 and 2 together.
#[test]
fn a_corridor_obstacles_and_a_speed_limit() {
    let keep = BarrierSettings::within(5.0).margin(0.01);
    let rock = |x, y, r| Outside(DistanceDisc::new([x, y], r, r).expect("valid disc"));
    let wall = |ny, y| HalfPlane::new([0.0, ny], [0.0, y]).expect("valid wall");
    let mut filter = Filter::builder(PointMass)
        .barrier("goal", disc(30.0, 0.5), BarrierSettings::within(8.0))
        .and_then(|b| b.barrier("floor", wall(1.0, -2.0), keep))
        .and_then(|b| b.barrier("ceiling", wall(-1.0, 3.0), keep))
        .and_then(|b| b.barrier("rock", rock(10.0, -1.2, 1.0), keep))
        .and_then(|b| b.barrier("stone", rock(20.0, 2.2, 1.0), keep))
        .and_then(|b| b.barrier("speed", NormBound::new(2, 9.0).expect("valid"), keep))
        .and_then(|b| b.barrier("forward", StateBound::at_least(2, -0.5).expect("valid"), keep))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let degrees: Vec<usize> = filter.relative_degrees().collect();
    assert_eq!(degrees, [2, 2, 2, 2, 2, 1, 1]);
    run(&mut filter, [0.0, 0.0, 0.0, 0.0], 16.0, |t, x, filter| {
        let report = filter.report();
        assert!(report.status.is_satisfied(), "{:?} at {t}", report.status);
        assert!((-2.0..=3.0).contains(&x[1]), "y = {} at {t}", x[1]);
        assert!((x[0] - 10.0).hypot(x[1] + 1.2) >= 1.0 && (x[0] - 20.0).hypot(x[1] - 2.2) >= 1.0, "at {t}");
        assert!(x[2].hypot(x[3]) <= 9.0 && x[2] >= -0.5, "velocity {} {} at {t}", x[2], x[3]);
        assert!(t < 8.0 || (x[0] - 30.0).hypot(x[1] - 0.5) <= 2.0, "outside the goal at {t}");
    });
}

/// A rock exactly on the way and inputs too small to go around at once: the goal is blocked by it, and that
/// is said, with the number of steps; the rock is kept clear of.
#[test]
fn a_deadlock_is_reported() {
    let rock = Outside(DistanceDisc::new([10.0, 0.0], 3.0, 3.0).expect("valid disc"));
    let mut filter = Filter::builder(PointMass)
        .barrier("goal", disc(20.0, 0.0), BarrierSettings::within(6.0))
        .and_then(|b| b.barrier("rock", rock, BarrierSettings::within(6.0)))
        .and_then(|b| b.bounds(&[-4.0, -4.0], &[4.0, 4.0]))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let (mut deadlock, mut closest) = (None, f64::INFINITY);
    run(&mut filter, [0.0, 0.0, 0.0, 0.0], 12.0, |t, x, filter| {
        let report = filter.report();
        closest = f64::min(closest, (x[0] - 10.0).hypot(x[1]));
        let goal = report.barriers[0];
        assert_eq!(report.unmet().any(|i| i == 0), goal.unmet_steps > 0);
        if goal.deadlocked {
            assert_eq!((goal.blocked_by, report.status), (Some(1), Status::Infeasible), "at {t}");
            deadlock.get_or_insert(t);
        }
    });
    assert!(deadlock.is_some_and(|t| t < 6.0), "seen at {deadlock:?}");
    assert!(closest >= 3.0, "{closest} m from the centre of the rock");
    assert!(filter.report().barriers[0].unmet_steps > 100);
}

#[test]
fn windows_are_checked() {
    let builder = || Filter::builder(PointMass);
    let with = || builder().barrier("goal", disc(5.0, 0.0), BarrierSettings::within(4.0));
    let refused = |b: Result<FilterBuilder<PointMass, 4, 2>, punctual_core::Error>| {
        b.err().expect("refused").to_string()
    };
    let window = |begin, end| refused(with().and_then(|b| b.window(begin, end)));
    assert_eq!(window(Begin::At(4.0), End::Never), "goal.begin: is 4, must be < deadline = 4");
    assert_eq!(window(Begin::At(-1.0), End::Never), "goal.begin: is -1, must be finite and >= 0");
    assert_eq!(window(Begin::At(2.0), End::At(2.0)), "goal.end: is 2, must be > begin = 2");
    let before = "goal.end: is 3.5, must be >= deadline = 4, the promise to keep";
    for begin in [Begin::AtOnce, Begin::At(2.0)] {
        assert_eq!(window(begin, End::At(3.5)), before);
        assert!(with().and_then(|b| b.window(begin, End::At(4.0))).is_ok());
    }
    assert_eq!(
        window(Begin::AfterArrival(0), End::Never),
        "goal.begin: waits for barrier 0, must be one added before"
    );
    assert_eq!(
        refused(builder().window(Begin::AtOnce, End::Never)),
        "window: there is no barrier yet to have one"
    );
}

/// A barrier that waits, or has been released, asks for nothing at the end of the longest step either.
#[test]
fn a_window_and_a_longest_step() {
    let mut filter = Filter::builder(PointMass)
        .barrier("A", disc(5.0, 0.0), BarrierSettings::within(3.0))
        .and_then(|b| b.window(Begin::AtOnce, End::OnArrival))
        .and_then(|b| b.barrier("B", disc(-5.0, 0.0), BarrierSettings::within(6.0)))
        .and_then(|b| b.window(Begin::AfterArrival(0), End::Never))
        .and_then(|b| b.period_max(0.02))
        .and_then(FilterBuilder::build)
        .expect("a valid filter");
    let mut phases = [[false; 6]; 2];
    run(&mut filter, [0.0; 4], 7.0, |_, _, filter| {
        for (seen, b) in phases.iter_mut().zip(&filter.report().barriers) {
            seen[b.phase as usize] = true;
        }
    });
    assert!(phases[0][Phase::Released as usize] && phases[1][Phase::Waiting as usize]);
    assert_eq!(filter.report().barriers[1].phase, Phase::Stay);
}
