//! Communication points and steps as importers actually pass them.

use punctual_core::filter::Filter;

use crate::api::API;
use crate::fmu::{FILTER, Fmu, PLANT};
use crate::slave::Slave;

fn sample(filter: &mut Filter, t: f64, x: &[f64; 6]) -> [f64; 2] {
    let mut u = [f64::NAN; 2];
    filter.step(t, &x[..4], &x[4..], &mut u).unwrap();
    u
}

const INPUTS: [f64; 6] = [1.0, 2.0, 3.0, 4.0, 0.5, -0.5];

/// Steps and points seen in importers: jitter, tiny steps, zero steps, and points that are not sums of steps.
/// A point within round-off of the end of the last step is that end.
#[test]
fn odd_steps() {
    let fmu = Fmu::new(FILTER);
    let (slave, mut filter) = (Slave::ready(&fmu), fmu.filter().build().unwrap());
    let mut end = 0.0;
    for (t, h) in [
        (0.0, 0.1),
        (0.1, 0.0999999999999998),
        (0.2, 1.1e-16),
        (0.2, 0.1),
        (0.30000000000000004, 0.05),
        (0.35000000000000003, 0.1),
        (0.45, 0.0),
        (0.45, 0.0),
        (0.45, f64::MIN_POSITIVE),
        (0.449999999999999, 0.55),
        // A gap, which is the importer's choice.
        (5.0, 1e-3),
        (5.001000001, 1e-3),
        (5.002000001, 100.0),
        (105.0020000001, 1e6),
    ] {
        slave.set_inputs(&INPUTS);
        slave.step(t, h);
        let start: f64 = if (t - end).abs() <= 1.1e-9 { end } else { t };
        let u = sample(&mut filter, start, &INPUTS);
        slave.shows(&filter, &u, &format!("after the step from {t} by {h}"));
        end = (t + h).max(start);
        assert_eq!(slave.time().to_bits(), end.to_bits(), "after the step from {t} by {h}");
    }
}

/// Three ways to compute the same points: none is refused, and the promise is the same up to round-off.
#[test]
fn time_added_multiplied_and_in_nanoseconds() {
    let fmu = Fmu::new(FILTER);
    let (steps, h, begin) = (20_000, 1e-3, 1e5);
    let mut added = begin;
    let slaves = [(); 3].map(|()| {
        let slave = Slave::new(&fmu);
        slave.ok((API.setup_experiment)(slave.component, 0, 0.0, begin, 0, 0.0));
        slave.ok((API.enter_initialization_mode)(slave.component));
        slave.ok((API.exit_initialization_mode)(slave.component));
        slave.set_inputs(&INPUTS);
        slave
    });
    for k in 0..steps {
        slaves[0].step(added, h);
        slaves[1].step(begin + f64::from(k) * h, h);
        let nanoseconds = 100_000_000_000_000_i64 + i64::from(k) * 1_000_000;
        slaves[2].step(nanoseconds as f64 / 1e9, h);
        added += h;
    }
    // Each addition rounds by at most half a unit in the last place of 2·10⁵ s.
    let tolerance = f64::from(steps) * 0.5 * 2.0_f64.powi(-35);
    for slave in &slaves {
        let time = slave.time();
        assert!((time - 100_020.0).abs() < tolerance, "{time} after {steps} steps, tolerance {tolerance}");
        assert_eq!(slave.real("goal.time_left"), 0.0);
    }
}

#[test]
fn backwards_without_a_restored_state() {
    for (configuration, begin) in [(FILTER, 0.0), (PLANT, 0.0), (FILTER, 1e6), (PLANT, 1.7e9)] {
        let fmu = Fmu::new(configuration);
        let slave = Slave::new(&fmu);
        slave.ok((API.setup_experiment)(slave.component, 0, 0.0, begin, 0, 0.0));
        slave.ok((API.enter_initialization_mode)(slave.component));
        slave.ok((API.exit_initialization_mode)(slave.component));
        slave.set_inputs(&[1.0, 0.5]);
        slave.step(begin, 0.001);
        let (now, before) = (slave.time(), slave.snapshot());
        // The whole step again, half of it, and before the start.
        for t in [begin, begin + 0.0005, begin - 1.0] {
            let message = slave.refused(slave.try_step(t, 0.001));
            let wanted = format!(
                "fmi2DoStep: currentCommunicationPoint is {t}, must be finite and not before the present \
                 one, {now}"
            );
            assert_eq!(message, wanted);
            let wanted = Slave::after_refusal(&before);
            assert_eq!((slave.time(), slave.snapshot()), (now, wanted), "after the refused {t}");
        }
        slave.step(now, 0.001);
    }
}

/// A point that is early by round-off does not move time backwards, however often it occurs.
#[test]
fn time_does_not_creep_backwards() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::ready(&fmu);
    slave.step(0.0, 1.0);
    for k in 0..10 {
        let t = 1.0 - 0.9e-9 * f64::from(k);
        if k < 2 {
            slave.step(t, 0.0);
        } else {
            slave.refused(slave.try_step(t, 0.0));
        }
        assert_eq!(slave.time(), 1.0, "after the step from {t}");
    }
}

#[test]
fn times_and_steps_that_are_none() {
    for configuration in [FILTER, PLANT] {
        let fmu = Fmu::new(configuration);
        let slave = Slave::ready(&fmu);
        slave.step(0.0, 0.5);
        let before = slave.snapshot();
        for (t, h, wanted) in [
            (
                f64::NAN,
                0.1,
                "currentCommunicationPoint is NaN, must be finite and not before the present one, 0.5",
            ),
            (
                f64::INFINITY,
                0.1,
                "currentCommunicationPoint is inf, must be finite and not before the present one, 0.5",
            ),
            (0.5, f64::NAN, "communicationStepSize is NaN at t = 0.5, must be finite and >= 0"),
            (0.5, -0.1, "communicationStepSize is -0.1 at t = 0.5, must be finite and >= 0"),
            (0.5, -1e-300, "communicationStepSize is -0."),
            (0.5, f64::INFINITY, "communicationStepSize is inf at t = 0.5, must be finite and >= 0"),
            (f64::MAX, f64::MAX, "ends at inf, must be finite"),
        ] {
            let message = slave.refused(slave.try_step(t, h));
            assert!(message.contains(wanted), "{message} should contain {wanted}");
            let wanted = Slave::after_refusal(&before);
            assert_eq!((slave.time(), slave.snapshot()), (0.5, wanted), "after {t}, {h}");
        }
        slave.step(0.5, 0.1);
    }
}

/// An importer that ignores the error of one step continues at the next communication point. A plant would
/// have lost part of its motion, a filter has not.
#[test]
fn a_gap_is_refused_by_a_plant_and_taken_by_a_filter() {
    for (configuration, gaps) in [(FILTER, true), (PLANT, false)] {
        let fmu = Fmu::new(configuration);
        let slave = Slave::ready(&fmu);
        // The first step may be anywhere, since not every importer passes the start time.
        slave.step(3.0, 0.1);
        slave.refused(slave.try_step(3.1, f64::NAN));
        if gaps {
            slave.step(3.2, 0.1);
            continue;
        }
        let message = slave.refused(slave.try_step(3.2, 0.1));
        let wanted = "currentCommunicationPoint is 3.2, must be the present one, 3.1: the plant did not move";
        assert!(message.contains(wanted), "{message}");
        // Round-off and the resolution of an importer's clock are not a gap.
        slave.step(3.1 + 1e-8, 0.1);
    }
}

#[test]
fn a_step_of_no_length_moves_nothing() {
    for configuration in [FILTER, PLANT] {
        let fmu = Fmu::new(configuration);
        let slave = Slave::ready(&fmu);
        slave.set_inputs(&[1.0, 0.5]);
        slave.step(0.0, 0.25);
        slave.set_inputs(&[1.0, 0.5]);
        let before = slave.snapshot();
        for _ in 0..3 {
            slave.step(0.25, 0.0);
            assert_eq!((slave.time(), slave.snapshot()), (0.25, before.clone()));
        }
    }
}

/// The design step is only a suggestion, and a start other than 0 may come without SetupExperiment.
#[test]
fn any_start_time() {
    let fmu = Fmu::new(FILTER);
    for begin in [-5.0, 0.0, 1e-9, 3.25, 1.7e9] {
        let (slave, mut filter) = (Slave::new(&fmu), fmu.filter().build().unwrap());
        if begin <= 0.0 {
            slave.ok((API.setup_experiment)(slave.component, 0, 0.0, begin, 0, 0.0));
        }
        slave.ok((API.enter_initialization_mode)(slave.component));
        slave.ok((API.exit_initialization_mode)(slave.component));
        slave.set_inputs(&INPUTS);
        for (t, h) in [(begin, 0.5), (begin + 0.5, 0.25)] {
            slave.step(t, h);
            // 1e-9 s counts as 0, where the instance starts by default.
            let u = sample(&mut filter, if t == 1e-9 { 0.0 } else { t }, &INPUTS);
            slave.shows(&filter, &u, &format!("after the step from {t}, started at {begin}"));
        }
    }
}
