//! A filter that is armed later than at its first step: what it shows until then, and states, resets,
//! re-armings and derivatives before and after.

use punctual_core::filter::{AssuranceStatus, Phase, Status};

use crate::api::API;
use crate::fmu::{FILTER, Fmu};
use crate::slave::Slave;

/// With backup plans and a period of 10 ms.
const PLANS: &str = r#"
kind = "filter"
assurance = "on"
arm_after = 0.3
plant.model = "point_mass"
bounds = { u_x = [-8.0, 8.0], u_y = [-8.0, 8.0] }
experiment.step_size = 0.1
[[barrier]]
name = "goal"
centre = [9.0, 8.0]
radius = 2.0
deadline = 6.0
"#;

/// The irregular step lengths of a master.
const STEPS: [f64; 8] = [0.1, 0.05, 0.0, 0.13, 0.02, 0.07, 0.1, 0.11];
const AFTER: f64 = 0.3;

fn inputs(t: f64) -> [f64; 6] {
    [1.0 + 2.0 * t, 0.5 + t, 2.0, 1.0, 70.0 * (3.0 * t).sin(), -5.0]
}

fn armed_later() -> String {
    FILTER.replace("kind = \"filter\"", "kind = \"filter\"\narm_after = 0.3")
}

/// Makes the steps number `from` to `to`, starting at `t`; returns the time after them.
fn drive(slave: &Slave, mut t: f64, from: usize, to: usize) -> f64 {
    for k in from..to {
        let h = STEPS[k % STEPS.len()];
        slave.set_inputs(&inputs(t));
        slave.step(t, h);
        t += h;
    }
    t
}

/// Asserts the outputs before the filter is armed: `u_ref` within its bounds, and nothing promised, in every
/// variable.
fn assert_not_armed(slave: &Slave, t: f64) {
    let [.., wish, down] = inputs(t);
    assert_eq!(
        [slave.integer("status"), slave.integer("status_code")],
        [Status::NotArmed as i32; 2],
        "at {t}"
    );
    assert_eq!([slave.real("u.u_x"), slave.real("u.u_y")], [wish.clamp(-50.0, 50.0), down], "at {t}");
    assert_eq!([slave.integer("goal.phase"), slave.integer("goal.phase_code")], [Phase::Waiting as i32; 2]);
    assert!(["guaranteed", "on_course", "arrived"].iter().all(|of| !slave.flag(&format!("goal.{of}"))));
    assert_eq!((slave.real("goal.time_left"), slave.integer("goal.unmet_steps")), (0.0, 0));
    assert!(slave.real("goal.h") < 0.0);
}

#[test]
fn it_waits_from_the_first_step_on_and_then_is_a_fresh_filter() {
    let (late, fresh) = (Fmu::new(&armed_later()), Fmu::new(FILTER));
    let (slave, other) = (Slave::ready(&late), Slave::ready(&fresh));
    let (mut t, mut waited) = (2.0, 0);
    for k in 0..40 {
        let h = STEPS[k % STEPS.len()];
        slave.set_inputs(&inputs(t));
        let is_armed = t - 2.0 >= AFTER - 1e-9;
        if !is_armed {
            assert_not_armed(&slave, t);
        }
        slave.step(t, h);
        if is_armed {
            other.set_inputs(&inputs(t));
            other.step(t, h);
            let (shown, wanted) = (slave.snapshot(), other.snapshot());
            for line in wanted.iter().filter(|line| !line.starts_with("arm_after: ")) {
                assert!(shown.contains(line), "at {t}: {line}");
            }
        } else {
            waited += 1;
            assert_not_armed(&slave, t);
        }
        t += h;
    }
    assert_eq!(waited, 5);
    assert!(slave.real("goal.time_left") > 0.0);
}

/// Set as a parameter, it works as in the file; a filter that is armed after the end of the run never
/// requires anything.
#[test]
fn a_parameter_says_when() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::new(&fmu);
    assert!(
        slave
            .refused(slave.try_set("arm_after", -1.0))
            .ends_with("arm_after: is -1, must be finite and >= 0")
    );
    slave.set("arm_after", 1e6);
    slave.initialize();
    slave.set_inputs(&inputs(0.0));
    assert_not_armed(&slave, 0.0);
    let mut t = 0.0;
    for k in 0..50 {
        let from = t;
        t = drive(&slave, t, k, k + 1);
        assert_not_armed(&slave, from);
    }
    // A reset restores the parameter and the waiting time.
    slave.ok((API.reset)(slave.component));
    slave.initialize();
    slave.set_inputs(&inputs(0.0));
    slave.step(0.0, 0.1);
    assert_eq!((slave.integer("goal.phase"), slave.real("goal.time_left")), (Phase::Approach as i32, 10.0));
}

#[test]
fn states_on_either_side_lead_to_the_same_bits() {
    for configuration in [&armed_later(), PLANS] {
        let fmu = Fmu::new(configuration);
        let slave = Slave::ready(&fmu);
        let (mut times, mut states, mut t) = (Vec::new(), Vec::new(), 0.0);
        for k in 0..12 {
            times.push(t);
            states.push(slave.state());
            t = drive(&slave, t, k, k + 1);
        }
        let (wanted, shown) = (slave.now(), slave.snapshot());
        for (k, state) in states.iter().enumerate().rev() {
            slave.restore(*state);
            drive(&slave, times[k], k, 12);
            assert!(slave.now() == wanted, "back to before step {k}");
            // As bytes, into an instance that was never initialised.
            let other = Slave::new(&fmu);
            other.restore(other.read(&slave.bytes(*state)));
            drive(&other, times[k], k, 12);
            assert!(other.now() == wanted && other.snapshot() == shown, "from the bytes before step {k}");
        }
    }
}

#[test]
fn a_rearming_does_not_make_it_wait_again() {
    let fmu = Fmu::new(&armed_later());
    let slave = Slave::ready(&fmu);
    let step = |t: f64, rearm: bool| {
        slave.set_inputs(&inputs(t));
        slave.set_flag("rearm", rearm);
        slave.step(t, 0.1);
        (slave.integer("status") == Status::NotArmed as i32, slave.real("goal.time_left"))
    };
    assert_eq!(step(0.0, false), (true, 0.0));
    assert_eq!(step(0.1, true), (true, 0.0), "a rising edge before its time");
    assert_eq!(step(0.2, false), (true, 0.0));
    assert_eq!(step(0.3, true), (false, 10.0), "a rising edge at the very step");
    assert_eq!(step(1.3, true).1, 9.0);
    step(2.0, false);
    assert_eq!(step(2.3, true), (false, 10.0));
}

#[test]
fn plans_are_decided_on_at_the_armed_step() {
    let fmu = Fmu::new(PLANS);
    let slave = Slave::ready(&fmu);
    for k in 0..8 {
        let t = f64::from(k) * 0.1;
        slave.set_inputs(&[1.0, 0.5, 0.0, 0.0, 70.0, 0.0]);
        slave.step(t, 0.1);
        let wanted = if k < 3 { AssuranceStatus::Undecided } else { AssuranceStatus::Assured };
        assert_eq!(
            [slave.integer("assurance"), slave.integer("assurance_code")],
            [wanted as i32; 2],
            "at {t}"
        );
        assert_eq!(slave.flag("goal.guaranteed"), k >= 3, "at {t}");
        assert_eq!(slave.integer("status") == Status::NotArmed as i32, k < 3);
        if k < 3 {
            assert_eq!([slave.real("u.u_x"), slave.real("u.u_y")], [8.0, 0.0]);
        }
        // It does not move although it was told to, so the guarantee is finally lost, but not before it was
        // given.
        if wanted == AssuranceStatus::Assured {
            break;
        }
    }
    assert_eq!(slave.real("goal.time_left"), 6.0);
}

#[test]
fn derivatives_are_those_of_what_is_shown() {
    let fmu = Fmu::new(&armed_later());
    let slave = Slave::ready(&fmu);
    // The first u_ref exceeds its bounds.
    slave.set_inputs(&[1.0, 0.5, 2.0, 1.0, 70.0, -5.0]);
    let outputs = ["u.u_x", "u.u_y", "goal.h", "goal.slack", "goal.profile"].map(|name| fmu.reference(name));
    let derivative = |known: &str| {
        let (known, mut out) = (fmu.reference(known), [f64::NAN; 5]);
        let n = outputs.len();
        slave.ok((API.directional_derivative)(
            slave.component,
            outputs.as_ptr(),
            n,
            &raw const known,
            1,
            &1.0,
            out.as_mut_ptr(),
        ));
        out
    };
    assert_eq!(derivative("u_ref.u_x"), [0.0; 5]);
    assert_eq!(derivative("u_ref.u_y"), [0.0, 1.0, 0.0, 0.0, 0.0]);
    let h = derivative("x.x_p");
    let at = |x: f64| {
        slave.set_inputs(&[x]);
        slave.real("goal.h")
    };
    let difference = (at(1.0 + 1e-4) - at(1.0 - 1e-4)) / 2e-4;
    assert!(h[2] > 0.5 && (h[2] - difference).abs() < 1e-7, "towards the disc: {h:?}, {difference}");
    assert_eq!([h[0], h[1], h[3], h[4]], [0.0; 4]);
}
