//! Reset, several instances, threads, unloading.

use std::path::Path;
#[cfg(target_os = "linux")]
use std::process::Command;
use std::time::{Duration, Instant};

use crate::api::{API, Api, library_path};
use crate::fmu::{FILTER, Fmu, PLANT};
use crate::slave::Slave;

/// The inputs of step `k`, all reals: 6 for a filter, 2 for a plant.
fn inputs(k: usize, slave: &Slave) -> Vec<f64> {
    let s = k as f64;
    let inputs = [0.5 * s, 0.25, 1.0 - 0.1 * s, 2.0, 0.5, 0.75];
    inputs[..slave.fmu.product.layout.outputs.min(6)].to_vec()
}

/// Makes a run of `steps` steps with changing inputs; returns everything observed.
fn run(slave: &Slave, steps: usize) -> Vec<Vec<String>> {
    let mut t = 0.0;
    (0..steps)
        .map(|k| {
            slave.set_inputs(&inputs(k, slave));
            slave.step(t, 0.05);
            t += 0.05;
            slave.snapshot()
        })
        .collect()
}

#[test]
fn a_reset_instance_is_a_fresh_one() {
    for configuration in [FILTER, PLANT] {
        let fmu = Fmu::new(configuration);
        let fresh = Slave::new(&fmu);
        let start = fresh.snapshot();
        fresh.initialize();
        let wanted = run(&fresh, 8);

        let used = Slave::new(&fmu);
        let parameter = if configuration == FILTER { "goal.deadline" } else { "x0.v" };
        used.set(parameter, 3.5);
        used.initialize();
        if configuration == FILTER {
            used.set_flag("rearm", true);
        }
        run(&used, 5);
        for mode in ["step mode", "instantiated", "initialization mode", "terminated"] {
            if mode == "initialization mode" || mode == "terminated" {
                used.set(parameter, 4.5);
                used.ok((API.enter_initialization_mode)(used.component));
            }
            if mode == "terminated" {
                used.ok((API.exit_initialization_mode)(used.component));
                used.ok((API.terminate)(used.component));
            }
            used.ok((API.reset)(used.component));
            assert_eq!(used.snapshot(), start, "reset in {mode}");
            assert_eq!(used.time(), 0.0);
        }
        used.initialize();
        assert_eq!(run(&used, 8), wanted);
    }
}

/// Outputs read in initialization mode already belong to the start values, not to the previous run.
#[test]
fn initialization_after_a_reset_is_that_of_a_fresh_instance() {
    for configuration in [FILTER, PLANT] {
        let fmu = Fmu::new(configuration);
        let (fresh, used) = (Slave::new(&fmu), Slave::ready(&fmu));
        run(&used, 5);
        used.ok((API.reset)(used.component));
        for slave in [&fresh, &used] {
            slave.ok((API.enter_initialization_mode)(slave.component));
        }
        assert_eq!(used.snapshot(), fresh.snapshot());
    }
}

#[test]
fn instances_do_not_see_each_other() {
    let (filter, plant) = (Fmu::new(FILTER), Fmu::new(PLANT));
    let alone = [&filter, &plant].map(|fmu| run(&Slave::ready(fmu), 10));
    // Two of each, steps interleaved; the other two with other inputs, the second filter ahead.
    let [filter_a, plant_a, filter_b, plant_b] = [&filter, &plant, &filter, &plant].map(Slave::ready);
    run(&filter_b, 3);
    let mut t = 0.0;
    for k in 0..10 {
        for (slave, wanted) in [&filter_a, &plant_a].into_iter().zip(&alone) {
            slave.set_inputs(&inputs(k, slave));
            plant_b.set_inputs(&[-1.0, k as f64]);
            filter_b.set_inputs(&[f64::NAN, k as f64]);
            filter_b.snapshot();
            slave.step(t, 0.05);
            assert_eq!(slave.snapshot(), wanted[k], "at {t}");
        }
        plant_b.step(t, 0.05);
        t += 0.05;
    }
}

#[test]
fn created_used_and_freed_on_different_threads() {
    for configuration in [FILTER, PLANT] {
        let fmu = Fmu::new(configuration);
        let wanted = run(&Slave::ready(&fmu), 6);
        std::thread::scope(|scope| {
            for _ in 0..4 {
                let (fmu, wanted) = (&fmu, &wanted);
                scope.spawn(move || {
                    let slave = scope.spawn(|| Slave::new(fmu)).join().unwrap();
                    let slave = scope
                        .spawn(move || {
                            slave.initialize();
                            slave
                        })
                        .join()
                        .unwrap();
                    let (found, slave) = scope.spawn(move || (run(&slave, 6), slave)).join().unwrap();
                    assert_eq!(&found, wanted);
                    scope.spawn(move || drop(slave)).join().unwrap();
                });
            }
        });
    }
}

#[test]
fn freed_in_every_mode() {
    for configuration in [FILTER, PLANT] {
        let fmu = Fmu::new(configuration);
        drop(Slave::new(&fmu));
        let slave = Slave::new(&fmu);
        slave.ok((API.enter_initialization_mode)(slave.component));
        drop(slave);
        let slave = Slave::ready(&fmu);
        drop(slave);
        let slave = Slave::ready(&fmu);
        slave.step(0.0, 0.1);
        slave.refused(slave.try_step(-1.0, 0.1));
        drop(slave);
        let slave = Slave::ready(&fmu);
        slave.ok((API.terminate)(slave.component));
        drop(slave);
    }
}

fn threads() -> usize {
    std::fs::read_dir("/proc/self/task").unwrap().count()
}

/// The number of threads once it is `wanted`, or after ten seconds: a joined thread is listed until the
/// system has removed it.
fn threads_in_the_end(wanted: usize) -> usize {
    let begin = Instant::now();
    while threads() != wanted && begin.elapsed() < Duration::from_secs(10) {
        std::thread::sleep(Duration::from_millis(1));
    }
    threads()
}

fn is_mapped(path: &Path) -> bool {
    std::fs::read_to_string("/proc/self/maps").unwrap().contains(path.to_str().unwrap())
}

/// Runs alone in a separate process, started by [`unloads_and_loads_again`], since counts of threads and
/// mappings belong to the process.
#[test]
#[ignore = "started by unloads_and_loads_again"]
fn unloading_in_a_process_of_its_own() {
    let path = library_path();
    let before = threads();
    let mut found = Vec::new();
    for round in 0..3 {
        assert!(!is_mapped(&path), "round {round}");
        let api = Api::load(&path);
        assert!(is_mapped(&path));
        for configuration in [FILTER, PLANT] {
            let fmu = Fmu::new(configuration);
            let slave = Slave::from(&api, &fmu);
            slave.initialize();
            slave.step(0.0, 0.1);
            slave.refused(slave.try_step(-1.0, 0.1));
            // Used and freed on a thread that ends, and created on one that outlives the library.
            std::thread::scope(|scope| {
                let used = scope.spawn(move || {
                    slave.step(0.1, 0.1);
                    slave.snapshot()
                });
                found.push(used.join().unwrap());
            });
            assert_eq!(threads_in_the_end(before), before, "round {round}");
        }
        drop(api);
        assert!(!is_mapped(&path), "the library is still mapped after dlclose in round {round}");
        assert_eq!(threads_in_the_end(before), before, "round {round}");
    }
    assert!(found.chunks(2).all(|pair| pair == &found[..2]), "{found:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn unloads_and_loads_again() {
    let output = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "lifetime::unloading_in_a_process_of_its_own", "--ignored", "--test-threads=1"])
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && text.contains("1 passed"), "{text}");
}
