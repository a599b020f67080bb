//! The filter in a file of the C library is the filter of the configuration.
//!
//! On a model of expressions it has the same bits, though its derivatives come from tapes alone and share their memory. On a
//! vehicle with a name, whose derivatives come from other code, the inputs agree up to round-off.
//!
//! With `PUNCTUAL_RECORD=FOLDER` the files and the samples are left there for tests/embedded/run, which replays them through C:
//! `PUNCTUAL_SAMPLES` of them for each filter.

#[path = "../../core/tests/draw/mod.rs"]
mod draw;

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::Path;

use draw::Draw;
use punctual_core::filter::{Filter, Report, Status};
use punctual_core::follower::{Follower, Following, PlanTable};
use punctual_embedded::Loaded;
use punctual_fmu::configuration::{Configuration, FilterConfiguration};

fn filter(text: &str) -> FilterConfiguration {
    match Configuration::parse(text) {
        Ok(Configuration::Filter(filter)) => filter,
        Ok(_) => panic!("no filter: {text}"),
        Err(error) => panic!("{error}: {text}"),
    }
}

/// A unicycle as a vehicle with a name.
const NAMED: &str = "model = \"unicycle\"";

/// The same as expressions.
const EXPRESSED: &str = "states = [{ name = \"x_p\", unit = \"m\" }, { name = \"y_p\", unit = \"m\" }, { name = \"theta\", unit = \"rad\" },
    { name = \"v\", unit = \"m/s\" }]
inputs = [{ name = \"a\", unit = \"m/s2\" }, { name = \"omega\", unit = \"rad/s\" }]
derivatives = { x_p = \"v*cos(theta)\", y_p = \"v*sin(theta)\", theta = \"omega\", v = \"a\" }";

/// A unicycle among so many obstacles, with a goal; `keys` are more keys of the filter, `of_goal` of the goal.
fn vehicle(plant: &str, obstacles: usize, keys: &str, of_goal: &str, draw: &mut Draw) -> String {
    let position = if plant == NAMED { "" } else { "position = [\"x_p\", \"y_p\"]\n" };
    let mut text = format!(
        "kind = \"filter\"\nassurance = \"off\"\nbounds = {{ a = [-4.0, 4.0], omega = [-1.5, 1.5] }}\n{keys}\n[plant]\n{plant}\n
[[barrier]]\nname = \"goal\"\nshape = \"disc\"\ncentre = [18.0, 4.0]\nradius = 2.0\n{position}{of_goal}\n"
    );
    for i in 0..obstacles {
        let (x, y) = (draw.uniform(3.0, 17.0), draw.uniform(-4.0, 8.0));
        write!(text, "[[barrier]]\nname = \"post_{i}\"\nshape = \"obstacle\"\ncentre = [{x:?}, {y:?}]\nradius = 0.8\n{position}")
            .expect("a string takes all");
    }
    text
}

/// What differs between filters: their names, their files, and the steps with which they are run.
struct Case {
    name: &'static str,
    text: String,
    /// The range of steps in s, and whether the filter is told each before.
    steps: [f64; 2],
    told: bool,
    /// How far a start may be from (0, 0, 0, 1), in units of each state.
    spread: f64,
}

fn cases() -> Vec<Case> {
    let mut draw = Draw::new(55);
    let kilohertz = "sampling = \"step_size\"\nexperiment = { step_size = 0.001, stop_time = 20.0 }";
    let tenth = "experiment = { step_size = 0.1, stop_time = 20.0 }";
    let deadline = "deadline = 15.0";
    let mut cases = Vec::new();
    let mut add = |name, text, steps, told| cases.push(Case { name, text, steps, told, spread: 0.5 });
    for (name, obstacles) in [("unicycle_1", 1), ("unicycle_5", 5), ("unicycle_10", 10)] {
        add(name, vehicle(EXPRESSED, obstacles, kilohertz, deadline, &mut draw), [0.001; 2], false);
    }
    add("jitter", vehicle(EXPRESSED, 6, tenth, deadline, &mut draw), [0.01, 0.15], false);
    add("told", vehicle(EXPRESSED, 6, tenth, deadline, &mut draw), [0.01, 0.15], true);
    let brief = format!("brief_search = true\n{kilohertz}");
    add("brief_10", vehicle(EXPRESSED, 10, &brief, deadline, &mut draw), [0.001; 2], false);
    let brief = format!("brief_search = true\n{tenth}");
    add("brief_jitter", vehicle(EXPRESSED, 6, &brief, deadline, &mut draw), [0.01, 0.15], false);
    let keys = "sampling = \"step_size\"\nactuation_delay = 0.05\nperiod_max = 0.03\narm_after = 0.5\nexperiment = { step_size = 0.02, stop_time = 20.0 }";
    add("late", vehicle(EXPRESSED, 3, keys, "deadline = 15.0\npenalty = 5.0", &mut draw), [0.02; 2], false);
    let pointwise = "sampling = \"pointwise\"\nexperiment = { step_size = 0.01, stop_time = 20.0 }";
    let kilohertz = "sampling = \"pointwise\"\nexperiment = { step_size = 0.001, stop_time = 20.0 }";
    let margin = "deadline = 15.0\nmargin = 0.01";
    add("pointwise_10", vehicle(EXPRESSED, 10, kilohertz, margin, &mut draw), [0.001; 2], false);
    let rates = "deadline = 15.0\nrates = [1.5, 2.5]\nmargin = 0.05\nrecovery = 2.0";
    add("rates", vehicle(EXPRESSED, 2, pointwise, rates, &mut draw), [0.01; 2], false);
    let window = "deadline = 15.0\nmethod = \"repeated_root\"\nuntil_arrival = true";
    add("pointwise", vehicle(EXPRESSED, 2, pointwise, window, &mut draw), [0.01; 2], false);
    // A chain of three, and everything that an expression may have.
    let text = "kind = \"filter\"\nassurance = \"off\"\nbounds = { jerk = [-8.0, 8.0] }\nexperiment = { step_size = 0.05, stop_time = 20.0 }
[plant]\nstates = [{ name = \"p\" }, { name = \"w\" }, { name = \"b\" }]\ninputs = [{ name = \"jerk\" }]
parameters = [{ name = \"c\", start = 0.3 }]
derivatives = { p = \"w\", w = \"b - c*tanh(w)*abs(w)\", b = \"jerk - exp(-2 - b^2) + atan(p)/9 + min(ln(2 + p^2), max(0.1, atan2(w, 3)))\" }
[[barrier]]\nname = \"past\"\nexpression = \"p - 10 - 0.2*sin(0.3*t)\"\ndeadline = 8.0\nprofile = \"low_peak\"
[[barrier]]\nname = \"before\"\nexpression = \"30 - p\"\nbegin = 1.0\ndeadline = 9.0\npriority = 2\n";
    add("chain", text.to_owned(), [0.05; 2], false);
    // A plan, whose starts are a little more than those that are drawn.
    let keys = format!(
        "{pointwise}\nx0 = {{ v = 1.0 }}\n[uncertainty]\nrates = {{ v = 0.05 }}\n
[follower]\nstart = {{ x_p = 0.06, y_p = 0.06, theta = 0.06, v = 0.06 }}\n"
    );
    let text = vehicle(EXPRESSED, 10, "", margin, &mut Draw::new(7));
    let text = text.replace("assurance = \"off\"", "").replace("[plant]", &format!("{keys}[plant]"));
    cases.push(Case { name: "planned_10", text, steps: [0.01; 2], told: false, spread: 0.05 });
    cases
}

/// The wanted input of a step: nothing, something at random that is held for a while, as much as possible, or what is no number.
fn wanted(draw: &mut Draw, step: usize, u_ref: &mut [f64]) {
    if step.is_multiple_of(64) {
        let kind = draw.uniform(0.0, 5.0) as u32;
        for u in u_ref.iter_mut() {
            *u = match kind {
                0 => 0.0,
                1 => draw.uniform(-1.0, 1.0).signum() * 10.0,
                _ => draw.uniform(-3.0, 3.0),
            };
        }
    }
}

fn fold(digest: u64, number: f64) -> u64 {
    // Which of its NaNs a processor makes is its own affair.
    let bits = if number.is_nan() { 0x7ff8_0000_0000_0000 } else { number.to_bits() };
    (digest.rotate_left(5) ^ bits).wrapping_mul(0x0000_0100_0000_01b3)
}

/// Everything that `punctual_step` reports of the plan and `punctual_barrier` of all barriers, in one number; tests/embedded/replay.c
/// has the same.
fn digest(report: &Report, following: Following, until: f64, is_guaranteed: impl Fn(usize) -> bool) -> u64 {
    let mut digest = fold(fold(0, f64::from(following as u8)), until);
    for (i, b) in report.barriers.iter().enumerate() {
        let flags = [b.on_course, b.deadline_unreachable, b.deadlocked, is_guaranteed(i)].map(f64::from);
        let arrival = b.arrival_time.unwrap_or(f64::NAN);
        let numbers =
            [b.h, b.time_left, b.slack, arrival, f64::from(b.phase as u8), f64::from(b.unmet_steps)];
        digest = numbers.into_iter().chain(flags).fold(digest, fold);
    }
    digest
}

/// The filter of a configuration, and a follower of its plan.
struct Apart<'a> {
    rows: Filter,
    follower: Option<Follower<'a>>,
    promised: &'a [bool],
}

/// A filter with or without a plan.
trait Way {
    fn rearm(&mut self);
    fn expect_hold(&mut self, hold: Option<f64>);
    fn step(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Status;
    fn digest(&self) -> u64;
}

impl Way for Apart<'_> {
    fn rearm(&mut self) {
        self.rows.rearm();
        self.follower.iter_mut().for_each(Follower::rearm);
    }

    fn expect_hold(&mut self, hold: Option<f64>) {
        self.rows.expect_hold(hold).expect("a time");
    }

    fn step(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Status {
        let followed = self.follower.as_mut().map(|f| f.step(t, x, u_ref, u).expect("the lengths"));
        if followed != Some(Following::Kept) {
            return self.rows.step(t, x, u_ref, u).expect("the lengths").status;
        }
        self.rows.observe(t, x, u).expect("the lengths");
        if u == u_ref { Status::Unchanged } else { Status::Filtered }
    }

    fn digest(&self) -> u64 {
        let following = self.follower.as_ref().map_or(Following::NotBegun, |f| f.state().following);
        let until = self.follower.as_ref().and_then(Follower::until);
        digest(self.rows.report(), following, until.unwrap_or(0.0), |i| until.is_some() && self.promised[i])
    }
}

impl Way for Loaded<'_> {
    fn rearm(&mut self) {
        self.rearm();
    }

    fn expect_hold(&mut self, hold: Option<f64>) {
        self.filter.expect_hold(hold).expect("a time");
    }

    fn step(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Status {
        self.step(t, x, u_ref, u).expect("the lengths").status
    }

    fn digest(&self) -> u64 {
        let following = self.follower.as_ref().map_or(Following::NotBegun, |f| f.state().following);
        digest(self.filter.report(), following, self.until().unwrap_or(0.0), |i| self.is_guaranteed(i))
    }
}

/// Runs two filters side by side through `samples` steps, starting again now and then; `judge` sees each step, with the statuses
/// and digests.
fn run(
    case: &Case,
    pair: [&mut dyn Way; 2],
    samples: usize,
    mut judge: impl FnMut(&[f64], [&[f64]; 2], [(Status, u64); 2]),
) {
    let configuration = filter(&case.text);
    let plant = configuration.plant.build().expect("a plant");
    let (states, inputs) = (configuration.plant.states().len(), configuration.plant.inputs().len());
    let mut draw = Draw::new(case.name.len() as u64);
    let (mut t, mut x, mut u_ref) = (0.0, vec![0.0; states], vec![0.0; inputs]);
    let [a, b] = pair;
    for step in 0..samples {
        let again = step.is_multiple_of(20_000);
        if again {
            t = draw.uniform(0.0, 3.0);
            x.iter_mut()
                .enumerate()
                .for_each(|(i, x)| *x = draw.uniform(-case.spread, case.spread) + f64::from(i == 3));
        }
        wanted(&mut draw, step, &mut u_ref);
        let hold = draw.uniform(case.steps[0], case.steps[1]);
        let broken = step % 997 == 996;
        let mut seen = x.clone();
        if broken {
            seen[0] = f64::NAN;
        }
        let mut results = [vec![0.0; inputs], vec![0.0; inputs]];
        let mut found = [(Status::default(), 0); 2];
        for ((filter, u), found) in [&mut *a, &mut *b].into_iter().zip(&mut results).zip(&mut found) {
            if again {
                filter.rearm();
            }
            filter.expect_hold(case.told.then_some(hold));
            *found = (filter.step(t, &seen, &u_ref, u), filter.digest());
        }
        let sample: Vec<f64> = [f64::from(again), t, if case.told { hold } else { 0.0 }]
            .into_iter()
            .chain(seen)
            .chain(u_ref.iter().copied())
            .collect();
        judge(&sample, results.each_ref().map(Vec::as_slice), found);
        plant.rk4_step(&mut x, &results[0], hold).expect("the lengths");
        t += hold;
    }
}

fn samples(default: usize) -> usize {
    std::env::var("PUNCTUAL_SAMPLES").map_or(default, |text| text.parse().expect("a number"))
}

#[test]
fn a_file_has_the_bits_of_its_filter() {
    let folder = std::env::var("PUNCTUAL_RECORD").ok();
    let mut seen = [0; Status::ALL.len()];
    for case in cases() {
        let configuration = filter(&case.text);
        let (file, table) = configuration.embedded().expect(case.name);
        let bytes = file.to_bytes().expect("bytes");
        let follower =
            table.as_ref().map(|table| Follower::new(PlanTable::read(&table.bytes).expect("a table")));
        let promised = table.as_ref().map(|table| &table.promised[..]).unwrap_or_default();
        let mut wanted = Apart { rows: configuration.build().expect("a filter"), follower, promised };
        let mut found = punctual_embedded::read(&bytes).expect("a filter");
        let (states, inputs) = (configuration.plant.states().len(), configuration.plant.inputs().len());
        let count = samples(2_000);
        let mut record = folder.as_ref().map(|folder| {
            let at = |ending: &str| Path::new(folder).join(format!("{}.{ending}", case.name));
            fs::write(at("bin"), &bytes).expect("written");
            let mut record = BufWriter::new(File::create(at("samples")).expect("created"));
            for number in [states, inputs, count] {
                record.write_all(&(number as u64).to_le_bytes()).expect("written");
            }
            record
        });
        run(&case, [&mut wanted, &mut found], count, |sample, [a, b], [wanted, found]| {
            let bits = |u: &[f64]| u.iter().map(|u| u.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(a), bits(b), "{}: {sample:?}", case.name);
            assert_eq!(wanted, found, "{}: {sample:?}", case.name);
            let (status, digest) = wanted;
            seen[status as usize] += 1;
            if let Some(record) = &mut record {
                let numbers = sample.iter().chain(a).map(|number| number.to_bits());
                for bits in numbers.chain([status as u64, digest]) {
                    record.write_all(&bits.to_le_bytes()).expect("written");
                }
            }
        });
    }
    // That nothing else happened would show little.
    for status in
        [Status::Unchanged, Status::Filtered, Status::Infeasible, Status::InvalidInput, Status::NotArmed]
    {
        assert!(seen[status as usize] > 0, "never {}: {seen:?}", status.name());
    }
}

#[test]
fn a_vehicle_with_a_name_is_the_same_up_to_round_off() {
    let mut draw = Draw::new(3);
    let keys = "sampling = \"step_size\"\nexperiment = { step_size = 0.02, stop_time = 20.0 }";
    let text = vehicle(NAMED, 4, keys, "deadline = 15.0", &mut draw);
    let case = Case { name: "named", text, steps: [0.02; 2], told: false, spread: 0.5 };
    let configuration = filter(&case.text);
    let rows = configuration.build().expect("a filter");
    let mut wanted = Apart { rows, follower: None, promised: &[] };
    let bytes = configuration.embedded().expect("a file").0.to_bytes().expect("bytes");
    let mut found = punctual_embedded::read(&bytes).expect("a filter");
    let (mut same, mut all) = (0, 0);
    run(&case, [&mut wanted, &mut found], 3_000, |_, [a, b], [(wanted, _), (found, _)]| {
        all += 1;
        // Where two answers are equally far, round-off decides: rare, and a turn to the other side.
        same += u32::from(wanted == found && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6));
    });
    assert!(same * 100 >= all * 99, "{same} of {all}");
}

#[test]
fn what_the_library_has_not_is_refused_in_words() {
    let mut draw = Draw::new(1);
    let vehicle = |keys: &str, draw: &mut Draw| vehicle(NAMED, 1, keys, "deadline = 15.0", draw);
    for (text, field, part) in [
        (vehicle("", &mut draw).replace("assurance = \"off\"\n", ""), "assurance", "[follower]"),
        (vehicle("measurement_errors = { x_p = 0.1 }", &mut draw), "measurement_errors", "left out"),
        (
            vehicle("", &mut draw).replace("radius = 0.8", "radius = 0.8\ncentre_input = true"),
            "barrier[1].centre_input",
            "an input",
        ),
    ] {
        let error = filter(&text).embedded().expect_err(&text);
        assert!(error.field() == field && error.message().contains(part), "{error}");
    }
}
