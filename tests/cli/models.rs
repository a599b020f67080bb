//! Models given by expressions, as users see them: the commands of `docs/own-model.md` and `docs/models.md`
//! are run.

use std::fs;
use std::path::{Path, PathBuf};

use crate::table::{Table, assert_same_bits};
use crate::workshop::Workshop;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_path_buf()
}

fn example(name: &str) -> Vec<u8> {
    fs::read(root().join("examples/models").join(name)).expect("an example")
}

pub(crate) fn document(name: &str) -> String {
    fs::read_to_string(root().join("docs").join(name)).expect("a document")
}

/// The contents of the code blocks of `text` in the language `language`.
pub(crate) fn blocks<'a>(text: &'a str, language: &str) -> Vec<&'a str> {
    let fence = format!("```{language}\n");
    text.split(&fence).skip(1).map(|rest| rest.split("```").next().unwrap_or_default()).collect()
}

/// A folder with the three files of `docs/own-model.md`.
fn own_model() -> Workshop {
    let workshop = Workshop::with_library();
    let text = document("own-model.md");
    let files = blocks(&text, "toml");
    assert_eq!(files.len(), 3);
    for (name, content) in ["jerk-car-filter.toml", "jerk-car-plant.toml", "jerk-car.toml"].iter().zip(files)
    {
        workshop.write(name, content);
    }
    workshop
}

#[test]
fn the_page_on_own_models_is_what_happens() {
    let (workshop, text) = (own_model(), document("own-model.md"));
    let mut printed = String::new();
    for block in blocks(&text, "console") {
        for line in block.lines().filter_map(|line| line.strip_prefix("$ punctual ")) {
            let stdout = workshop.punctual(line.split(' ')).success();
            if line.starts_with("check") {
                assert_eq!(block, format!("$ punctual {line}\n{stdout}"));
            }
            printed = stdout;
        }
    }
    for line in blocks(&text, "text").concat().lines() {
        assert!(printed.contains(line), "{line:?} in {printed}");
    }
    assert!(workshop.files().contains(&"out".to_owned()));
}

/// The rows of the table: the wrong expression in the file, and the whole message.
#[test]
fn expressions_that_are_refused() {
    let workshop = own_model();
    let filter = workshop.text("jerk-car-filter.toml");
    let text = document("own-model.md");
    let rows: Vec<_> = text.lines().filter_map(|line| line.strip_prefix("| `")).collect();
    assert_eq!(rows.len(), 5);
    for row in rows {
        let (written, message) = row.split_once("` | `").expect("two columns");
        let key = written.split_once('"').expect("a text").0;
        let line = filter.lines().find(|line| line.starts_with(key)).expect("the right line");
        workshop.write("my.toml", filter.replace(line, written));
        let done = workshop.punctual(["build", "my.toml", "-o", "my.fmu"]);
        done.fails(2, &format!("my.toml: {}", message.strip_suffix("` |").expect("its end")));
    }
    let mixed = "kind = \"filter\"\n[plant]\nstates = [{ name = \"x\" }, { name = \"y\" }, { name = \"v\" }]\n\
                 inputs = [{ name = \"a\" }, { name = \"w\" }]\n\
                 derivatives = { x = \"v\", y = \"w\", v = \"a\" }\n\
                 [[barrier]]\nname = \"goal\"\nexpression = \"x + y - 3\"\ndeadline = 2.0\n";
    workshop.write("my.toml", mixed);
    let done = workshop.punctual(["build", "my.toml", "-o", "my.fmu"]);
    let message =
        text.split("h = x + y − 3 the message is\n`").nth(1).and_then(|rest| rest.split('`').next());
    done.fails(2, &format!("my.toml: {}", message.expect("the message").replace('\n', " ")));
    assert!(!workshop.files().contains(&"my.fmu".to_owned()));
}

/// An output of a plant besides its states, given by an expression: a neighbour that moves equally fast along
/// x.
#[test]
fn an_output_is_an_expression_of_states() {
    let workshop = Workshop::new();
    let output = "[[output]]\nname = \"v_x\"\nexpression = \"v * cos(theta)\"\nunit = \"m/s\"\n";
    workshop.write("car.toml", format!("kind = \"plant\"\nplant.model = \"unicycle\"\nx0.v = 2.0\n{output}"));
    let follower = "kind = \"plant\"\n[plant]\nstates = [{ name = \"x\", unit = \"m\" }]\n\
                    inputs = [{ name = \"v\", unit = \"m/s\" }]\nderivatives = { x = \"v\" }\n";
    workshop.write("follower.toml", follower);
    let component =
        |name: &str, rest: &str| format!("[[component]]\nname = \"{name}\"\nfmu = \"{name}.toml\"\n{rest}");
    let system = "connection = [{ from = \"car.y.v_x\", to = \"follower.u.v\" }]\n".to_owned()
        + "[experiment]\nstop_time = 2.0\nstep = 0.1\n"
        + &component("car", "start = { \"u.a\" = 0.5, \"u.omega\" = 0.7 }\n")
        + &component("follower", "");
    workshop.write("system.toml", system);
    workshop.punctual(["run", "system.toml", "--out", "out"]).success();
    let table = Table::parse(&workshop.text("out/system.csv"));
    let [output, v, theta, x, along] =
        ["car.y.v_x", "car.x.v", "car.x.theta", "follower.x.x", "car.x.x_p"].map(|name| table.column(name));
    for i in 0..output.len() {
        assert!((output[i] - v[i] * theta[i].cos()).abs() < 1e-12, "{i}: {}", output[i]);
    }
    // Held over 0.1 s, the speed is off by half of its change: 0.07 m of 2.2 m.
    let last = output.len() - 1;
    assert!(output[0] == 2.0 && along[last] > 2.0 && (x[last] - along[last]).abs() < 0.15, "{}", x[last]);
}

/// A car whose jerk is off by up to 3 m/s³, with a filter that accounts for it: the promise is kept, the same
/// run repeats, and another seed gives another run.
#[test]
fn a_disturbed_car_keeps_its_promise() {
    let workshop = own_model();
    let robust = workshop.text("jerk-car-filter.toml") + "disturbance = 3.0\n";
    workshop.write("jerk-car-filter.toml", robust);
    let plant = workshop.text("jerk-car-plant.toml");
    workshop.punctual(["build", "jerk-car-filter.toml", "-o", "jerk-car-filter.fmu"]).success();
    let run = |disturbance: &str| {
        workshop.write("jerk-car-plant.toml", format!("{plant}{disturbance}"));
        workshop.punctual(["build", "jerk-car-plant.toml", "-o", "jerk-car-plant.fmu"]).success();
        workshop.punctual(["run", "jerk-car.toml", "--out", "out", "--require", "kept"]).success();
        Table::parse(&workshop.text("out/jerk-car.csv")).column("plant.x.p")
    };
    let disturbed = "[disturbance]\nseed = 1\ninputs = { jerk = 3.0 }\n";
    let (still, first, again) = (run(""), run(disturbed), run(disturbed));
    let second = run(&disturbed.replace('1', "2"));
    assert_same_bits("plant.x.p", &first, &again);
    let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart(&first, &still) > 1e-3 && apart(&first, &second) > 1e-3, "the disturbance does nothing");
}

/// Noise only affects the measurement: the car itself continues at 10 m/s.
#[test]
fn a_measurement_is_off_by_its_bound_at_most() {
    let workshop = own_model();
    let plant = workshop.text("jerk-car-plant.toml") + "[disturbance]\nmeasurements = { p = 0.5 }\n";
    workshop.write("plant.toml", plant);
    workshop.punctual(["build", "plant.toml", "-o", "plant.fmu"]).success();
    let alone = "experiment = { stop_time = 8.0, step = 0.01 }\n\
                 [[component]]\nname = \"plant\"\nfmu = \"plant.fmu\"\n\
                 start = { \"u.jerk\" = 0.0 }\n";
    workshop.write("alone.toml", alone);
    workshop.punctual(["run", "alone.toml", "--out", "out"]).success();
    let table = Table::parse(&workshop.text("out/alone.csv"));
    assert!(table.column("plant.x.v").iter().all(|v| *v == 10.0));
    let errors: Vec<f64> =
        table.column("plant.x.p").iter().zip(table.column("time")).map(|(p, t)| p - 10.0 * t).collect();
    // The bound, plus round-off of 8000 steps.
    assert!(errors.iter().all(|e| e.abs() <= 0.5 + 1e-9));
    let last = errors.len() / 2;
    for part in [&errors[..last], &errors[last..]] {
        assert!(part.iter().any(|e| *e > 0.4) && part.iter().any(|e| *e < -0.4), "{part:?}");
    }
}

/// Without torques the kinetic energy ½ wᵀM(q)w is constant: mass matrix, its inverse and the Coriolis terms
/// agree.
#[test]
fn the_arm_keeps_its_energy() {
    let workshop = Workshop::with_library();
    workshop.write("arm-plant.toml", example("arm-plant.toml"));
    workshop.punctual(["build", "arm-plant.toml", "-o", "arm-plant.fmu"]).success();
    let alone = "experiment = { stop_time = 4.0, step = 0.01 }\n[[component]]\nname = \"plant\"\n\
                 fmu = \"arm-plant.fmu\"\nstart = { \"x0.w_1\" = 1.0, \"x0.w_2\" = -3.0, \
                 \"u.tau_1\" = 0.0, \"u.tau_2\" = 0.0 }\n";
    workshop.write("alone.toml", alone);
    workshop.punctual(["run", "alone.toml", "--out", "out"]).success();
    let table = Table::parse(&workshop.text("out/alone.csv"));
    let [q, w_1, w_2] = ["q_2", "w_1", "w_2"].map(|name| table.column(&format!("plant.x.{name}")));
    let energy: Vec<f64> = (0..q.len())
        .map(|k| {
            let coupling = 0.9 + 1.1 * q[k].cos();
            let first = 3.2 + 0.9 + 2.0 * 1.1 * q[k].cos();
            0.5 * (first * w_1[k] * w_1[k] + 2.0 * coupling * w_1[k] * w_2[k] + 0.9 * w_2[k] * w_2[k])
        })
        .collect();
    let spread = |values: &[f64]| {
        let of = |pick: fn(f64, f64) -> f64| values.iter().copied().reduce(pick).expect("rows");
        of(f64::max) - of(f64::min)
    };
    // The tolerance covers the error of the Runge–Kutta method with steps of 1 ms.
    assert!(spread(&energy) < 1e-8, "{} of {}", spread(&energy), energy[0]);
    assert!(spread(&w_1) > 1.0, "nothing is exchanged between the joints");
}

/// Runs the example `stem`; returns the rows of its barriers, whose promises must all be kept.
fn rows(stem: &str) -> Vec<String> {
    let workshop = Workshop::with_library();
    for kind in ["-filter", "-plant", ""] {
        let name = format!("{stem}{kind}.toml");
        workshop.write(&name, example(&name));
    }
    let (filter, plant) = (format!("{stem}-filter.toml"), format!("{stem}-plant.toml"));
    // `check` runs with u_ref = 0, which not all examples use.
    let printed = workshop.punctual(["check", &filter, "--plant", &plant, "--json"]).stdout;
    let printed: serde_json::Value = serde_json::from_str(&printed).expect("JSON");
    for toml in [&filter, &plant] {
        workshop.punctual(["build", toml, "-o", &toml.replace(".toml", ".fmu")]).success();
    }
    workshop.punctual(["run", &format!("{stem}.toml"), "--out", "out", "--require", "kept"]).success();
    let table = Table::parse(&workshop.text(&format!("out/{stem}.csv")));
    assert!(
        // Unchanged, filtered, or from a plan (8).
        table.column("filter.status").iter().all(|s| *s <= 1.0 || *s == 8.0),
        "{stem}: a constraint was not satisfied"
    );
    let text = workshop.text(&filter);
    let mut expressions =
        text.lines().filter_map(|line| line.strip_prefix("expression = \"")?.split('"').next());
    let time = table.column("time");
    let mut rows = Vec::new();
    for barrier in printed["barriers"].as_array().expect("barriers") {
        let name = barrier["name"].as_str().expect("a name");
        let (degree, unit) = (&barrier["relative_degree"], barrier["unit"].as_str().expect("a unit"));
        let given = barrier["deadline"].as_f64();
        let deadline = given.unwrap_or(0.0);
        let expression = expressions.next().expect("an expression");
        let h = table.column(&format!("filter.{name}.h"));
        let arrival = (0..h.len()).find(|k| h[*k] >= 0.0).map(|k| time[k]).expect("an arrival");
        let least = (0..h.len()).filter(|k| time[*k] >= deadline).map(|k| h[k]).fold(f64::INFINITY, f64::min);
        assert!(arrival <= deadline && least >= 0.0, "{stem}, {name}: at {arrival} s, down to {least}");
        let end = time.last().expect("rows");
        assert!(*end >= 2.0 * deadline, "{stem} ends at {end} s");
        let shown = given.map_or_else(|| "–".to_owned(), |deadline| format!("{deadline} s"));
        rows.push(format!(
            "| `{stem}` | {name} | `{expression}` | {degree} | {shown} | {arrival:.2} s | {least:.3} {unit} |"
        ));
    }
    rows
}

#[test]
fn the_models_keep_their_promises_with_the_figures_of_the_page() {
    let text = document("models.md");
    let stems = ["jerk-car", "cruise", "lagging-unicycle", "quadrotor", "arm", "integrators"];
    let found: Vec<String> = stems.iter().flat_map(|stem| rows(stem)).collect();
    let found = found.join("\n");
    assert!(text.contains(&found), "docs/models.md should have\n{found}");
}

/// A plant that falls over on its own, from a file. It is promised, and kept whether u_ref pushes either way
/// or not at all.
#[test]
fn the_pole_stays_up_whatever_is_wanted() {
    let workshop = Workshop::with_library();
    for kind in ["filter", "plant"] {
        let name = format!("cart-pole-{kind}.toml");
        workshop.write(&name, example(&name));
        workshop.punctual(["build", &name, "-o", &name.replace(".toml", ".fmu")]).success();
    }
    let system = String::from_utf8(example("cart-pole.toml")).expect("text");
    for push in ["-30.0", "30.0", "0.0"] {
        workshop.write("system.toml", system.replace("-30.0", push));
        workshop.punctual(["run", "system.toml", "--out", "out", "--require", "kept"]).success();
        let table = Table::parse(&workshop.text("out/system.csv"));
        let (time, x, theta) =
            (table.column("time"), table.column("plant.x.x"), table.column("plant.x.theta"));
        assert!(theta.iter().all(|theta| theta.abs() <= 0.5), "{push} N");
        assert!(time.iter().zip(x).all(|(t, x)| *t < 3.0 || (x - 2.0).abs() <= 0.2), "{push} N");
        assert!(table.column("filter.assurance").iter().all(|standing| *standing == 1.0), "{push} N");
    }
}
