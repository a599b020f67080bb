//! A filter that follows plans: bitwise the filter of the core; plans in states, log messages, and
//! derivatives.

use punctual_core::filter::{AssuranceStatus, Status};

use crate::api::{API, ERROR, OK};
use crate::fmu::Fmu;
use crate::slave::Slave;
use crate::states::{LENGTH, sealed};

const STEP: f64 = 0.05;

/// A goal that can be reached in time, and an obstacle on the way, into which u_ref drives.
const ASSURED: &str = r#"
kind = "filter"
assurance = "on"
plant.model = "unicycle"
bounds = { a = [-4.0, 4.0], omega = [-2.0, 2.0] }
experiment.step_size = 0.05
[[barrier]]
name = "goal"
centre = [20.0, 10.0]
radius = 2.0
deadline = 8.0
[[barrier]]
name = "tree"
shape = "obstacle"
centre = [10.0, 5.0]
radius = 2.0
"#;
const HOSTILE: [f64; 2] = [4.0, -1.0];

/// The plant over one step, with a separate integrator.
fn moved(x: [f64; 4], u: [f64; 2]) -> [f64; 4] {
    moved_at(x, |x| [x[3] * x[2].cos(), x[3] * x[2].sin(), u[1], u[0]])
}

fn moved_at(x: [f64; 4], rate: impl Fn([f64; 4]) -> [f64; 4]) -> [f64; 4] {
    let beside = |k: [f64; 4], dt: f64| std::array::from_fn(|i| x[i] + dt * k[i]);
    let a = rate(x);
    let b = rate(beside(a, STEP / 2.0));
    let c = rate(beside(b, STEP / 2.0));
    let d = rate(beside(c, STEP));
    std::array::from_fn(|i| x[i] + STEP / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]))
}

fn sample(slave: &Slave, x: [f64; 4]) {
    slave.set_inputs(&[x[0], x[1], x[2], x[3], HOSTILE[0], HOSTILE[1]]);
}

/// Makes steps `from` to `to` from `x`; returns the inputs given and the last state.
fn drive(slave: &Slave, mut x: [f64; 4], from: u32, to: u32) -> (Vec<[u64; 2]>, [f64; 4]) {
    let mut given = Vec::new();
    for k in from..to {
        sample(slave, x);
        slave.step(f64::from(k) * STEP, STEP);
        let u = [slave.real("u.a"), slave.real("u.omega")];
        given.push(u.map(f64::to_bits));
        x = moved(x, u);
    }
    (given, x)
}

#[test]
fn an_fmu_follows_plans_as_the_core_does() {
    let fmu = Fmu::new(ASSURED);
    let (slave, mut filter) = (Slave::ready(&fmu), fmu.filter().build_loop().expect("a filter"));
    let mut x = [0.0, 0.0, 1.0, 0.0];
    let mut backups = 0;
    for k in 0..220 {
        // The current time of the FMU, which it accumulates itself.
        let (t, mut u) = (slave.time(), [0.0; 2]);
        filter.expect_hold(Some(STEP)).expect("a hold");
        filter.step(t, &x, &HOSTILE, &mut u).expect("right lengths");
        sample(&slave, x);
        // Reading ahead of the step changes nothing.
        if k % 3 == 0 {
            assert_eq!(slave.real("u.a").to_bits(), u[0].to_bits(), "{t}");
        }
        slave.step(t, STEP);
        slave.shows(&filter, &u, &format!("at {t}"));
        assert_eq!(slave.integer("assurance"), AssuranceStatus::Assured as i32, "{t}");
        assert!(slave.flag("goal.guaranteed") && slave.flag("tree.guaranteed"), "{t}");
        let status = slave.integer("status");
        assert!(Status::from_number(status).is_some_and(Status::is_satisfied), "{t}: {status}");
        backups += i32::from(status == Status::Backup as i32);
        x = moved(x, u);
        assert!((x[0] - 10.0).hypot(x[1] - 5.0) >= 2.0, "{t}: {x:?}");
        assert!(t + STEP < 8.0 || (x[0] - 20.0).hypot(x[1] - 10.0) <= 2.0, "{t}: {x:?}");
    }
    assert!(backups > 0, "the plan never had to decide");
    assert_eq!(slave.log.messages(), [""; 0]);
}

/// The plan is part of the state: restored from bytes into another instance, everything that follows is
/// bitwise the same.
#[test]
fn a_plan_is_saved_with_the_state() {
    let fmu = Fmu::new(ASSURED);
    let (slave, other) = (Slave::ready(&fmu), Slave::new(&fmu));
    let (_, x) = drive(&slave, [0.0, 0.0, 1.0, 0.0], 0, 40);
    let state = slave.state();
    let bytes = slave.bytes(state);
    assert_eq!(bytes[LENGTH..LENGTH + 8], (bytes.len() as u64).to_le_bytes());
    let (on, _) = drive(&slave, x, 40, 90);
    slave.restore(state);
    assert_eq!(drive(&slave, x, 40, 90).0, on);
    other.restore(other.read(&bytes));
    assert_eq!(other.now(), bytes);
    assert_eq!(drive(&other, x, 40, 90).0, on);
    assert_eq!(other.integer("assurance"), AssuranceStatus::Assured as i32);
}

/// The slip angle of a bicycle, integrated inside the filter: plan and integral are saved together, and the
/// promise is kept with the mean angle that the plant receives.
#[test]
fn a_plan_is_saved_with_the_integral() {
    const LENGTH: f64 = 3.0;
    let fmu = Fmu::new(
        r#"
kind = "filter"
assurance = "on"
plant = { model = "bicycle_small_slip_rate", l_r = 3.0 }
integrator = { state = "beta", gain = 4.0, min = -0.5, max = 0.5 }
bounds = { a = [-6.0, 6.0], beta_rate = [-3.0, 3.0] }
experiment.step_size = 0.05
[[barrier]]
name = "goal"
centre = [20.0, 10.0]
radius = 2.0
deadline = 7.0
"#,
    );
    let drive = |slave: &Slave, mut x: [f64; 4], from: u32, to: u32| {
        let mut given = Vec::new();
        for k in from..to {
            slave.set_inputs(&[x[0], x[1], x[2], x[3], 6.0, 0.4]);
            slave.step(f64::from(k) * STEP, STEP);
            let u = [slave.real("u.a"), slave.real("u.beta")];
            given.push([u[0], u[1], slave.real("integrator.beta")].map(f64::to_bits));
            let rate = |x: [f64; 4]| {
                let (sin, cos) = x[2].sin_cos();
                [x[3] * (cos - sin * u[1]), x[3] * (sin + cos * u[1]), x[3] * u[1] / LENGTH, u[0]]
            };
            x = moved_at(x, rate);
            let away = (x[0] - 20.0).hypot(x[1] - 10.0);
            assert!(f64::from(k + 1) * STEP < 7.0 - 1e-9 || away <= 2.0, "{k}: {x:?}");
        }
        (given, x)
    };
    let (slave, other) = (Slave::ready(&fmu), Slave::new(&fmu));
    let (_, x) = drive(&slave, [0.0, 0.0, 1.0, 0.0], 0, 40);
    assert_eq!(slave.integer("assurance"), AssuranceStatus::Assured as i32);
    let state = slave.state();
    let bytes = slave.bytes(state);
    let (on, _) = drive(&slave, x, 40, 200);
    slave.restore(state);
    assert_eq!(drive(&slave, x, 40, 200).0, on);
    other.restore(other.read(&bytes));
    assert_eq!(drive(&other, x, 40, 200).0, on);
    assert_eq!(other.integer("assurance"), AssuranceStatus::Assured as i32);
}

/// Bytes that are not a plan of this filter are refused; other damaged plans keep inputs finite and within
/// their bounds.
#[test]
fn damaged_plans_do_no_harm() {
    let fmu = Fmu::new(ASSURED);
    let slave = Slave::ready(&fmu);
    let (_, x) = drive(&slave, [0.0, 0.0, 1.0, 0.0], 0, 30);
    let bytes = slave.now();
    // The plan state comes last and is the largest part of the state.
    let first = bytes.len() * 2 / 5;
    let (mut refused, mut taken) = (0, 0);
    for (n, at) in (first..bytes.len() - 20).step_by(97).enumerate() {
        let mut damaged = bytes.clone();
        match n % 4 {
            // NaN, wherever it begins.
            0 => damaged[at..].iter_mut().take(16).for_each(|byte| *byte = 255),
            1 => damaged[at] = 0,
            2 => damaged[at] ^= 0x40,
            _ => damaged[at] ^= 0x01,
        }
        let (status, state) = slave.try_read(&sealed(damaged));
        if status != OK {
            assert!(slave.refused(status).starts_with("fmi2DeSerializeFMUstate: "));
            refused += 1;
            continue;
        }
        if (API.set_state)(slave.component, state) == ERROR {
            refused += 1;
            continue;
        }
        taken += 1;
        sample(&slave, x);
        slave.step(30.0 * STEP, STEP);
        let u = [slave.real("u.a"), slave.real("u.omega")];
        assert!(u[0].abs() <= 4.0 && u[1].abs() <= 2.0, "{at}: {u:?}");
    }
    assert!(refused >= 5 && taken > 5, "{refused} refused, {taken} taken");
}

#[test]
fn what_is_not_promised_is_said_in_words() {
    let soon = ASSURED.replace("deadline = 8.0", "deadline = 2.0");
    let fmu = Fmu::new(&soon);
    let slave = Slave::ready(&fmu);
    drive(&slave, [0.0, 0.0, 1.0, 0.0], 0, 3);
    assert_eq!(slave.integer("assurance"), AssuranceStatus::Refused as i32);
    assert!(!slave.flag("goal.guaranteed") && !slave.flag("tree.guaranteed"));
    // Once, not at every step.
    let [message] = &slave.log.messages()[..] else { panic!("{:?}", slave.log.messages()) };
    assert!(
        message.starts_with("the guarantee is refused (") && message.contains("goal is not met at 2 s"),
        "{message}"
    );
    assert_eq!(slave.log.entries()[0].category, "logStatusWarning");
    // Re-arming decides again; moving the plant from outside ends the guarantee.
    let fmu = Fmu::new(ASSURED);
    let slave = Slave::ready(&fmu);
    drive(&slave, [0.0, 0.0, 1.0, 0.0], 0, 3);
    sample(&slave, [-300.0, 0.0, 0.0, 0.0]);
    slave.step(3.0 * STEP, STEP);
    assert_eq!(slave.integer("assurance"), AssuranceStatus::Lost as i32);
    assert!(slave.log.messages()[0].starts_with("the guarantee is lost ("), "{:?}", slave.log.messages());
    // Once it is back, the guarantee is given again, which is also logged once.
    for k in 4..6 {
        sample(&slave, [0.0, 0.0, 1.0, 0.0]);
        slave.step(f64::from(k) * STEP, STEP);
        assert_eq!(slave.integer("assurance"), AssuranceStatus::Assured as i32);
    }
    let said = slave.log.messages();
    assert!(said.len() == 2 && said[1].starts_with("the guarantee is regained"), "{said:?}");
    // A value read before the step that decides again equals that of the step.
    slave.set_flag("rearm", true);
    sample(&slave, [0.0, 0.0, 1.0, 0.0]);
    let read = (slave.integer("assurance"), slave.flag("goal.guaranteed"));
    assert_eq!(read, (AssuranceStatus::Assured as i32, true));
    slave.step(6.0 * STEP, STEP);
    // A refused step has no plan for its input.
    slave.refused(slave.try_step(7.0 * STEP, -1.0));
    assert!(
        slave.integer("assurance") == AssuranceStatus::Undecided as i32 && !slave.flag("goal.guaranteed")
    );
    sample(&slave, [0.0, 0.0, 1.0, 0.0]);
    slave.step(7.0 * STEP, STEP);
    assert_eq!(slave.integer("assurance"), AssuranceStatus::Assured as i32);
    // Late.
    sample(&slave, [0.0, 0.0, 1.0, 0.0]);
    slave.step(12.0 * STEP, STEP);
    assert_eq!(slave.integer("assurance"), AssuranceStatus::Irregular as i32);
}

/// A parameter may require something that plans do not support. Then nothing is promised, and the log says
/// why. With `assurance = "on"` the parameter is refused.
#[test]
fn parameters_that_no_plan_accounts_for() {
    let erroneous = ASSURED
        .replace("\"unicycle\"", "\"bicycle_small_slip_rate\"\nplant.l_r = 2.5")
        .replace("omega = [-2.0, 2.0]", "beta_rate = [-2.0, 2.0]")
        .replace(
            "experiment",
            "integrator = { state = \"beta\", min = -0.6, max = 0.6 }\nmeasurement_errors = { v = 0.0 }\nexperiment",
        );
    let left = erroneous.replace("assurance = \"on\"\n", "");
    for (v, status) in [(0.0, AssuranceStatus::Assured), (0.01, AssuranceStatus::Refused)] {
        let fmu = Fmu::new(&left);
        let slave = Slave::new(&fmu);
        slave.set("measurement_error.v", v);
        slave.initialize();
        sample(&slave, [0.0, 0.0, 0.0, 1.0]);
        slave.step(0.0, STEP);
        let said = slave.log.messages().concat();
        assert_eq!(slave.integer("assurance"), status as i32, "{said}");
        assert_eq!(slave.flag("goal.guaranteed"), v == 0.0);
        let why = "the guarantee is refused (no plan was found at the start: nothing is promised): no plan accounts yet for \
                   [measurement_errors] behind an [integrator]";
        assert!(if v == 0.0 { said.is_empty() } else { said.starts_with(why) }, "{said}");
        // Back to where it was.
        let state = slave.state();
        let bytes = slave.bytes(state);
        slave.restore(slave.read(&bytes));
        assert_eq!(slave.now(), bytes);
    }
    let fmu = Fmu::new(&erroneous);
    let slave = Slave::new(&fmu);
    slave.set("measurement_error.v", 0.01);
    slave.ok((API.setup_experiment)(slave.component, 0, 0.0, 0.0, 0, 0.0));
    slave.ok((API.enter_initialization_mode)(slave.component));
    let said = slave.refused((API.exit_initialization_mode)(slave.component));
    assert!(said.contains("assurance"), "{said}");
}

/// What is declared of the plant are parameters. The promise covers it, and has an end; a plan for it is saved with the state.
#[test]
fn uncertain_plants_are_promised_by_parameters() {
    let declared = "uncertainty = { rates = { v = 0.0 }, inputs = { a = { gain = [1.0, 1.0] } } }\n\
                    measurement_errors = { x_p = 0.0 }\nexperiment";
    let fmu = Fmu::new(&ASSURED.replace("experiment", declared));
    let ready = |numbers: &[(&str, f64)]| {
        let slave = Slave::new(&fmu);
        numbers.iter().for_each(|(name, number)| slave.set(name, *number));
        slave
    };
    // Nothing differs: as without the table.
    let slave = ready(&[]);
    slave.initialize();
    let (exact, _) = drive(&slave, [0.0, 0.0, 1.0, 0.0], 0, 3);
    assert_eq!(slave.real("assured_until").to_bits(), 1e30_f64.to_bits());
    let plain = Fmu::new(ASSURED);
    assert_eq!(drive(&Slave::ready(&plain), [0.0, 0.0, 1.0, 0.0], 0, 3).0, exact);
    // A wind, a weak engine and an error.
    let numbers =
        [("uncertainty.rate.v", 0.1), ("uncertainty.gain_min.a", 0.9), ("measurement_error.x_p", 0.02)];
    let slave = ready(&numbers);
    slave.initialize();
    let (_, x) = drive(&slave, [0.0, 0.0, 1.0, 0.0], 0, 10);
    assert_eq!(slave.integer("assurance"), AssuranceStatus::Assured as i32, "{:?}", slave.log.messages());
    let until = slave.real("assured_until");
    assert!(until > 8.0 && until < 20.0, "{until}");
    let other = ready(&numbers);
    other.initialize();
    other.restore(other.read(&slave.now()));
    assert_eq!(other.now(), slave.now());
    assert_eq!(drive(&other, x, 10, 30).0, drive(&slave, x, 10, 30).0);
    // From more to less.
    let slave = ready(&[("uncertainty.gain_min.a", 1.1)]);
    slave.ok((API.setup_experiment)(slave.component, 0, 0.0, 0.0, 0, 0.0));
    slave.ok((API.enter_initialization_mode)(slave.component));
    let said = slave.refused((API.exit_initialization_mode)(slave.component));
    assert!(said.contains("uncertainty.inputs.a.gain: is [1.1, 1], must be [least, largest]"), "{said}");
}

/// Derivatives are those of the piece in force, and are refused if a plan is new.
#[test]
fn derivatives_are_given_or_refused() {
    let (goal, _) = ASSURED.rsplit_once("[[barrier]]").expect("two barriers");
    let fmu = Fmu::new(goal);
    let slave = Slave::ready(&fmu);
    let (unknown, known, seed, mut out) = (fmu.reference("u.a"), fmu.reference("x.v"), 1.0, f64::NAN);
    let mut x = [0.0, 0.0, 1.0, 0.0];
    let (mut given, mut backups, mut refused) = (0, 0, 0);
    for k in 0..120 {
        sample(&slave, x);
        let backup = slave.integer("status") == Status::Backup as i32;
        let c = slave.component;
        let status = (API.directional_derivative)(
            c,
            &raw const unknown,
            1,
            &raw const known,
            1,
            &raw const seed,
            &raw mut out,
        );
        if status == OK {
            given += 1;
            backups += u32::from(backup);
            assert!(out.is_finite());
        } else {
            refused += 1;
            assert!(slave.refused(status).contains("no derivative at this sample: "));
        }
        x = drive(&slave, x, k, k + 1).1;
    }
    assert!(given > 60 && backups > 5, "{given} given, {backups} of the plan, {refused} refused");
}

/// A vehicle that must not stop has no plan that ends at rest. Its guarantee has an end, which is saved with
/// the state.
#[test]
fn a_promise_with_an_end_tells_it() {
    let forwards = "[[barrier]]\nname = \"forwards\"\nshape = \"at_least\"\nstate = \"v\"\nbound = 0.5\n";
    let horizon = "assurance = \"on\"\nplan_horizon = 4.0";
    let moving = ASSURED.replace("assurance = \"on\"", horizon) + forwards;
    let fmu = Fmu::new(&moving);
    let (slave, other) = (Slave::ready(&fmu), Slave::new(&fmu));
    let mut x = [0.0, 0.0, 1.0, 1.0];
    let mut until = 0.0;
    for k in 0..12 {
        (_, x) = drive(&slave, x, 25 * k, 25 * (k + 1));
        assert_eq!(slave.integer("assurance"), AssuranceStatus::Assured as i32);
        let now = slave.real("assured_until");
        assert!(now >= until && now > slave.time(), "from {until} to {now}");
        until = now;
    }
    // More than the deadline plus the horizon, so it was extended.
    assert!(until > 18.0, "{until}");
    other.restore(other.read(&slave.now()));
    assert_eq!(other.real("assured_until").to_bits(), until.to_bits());
    assert_eq!(drive(&other, x, 300, 320).0, drive(&slave, x, 300, 320).0);
    // Without it there is no such output.
    assert!(Fmu::new(ASSURED).product.variables.iter().all(|variable| variable.name != "assured_until"));
}
