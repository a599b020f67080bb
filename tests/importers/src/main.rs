//! Two independent importers, `fmi` and `fmi-rs`, couple a filter with a plant, with FMI 2.0 and 3.0. Every
//! output of both must equal that recorded by `punctual run`, bit for bit, at every communication point.
//!
//! `punctual-importers FOLDER STEP`, where FOLDER holds recorded.csv, filter.fmu and plant.fmu, and the same for FMI 3.0
//! in its folder fmi3; see `run`.
#![forbid(unsafe_code)]

mod recording;
mod with_fmi;
mod with_fmi3;
mod with_fmi_rs;
mod with_fmi_rs3;

use std::collections::HashMap;
use std::path::Path;

use recording::Recording;

/// The getters by which values are read.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Real,
    /// Integers, and enumerations too.
    Integer,
    Boolean,
}

/// A variable as the importer's own reader sees it.
struct Variable {
    name: String,
    reference: u32,
    kind: Kind,
    output: bool,
}

/// One FMU in an importer; a status other than OK is a panic.
trait Importer: Sized {
    /// Opens `file` and initialises an instance at time 0.
    fn open(file: &Path) -> Self;
    fn variables(&self) -> &[Variable];
    fn set_reals(&mut self, references: &[u32], values: &[f64]);
    fn reals(&mut self, references: &[u32], values: &mut [f64]);
    fn integer(&mut self, reference: u32) -> i32;
    fn boolean(&mut self, reference: u32) -> bool;
    fn step(&mut self, t: f64, h: f64);
    fn terminate(self);
}

/// The references of `names`, in this order.
fn references(importer: &impl Importer, names: &[&str]) -> Vec<u32> {
    let all: HashMap<_, _> = importer.variables().iter().map(|v| (v.name.as_str(), v.reference)).collect();
    names.iter().map(|name| *all.get(name).unwrap_or_else(|| panic!("there is no {name}"))).collect()
}

/// Every output by name, reals as they are, others as numbers.
fn outputs(importer: &mut impl Importer) -> Vec<(String, f64)> {
    let read: Vec<_> = importer
        .variables()
        .iter()
        .filter(|v| v.output)
        .map(|v| (v.name.clone(), v.reference, v.kind))
        .collect();
    let value = |(name, reference, kind): (String, u32, Kind)| {
        let value = match kind {
            Kind::Real => {
                let mut value = [f64::NAN];
                importer.reals(&[reference], &mut value);
                value[0]
            }
            Kind::Integer => f64::from(importer.integer(reference)),
            Kind::Boolean => f64::from(u8::from(importer.boolean(reference))),
        };
        (name, value)
    };
    read.into_iter().map(value).collect()
}

/// Couples both FMUs in the order of `punctual run` and compares; returns the number of values compared.
fn compare<I: Importer>(folder: &Path, h: f64, recording: &Recording) -> usize {
    let (mut filter, mut plant) = (I::open(&folder.join("filter.fmu")), I::open(&folder.join("plant.fmu")));
    let states = ["x.x_p", "x.y_p", "x.theta", "x.v"];
    let plant_states = references(&plant, &states);
    let filter_inputs = references(&filter, &[&states[..], &["u_ref.a"]].concat());
    let (filter_outputs, plant_inputs) =
        (references(&filter, &["u.a", "u.omega"]), references(&plant, &["u.a", "u.omega"]));
    let mut compared = 0;
    let mut check = |row: usize, component: &str, values: Vec<(String, f64)>| {
        for (name, value) in values {
            // An Integer twin has the number of the enumeration; only the enumeration is recorded.
            let recorded = name.strip_suffix("_code").unwrap_or(&name);
            let wanted = recording.value(row, &format!("{component}.{recorded}"));
            assert_eq!(
                value.to_bits(),
                wanted.to_bits(),
                "row {row}: {component}.{name} is {value}, not {wanted}"
            );
            compared += 1;
        }
    };
    let last = recording.rows() - 1;
    for k in 0..=last {
        let t = k as f64 * h;
        let (mut x, mut u) = ([0.0; 5], [0.0; 2]);
        plant.reals(&plant_states, &mut x[..4]);
        // The nominal controller: damping.
        x[4] = -x[3];
        filter.set_reals(&filter_inputs, &x);
        if k < last {
            filter.step(t, h);
        }
        check(k, "plant", outputs(&mut plant));
        check(k, "filter", outputs(&mut filter));
        if k < last {
            filter.reals(&filter_outputs, &mut u);
            plant.set_reals(&plant_inputs, &u);
            plant.step(t, h);
        }
    }
    filter.terminate();
    plant.terminate();
    compared
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, folder, step] = &arguments[..] else { panic!("usage: punctual-importers FOLDER STEP") };
    let (folder, h) = (Path::new(folder), step.parse().expect("STEP is a number of seconds"));
    let recording = Recording::read(&folder.join("recorded.csv"));
    assert!(recording.rows() > 1000, "{} rows", recording.rows());
    let counts = [
        ("fmi", compare::<with_fmi::Slave>(folder, h, &recording)),
        ("fmi, FMI 3.0", compare::<with_fmi3::Slave>(&folder.join("fmi3"), h, &recording)),
        ("fmi-rs", compare::<with_fmi_rs::Slave>(folder, h, &recording)),
        ("fmi-rs, FMI 3.0", compare::<with_fmi_rs3::Slave>(&folder.join("fmi3"), h, &recording)),
    ];
    for (importer, count) in counts {
        println!("ok {importer}: {count} values at {} points, every bit as recorded", recording.rows());
    }
}
