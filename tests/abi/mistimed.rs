//! Masters that restore a state and then pass a time within the steps that this took back.
//!
//! MasterSim's error control does so. It tries a step of h from t, and again as two halves. If they differ
//! too much, it restores the state at t but leaves its clock at t + h/2 for the first try with a shorter
//! step.

use punctual_fmu::product::LOG_CATEGORIES;

use crate::api::{API, State};
use crate::fmu::{FILTER, Fmu, PLANT};
use crate::rollback::{Random, Step, all, every_fmu};
use crate::slave::Slave;

const CONTROLLER: &str = "kind = \"controller\"\nplant.model = \"unicycle\"\ncontroller = \"waypoints\"\n\
                          points = [[0.1, 0.0], [0.2, 0.1], [9.0, 4.0]]\nacceptance_radius = 0.5\n";

/// Follows plans, which the state contains too.
const ASSURED: &str = r#"
kind = "filter"
assurance = "on"
plant.model = "point_mass"
bounds = { u_x = [-4.0, 4.0], u_y = [-4.0, 4.0] }
experiment.step_size = 0.05
[[barrier]]
name = "goal"
centre = [20.0, 10.0]
radius = 2.0
deadline = 8.0
"#;

/// Asserts that the log has one warning, about the first step of `slave` that was given `given` instead of
/// `restored`.
fn warned(slave: &Slave, given: f64, restored: f64) {
    let entries = slave.log.entries();
    let start = format!("currentCommunicationPoint is {given}, must be the restored one, {restored}: ");
    let warnings: Vec<_> = entries.iter().filter(|e| e.message.starts_with(&start)).collect();
    let [entry] = warnings[..] else { panic!("{start} {entries:?}") };
    assert_eq!((entry.status, entry.category.as_str()), (1, "logStatusWarning"));
    assert!(LOG_CATEGORIES.iter().any(|(name, _)| *name == entry.category));
    let others = entries.iter().filter(|e| e.message.contains("must be the restored one")).count();
    assert_eq!(others, 1, "warned once: {entries:?}");
}

/// MasterSim's step with error control, call by call. `stale` is its clock after a failed try.
struct MasterSim<'a> {
    filter: Slave<'a>,
    plant: Slave<'a>,
    stale: bool,
    /// Steps that were given a wrong time.
    mistimed: Vec<[f64; 2]>,
}

impl<'a> MasterSim<'a> {
    fn new(filter: &'a Fmu, plant: &'a Fmu, stale: bool) -> Self {
        Self { filter: Slave::ready(filter), plant: Slave::ready(plant), stale, mistimed: Vec::new() }
    }

    /// Passes values between both FMUs in Gauss–Seidel order; returns the resulting state of the plant.
    fn exchange(&self, t: f64, h: f64) -> [f64; 4] {
        let x = self.x();
        self.filter.set_inputs(&[x[0], x[1], x[2], x[3], -x[3], 0.2]);
        self.filter.step(t, h);
        self.plant.set_inputs(&["u.a", "u.omega"].map(|name| self.filter.real(name)));
        self.plant.step(t, h);
        self.x()
    }

    fn x(&self) -> [f64; 4] {
        ["x.x_p", "x.y_p", "x.theta", "x.v"].map(|name| self.plant.real(name))
    }

    fn states(&self) -> [State; 2] {
        [self.filter.state(), self.plant.state()]
    }

    fn restore(&self, states: [State; 2]) {
        self.filter.restore(states[0]);
        self.plant.restore(states[1]);
    }

    /// A step from `t` of at most `h`; returns its end and the next step.
    fn step(&mut self, t: f64, mut h: f64) -> (f64, f64) {
        let (start, mut clock) = (self.states(), t);
        loop {
            if clock != t {
                self.mistimed.push([clock, t]);
            }
            let whole = self.exchange(clock, h);
            self.restore(start);
            self.exchange(t, h / 2.0);
            let halves = self.exchange(t + h / 2.0, h / 2.0);
            let error = |(a, b): (&f64, &f64)| (a - b).abs() / (1e-4 * b.abs() + 1e-4);
            let error = whole.iter().zip(&halves).map(error).fold(0.0, f64::max);
            let next = h * (0.9 / error.sqrt()).clamp(0.2, 2.0);
            if error <= 1.0 {
                return (t + h, next.min(0.2));
            }
            self.restore(start);
            clock = if self.stale { t + h / 2.0 } else { t };
            h = next;
        }
    }
}

/// The whole run is bitwise that of a master with a correct clock, and each FMU warns once.
#[test]
fn an_error_controlled_master_with_a_stale_clock() {
    let filter = Fmu::new(
        "kind = \"filter\"\nassurance = \"off\"\nplant.model = \"unicycle\"\n\
         bounds = { a = [-3.0, 3.0], omega = [-1.0, 1.0] }\n\
         [[barrier]]\nname = \"goal\"\ncentre = [4.0, 3.0]\nradius = 1.0\ndeadline = 2.0\n",
    );
    let plant = Fmu::new(PLANT);
    let [mut right, mut stale] = [false, true].map(|stale| MasterSim::new(&filter, &plant, stale));
    let (mut t, mut h, mut steps) = (0.0, 0.2, 0);
    while t < 3.0 {
        let ends = [&mut right, &mut stale].map(|master| master.step(t, h));
        assert_eq!(ends[0], ends[1]);
        let both = |master: &MasterSim| (all(&master.filter), all(&master.plant));
        assert_eq!(both(&stale), both(&right), "at {t}");
        (t, h) = ends[0];
        steps += 1;
    }
    // The first step is also tried in vain, although a plant accepts any time as its start.
    assert!(stale.mistimed.len() > 5 && stale.mistimed[0][1] == 0.0, "{steps} steps, {:?}", stale.mistimed);
    let [given, restored] = stale.mistimed[0];
    for slave in [&stale.filter, &stale.plant] {
        warned(slave, given, restored);
    }
    for slave in [&right.filter, &right.plant] {
        assert_eq!(slave.log.messages(), [""; 0]);
    }
}

/// Given any time within the steps taken back, every FMU makes the step from the restored time, and accepts
/// the correct times from there on.
#[test]
fn any_time_within_the_steps_taken_back() {
    let mut fmus = every_fmu();
    fmus.extend([CONTROLLER, ASSURED].map(Fmu::new));
    for fmu in &fmus {
        let name = fmu.product.configuration.name();
        let mut random = Random(11);
        let slaves @ [right, wrong] = &[(); 2].map(|()| Slave::ready(fmu));
        let (mut t, mut wrongs) = (0.0, 0);
        for k in 0..40 {
            let states = slaves.each_ref().map(Slave::state);
            // One step or two that are taken back.
            let tried = [(); 2].map(|()| Step::valid(&mut random, fmu));
            let mut end = t;
            for step in &tried[..=random.below(2) as usize] {
                let begin = end;
                for slave in slaves {
                    (end, _) = (begin, step.begin(slave));
                    step.end(slave, &mut end);
                }
            }
            for (slave, state) in slaves.iter().zip(states) {
                slave.restore(state);
                // A second restore, and a refused step, change nothing.
                if random.below(2) == 0 {
                    slave.restore(state);
                    slave.refused(slave.try_step(t, f64::NAN));
                }
            }
            let late = (end - t) * [0.0, 0.25, 0.5, 1.0][random.below(4) as usize];
            // A nanosecond later is the same time.
            let given = if late > 1.1e-9 { t + late } else { t };
            let step = Step::valid(&mut random, fmu);
            for (slave, given) in [(right, t), (wrong, given)] {
                step.begin(slave);
                slave.step(given, step.h);
            }
            wrongs += usize::from(given > t);
            t += step.h;
            assert_eq!(all(wrong), all(right), "{name}: step {k}, {given} in place of {t} - {}", step.h);
            assert_eq!(wrong.time().to_bits(), right.time().to_bits());
        }
        assert!(wrongs > 5, "{name}: {wrongs}");
        let warnings = |slave: &Slave| {
            slave.log.messages().iter().filter(|m| m.contains("must be the restored one")).count()
        };
        assert_eq!((warnings(wrong), warnings(right)), (1, 0), "{name}");
    }
}

/// A plant refuses times outside the steps taken back, and every wrong time at the second step.
#[test]
fn a_plant_takes_no_other_time() {
    let fmu = Fmu::new(PLANT);
    let slave = Slave::ready(&fmu);
    slave.set_inputs(&[1.0, 0.5]);
    slave.step(0.0, 1.0);
    let state = slave.state();
    slave.step(1.0, 0.25);
    slave.step(1.25, 0.25);
    slave.restore(state);
    let before = slave.now();
    for (t, wanted) in [
        (1.5 + 1e-6, "must be the present one, 1: the plant did not move in between"),
        (1.0 - 1e-6, "must be finite and not before the present one, 1"),
        (f64::NAN, "must be finite and not before the present one, 1"),
    ] {
        let message = slave.refused(slave.try_step(t, 0.125));
        assert!(message.ends_with(wanted), "{message}");
        assert_eq!(slave.now(), before, "{t}");
    }
    slave.step(1.25, 0.125);
    warned(&slave, 1.25, 1.0);
    assert_eq!(slave.time(), 1.125);
    // Strict again: at the end that the wrong time would have had, within the steps taken back, and before.
    for t in [1.375, 1.25, 1.0] {
        let message = slave.refused(slave.try_step(t, 0.125));
        assert!(message.contains("must be") && message.contains("the present one, 1.125"), "{message}");
    }
    slave.step(1.125, 0.125);
    // After a reset, an instance has made no steps that an earlier state could take back. A new run warns
    // again.
    slave.ok((API.reset)(slave.component));
    slave.restore(state);
    slave.refused(slave.try_step(1.25, 0.125));
    slave.ok((API.reset)(slave.component));
    slave.initialize();
    slave.restore(state);
    slave.refused(slave.try_step(1.25, 0.125));
    slave.step(1.0, 0.5);
    slave.restore(state);
    slave.step(1.5, 0.125);
    let warnings = slave.log.entries().iter().filter(|e| e.category == "logStatusWarning").count();
    assert_eq!(warnings, 2);
}

/// A filter accepts gaps. After a restore it does so beyond the steps taken back, and from the second step
/// on.
#[test]
fn a_filter_still_takes_gaps() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::ready(&fmu);
    slave.set_inputs(&[1.0, 2.0, 3.0, 4.0, 0.5, -0.5]);
    slave.step(0.0, 1.0);
    let state = slave.state();
    slave.step(1.0, 0.5);
    slave.restore(state);
    slave.refused(slave.try_step(0.75, 0.125));
    slave.step(1.75, 0.125);
    assert_eq!((slave.time(), slave.log.messages().len()), (1.875, 1));
    // The steps after 1.75 do not follow from the state at 1.0, so they are not the ones taken back.
    slave.restore(state);
    slave.step(1.75, 0.125);
    assert_eq!((slave.time(), slave.log.messages().len()), (1.875, 1));
    slave.restore(state);
    slave.step(1.0, 0.5);
    slave.restore(state);
    slave.step(1.25, 0.125);
    assert_eq!(slave.time(), 1.125);
    warned(&slave, 1.25, 1.0);
    slave.step(1.25, 0.125);
    assert_eq!(slave.time(), 1.375);
}

/// Times that are correct without a restore remain correct with one: a first step anywhere if no start time
/// was given, and a clock that rounds.
#[test]
fn right_times_stay_right() {
    for configuration in [FILTER, PLANT] {
        let fmu = Fmu::new(configuration);
        let run = |back: bool| {
            let slave = Slave::new(&fmu);
            slave.ok((API.enter_initialization_mode)(slave.component));
            slave.ok((API.exit_initialization_mode)(slave.component));
            slave.set_inputs(&[1.0, 0.5]);
            for (t, h) in [(3.0, 0.25), (3.25 + 1e-8, 0.25), (3.5 + 2e-8, 0.125)] {
                let state = slave.state();
                if back {
                    slave.step(t, h);
                    slave.step(t + h, h);
                    slave.restore(state);
                }
                slave.step(t, h);
            }
            assert_eq!(slave.log.messages(), [""; 0]);
            all(&slave)
        };
        assert_eq!(run(true), run(false));
        // A run that starts again may begin anywhere, even within the previous one.
        let slave = Slave::new(&fmu);
        let instantiated = slave.state();
        slave.initialize();
        slave.step(0.0, 1.5);
        slave.restore(instantiated);
        slave.ok((API.enter_initialization_mode)(slave.component));
        slave.ok((API.exit_initialization_mode)(slave.component));
        slave.step(1.25, 0.125);
        assert_eq!((slave.time(), slave.log.messages()), (1.375, Vec::new()));
    }
}

/// The difference is no more than a plant allows for clock rounding, but the steps taken back had not begun
/// late.
#[test]
fn a_wrong_time_close_to_the_right_one() {
    let (h, late) = (2.0_f64.powi(-9), 2.0_f64.powi(-10));
    for configuration in [FILTER, PLANT] {
        let fmu = Fmu::new(configuration);
        let slave = Slave::ready(&fmu);
        slave.step(0.0, 1.0);
        let state = slave.state();
        slave.step(1.0, h);
        slave.restore(state);
        slave.step(1.0 + late, h);
        assert_eq!(slave.time(), 1.0 + h);
        warned(&slave, 1.0 + late, 1.0);
    }
}

/// A state contains nothing about the steps that it took back: its bytes are the same, and another instance
/// is strict.
#[test]
fn the_state_does_not_know() {
    let fmu = Fmu::new(PLANT);
    let slave = Slave::ready(&fmu);
    slave.step(0.0, 1.0);
    let (state, before) = (slave.state(), slave.now());
    slave.step(1.0, 0.5);
    slave.restore(state);
    assert_eq!(slave.now(), before);
    let other = Slave::new(&fmu);
    other.restore(other.read(&slave.now()));
    other.refused(other.try_step(1.25, 0.125));
    slave.step(1.25, 0.125);
    other.step(1.0, 0.125);
    assert_eq!(all(&slave), all(&other));
    // These are steps of another instance, so this one took none back.
    other.step(1.125, 4.0);
    slave.restore(slave.read(&other.now()));
    slave.step(5.125, 0.5);
    slave.restore(state);
    slave.refused(slave.try_step(3.0, 0.125));
}
