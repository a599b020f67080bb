//! `punctual identify`: from a recording or a plant to lines of a filter's file, and what `run` says of a plant that is not the model.

use serde_json::Value;

use crate::workshop::{Workshop, assert_golden};

/// The car of docs/mismatch.md.
const CAR: &str = r#"kind = "filter"
plant.model = "unicycle"
bounds = { a = [-4.0, 4.0], omega = [-1.5, 1.5] } # m/s2, rad/s

[[barrier]]
name = "goal"
centre = [15.0, 5.0] # m
radius = 2.0         # m
deadline = 8.0       # s

[[barrier]]
name = "rock"
shape = "obstacle"
centre = [9.0, 2.0] # m
radius = 1.5        # m

[x0]
v = 1.5 # m/s

[experiment]
stop_time = 12.0 # s
step_size = 0.02 # s
"#;

/// The real one: a motor follows what is asked in 50 ms, and a tenth of it is missing.
const REAL: &str = r#"kind = "plant"
x0 = { v = 1.5 }

[plant]
states = [
    { name = "x_p", unit = "m" },
    { name = "y_p", unit = "m" },
    { name = "theta", unit = "rad" },
    { name = "v", unit = "m/s" },
    { name = "motor", unit = "m/s2" },
]
inputs = [{ name = "a", unit = "m/s2" }, { name = "omega", unit = "rad/s" }]
parameters = [{ name = "tau", start = 0.05, unit = "s" }]

[plant.derivatives]
x_p = "v * cos(theta)"
y_p = "v * sin(theta)"
theta = "omega"
v = "0.9 * motor"
motor = "(a - motor) / tau"
"#;

/// It drives straight ahead, into the rock.
const CONTROLLER: &str = "kind = \"controller\"\ncontroller = \"expressions\"\nplant.model = \"unicycle\"\n\
                          u_ref = { a = \"3 - v\", omega = \"0\" }\n";

fn system(filter: &str) -> String {
    let component = |name: &str, file: &str| format!("[[component]]\nname = \"{name}\"\nfmu = \"{file}\"\n");
    let connected = |a: &str, b: &str| format!("[[connect_by_name]]\ncomponents = [\"{a}\", \"{b}\"]\n");
    [
        "[experiment]\nstop_time = 12.0\nstep = 0.02\n".to_owned(),
        component("filter", filter),
        component("plant", "real.toml"),
        component("controller", "controller.toml"),
        connected("filter", "plant"),
        connected("controller", "plant"),
        connected("controller", "filter"),
    ]
    .concat()
}

fn workshop() -> Workshop {
    let workshop = Workshop::new();
    workshop.write("car.toml", CAR);
    workshop.write("real.toml", REAL);
    workshop.write("controller.toml", CONTROLLER);
    workshop.write("system.toml", system("car.toml"));
    workshop
}

/// From a promise that is lost to one that is guaranteed at every sample: all of docs/mismatch.md.
#[test]
fn what_is_identified_makes_the_promise_hold() {
    let workshop = workshop();
    // Without it, the promise is lost, and the run says why.
    let lost = workshop.punctual(["run", "system.toml", "--out", "lost"]);
    assert_eq!(lost.code, 1, "{lost:#?}");
    let note = lost.stderr.lines().find(|line| line.contains("the plant is not the model:")).expect("a note");
    assert!(note.contains(" s of lag on a would explain "), "{note}");
    assert!(note.ends_with("`punctual identify car.toml lost/system.csv` says what to declare"), "{note}");
    // With the table of that run, and with the plant itself.
    let found = workshop.punctual(["identify", "car.toml", "lost/system.csv"]);
    assert_eq!((found.code, found.stderr.as_str()), (0, ""), "{found:#?}");
    let words = ["identify", "car.toml", "real.toml", "--write", "declared.toml", "--record", "real.csv"];
    let excited = workshop.punctual(words);
    assert!(excited.stderr.contains("note: car.toml with these lines is in declared.toml\n"), "{excited:#?}");
    let excited = excited.success();
    assert_golden("identify.txt", &excited);
    let lines =
        |text: &str| text.lines().filter(|line| line.contains(" = ")).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(lines(&found.stdout), lines(&excited));
    // The recording that was written says the same.
    assert_eq!(workshop.punctual(["identify", "car.toml", "real.csv"]).success(), excited);
    // It is promised, and kept at every sample.
    let checked = workshop.punctual(["check", "declared.toml"]).success();
    assert!(checked.contains("\ncovers: gain of a 0.88 to 0.92; lag of a 0.0399 to 0.0601 s\n"), "{checked}");
    assert!(checked.contains("guaranteed until "), "{checked}");
    workshop.write("system.toml", system("declared.toml"));
    let kept = workshop.punctual(["run", "system.toml", "--require", "guaranteed"]);
    assert_eq!(kept.code, 0, "{kept:#?}");
    assert!(!kept.stderr.contains("is lost"), "{kept:#?}");
}

/// The cart of docs/mismatch.md, whose mass is known within an interval: guaranteed at every sample for carts in it, and one
/// far outside is noticed.
#[test]
fn a_parameter_within_an_interval_is_a_state_with_an_error() {
    let page = include_str!("../../docs/mismatch.md");
    let (_, block) = page.split_once("## A parameter within an interval").expect("the section");
    let file = block.split("```toml\n").nth(1).and_then(|block| block.split("```").next()).expect("a file");
    let workshop = Workshop::new();
    workshop.write("filter.toml", file);
    let plant = "kind = \"plant\"\n[plant]\n\
                 states = [{ name = \"x\", unit = \"m\" }, { name = \"v\", unit = \"m/s\" }]\n\
                 inputs = [{ name = \"force\", unit = \"N\" }]\n\
                 parameters = [{ name = \"c\", start = 0.5, unit = \"kg/s\" }, { name = \"m\", start = 2.0, unit = \"kg\" }]\n\
                 derivatives = { x = \"v\", v = \"(force - c * v) / m\" }\n";
    workshop.write("plant.toml", plant);
    let run = |mass: f64| {
        let system = format!(
            "[experiment]\nstop_time = 8.0\nstep = 0.02\n\
             [[component]]\nname = \"filter\"\nfmu = \"filter.toml\"\nstart = {{ \"x.m\" = 2.0 }}\n\
             [[component]]\nname = \"plant\"\nfmu = \"plant.toml\"\nstart = {{ m = {mass:?} }}\n\
             [[connect_by_name]]\ncomponents = [\"filter\", \"plant\"]\n\
             [[connection]]\nfrom = \"plant.x.v\"\nto = \"filter.u_ref.force\"\nfactor = -1.0\noffset = 4.0\n"
        );
        workshop.write("system.toml", system);
        workshop.punctual(["run", "system.toml", "--require", "guaranteed", "--out", "out"])
    };
    for mass in [1.86, 1.93, 2.0, 2.14] {
        let kept = run(mass);
        assert_eq!(kept.code, 0, "{mass} kg: {kept:#?}");
    }
    let lost = run(2.6);
    assert_eq!(lost.code, 1, "{lost:#?}");
    assert!(lost.stderr.contains("farther from the plan than the declared uncertainty allows"), "{lost:#?}");
}

/// The same lines from the FMU, whose variables may have names of their own.
#[test]
fn an_fmu_is_excited() {
    let workshop = Workshop::with_library();
    workshop.write("car.toml", CAR);
    workshop.write("real.toml", REAL.replace("x_p", "east").replace("theta", "course"));
    workshop.punctual(["build", "real.toml", "-o", "real.fmu"]).success();
    workshop.punctual(["identify", "car.toml", "real.fmu"]).fails_like(
        2,
        "variable x_p: the FMU has no \"x.x_p\" or \"x_p\"; it has x.east, ",
        &["--column x_p=VARIABLE"],
    );
    let words = [
        "identify",
        "car.toml",
        "real.fmu",
        "--column",
        "x_p=x.east",
        "--column",
        "theta=x.course",
        "--json",
    ];
    let report: Value = serde_json::from_str(&workshop.punctual(words).success()).expect("JSON");
    let findings = report["findings"].as_array().expect("a list");
    let kinds: Vec<_> = findings.iter().map(|f| (&f["kind"], &f["name"])).collect();
    assert_eq!(kinds, [(&"lag".into(), &"a".into()), (&"gain".into(), &"a".into())], "{report:#}");
    assert_eq!((&report["explained"], &report["holds"]), (&1000.into(), &1000.into()));
    let lag =
        findings[0]["declared"].as_array().and_then(|ends| Some([ends[0].as_f64()?, ends[1].as_f64()?]));
    assert!(
        lag.is_some_and(|[least, most]| least < 0.05 && most > 0.05 && most - least < 0.03),
        "{report:#}"
    );
}

#[test]
fn a_plant_that_is_the_model_needs_nothing() {
    let workshop = Workshop::new();
    workshop.write("car.toml", CAR);
    workshop.write("same.toml", "kind = \"plant\"\nplant.model = \"unicycle\"\nx0 = { v = 1.0 }\n");
    let text = workshop.punctual(["identify", "car.toml", "same.toml"]).success();
    assert!(
        text.starts_with(
            "# nothing to declare\n\n1000 holds of 0.02 s, 20 s in all. The plant is the model, "
        ),
        "{text}"
    );
    // Nothing is lost in a run either.
    workshop.write("car.toml", CAR.replace("[x0]", "[u_ref]\na = \"0\"\nomega = \"0\"\n[x0]"));
    let run = workshop.punctual(["run", "car.toml"]);
    assert!(run.code == 0 && !run.stderr.contains("is not the model"), "{run:#?}");
}

/// Recordings of other tools: names of their own, units, inputs that hardly move.
#[test]
fn recordings_of_others_are_read() {
    let workshop = Workshop::new();
    let filter = "kind = \"filter\"\nexperiment.step_size = 0.05\n[plant]\nstates = [{ name = \"v\", unit = \"m/s\" }]\n\
                  inputs = [{ name = \"a\", unit = \"m/s2\", min = -4.0, max = 4.0 }]\nderivatives = { v = \"a\" }\n\
                  [[barrier]]\nname = \"slow\"\nexpression = \"5 - v\"\nunit = \"m/s\"\n";
    workshop.write("train.toml", filter);
    // 0.2 m/s2 are missing, the speed is in km/h, and the input uses a twentieth of its bounds.
    let (mut v, mut text) = (1.0, "t;speed;throttle\ns;km/h;m/s2\n".to_owned());
    for k in 0..300 {
        let a = if k % 40 < 20 { 0.4 } else { 0.0 };
        text += &format!("{};{};{a}\n", 0.05 * f64::from(k), 3.6 * v);
        v += 0.05 * (a - 0.2);
    }
    workshop.write("train.csv", &text);
    let words = ["identify", "train.toml", "train.csv", "--column", "v=speed", "--column", "a=throttle"];
    let found = workshop.punctual(words);
    assert!(found.stderr.contains("note: speed: converted from km/h to m/s\n"), "{found:#?}");
    assert!(found.stderr.contains("warning: a used 5 % of its bounds: "), "{found:#?}");
    assert!(found.stdout.contains("\nuncertainty.rates.v = 0.24 # m/s2; found 0.2 "), "{found:#?}");
    assert!(found.stdout.contains("-0.2 m/s2 added to the rate of v would explain "), "{found:#?}");
    let exact = workshop.punctual(words.into_iter().chain(["--factor", "1"])).success();
    assert!(exact.contains("\nuncertainty.rates.v = 0.2"), "{exact}");
    // An input that never moves tells nothing.
    let still =
        text.lines().map(|line| line.rsplit_once(';').map_or(line.to_owned(), |(l, _)| format!("{l};0")));
    let still =
        still.collect::<Vec<_>>().join("\n").replacen(";0", ";throttle", 1).replacen(";0", ";m/s2", 1);
    workshop.write("train.csv", still);
    let done = workshop.punctual(words);
    assert!(done.stderr.contains("warning: a never moved: nothing is known of its gain"), "{done:#?}");
}

#[test]
fn what_cannot_be_identified_is_refused() {
    let workshop = workshop();
    workshop.write("short.csv", "time,x_p,y_p,theta,v,a,omega\n0,0,0,0,1,0,0\n0.02,0.02,0,0,1,0,0\n");
    workshop.write("other.csv", "time,x_p,y_p,theta,speed,a,omega\n0,0,0,0,1,0,0\n");
    workshop.write("wrong.csv", "time,x_p\n0,oops,1\n");
    let fails =
        |words: &[&str], message: &str| workshop.punctual(["identify"].iter().chain(words)).fails(2, message);
    fails(
        &["car.toml", "short.csv"],
        "short.csv: recording: has 1 holds between samples, must have at least 20",
    );
    workshop.punctual(["identify", "car.toml", "other.csv"]).fails_like(
        2,
        "other.csv: column v: is missing: the state v of the model is looked for as ",
        &["--column v=COLUMN"],
    );
    fails(&["car.toml", "wrong.csv"], "wrong.csv: line 2: has 3 fields, must have 2 as line 1 has");
    fails(
        &["car.toml", "short.csv", "--column", "speed"],
        "--column: is \"speed\", must be like \"v=speed\"",
    );
    fails(
        &["car.toml", "short.csv", "--column", "w=v"],
        "short.csv: --column: \"w\" is no state or input, must be one of x_p, y_p, theta, v, a, omega",
    );
    fails(
        &["car.toml", "real.toml", "--factor", "0.5"],
        "--factor: is 0.5, must be 1 to 100: 1 declares what the recording shows, and no more",
    );
    fails(
        &["car.toml", "real.toml", "--duration", "1e9"],
        "--duration: is 1000000000 s, which is 5e10 steps of 0.02 s, must be 20 to 20000 steps",
    );
    fails(
        &["car.toml", "real.toml", "short.csv"],
        "PLANT: are 2 files; must be one FMU, or recordings alone",
    );
    fails(
        &["car.toml", "short.csv", "--record", "x.csv"],
        "--record: is for an FMU; this is a recording already",
    );
    fails(
        &["car.toml", "real.toml", "--write", "real.toml"],
        "--write: real.toml already exists; name another file, or remove that one",
    );
    fails(
        &["real.toml", "short.csv"],
        "real.toml: kind: is \"plant\", must be \"filter\": its model is compared with the plant",
    );
    workshop.write("free.toml", CAR.replace(", omega = [-1.5, 1.5]", ""));
    fails(
        &["free.toml", "real.toml"],
        "bounds.omega: has no bounds, between which the plant could be excited; give [min, max]",
    );
    workshop.write("declared.toml", CAR.replace("[x0]", "[measurement_errors]\nv = 0.1\n[x0]"));
    fails(
        &["declared.toml", "real.toml", "--write", "x.toml"],
        "--write: declared.toml has `measurement_errors` already, and nothing is written over it; remove it, or paste the lines yourself",
    );
    let external = Workshop::with_external();
    external.write("short.csv", "t,a\n0,0\n");
    external.punctual(["identify", "external.toml", "short.csv"]).fails_like(
        2,
        "external.toml: plant: has inputs alone, since ",
        &["without a model nothing can be compared"],
    );
}
