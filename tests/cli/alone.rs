//! Everything from one file: a new file is checked and run; a filter's file is a system of its own; systems
//! accept configurations in place of FMUs.

use std::fs;

use serde_json::Value;

use crate::html::{body, cells, data};
use crate::table::Table;
use crate::workshop::{Workshop, examples};

/// A filter with everything that a run of its file needs.
const CAR: &str = r#"
kind = "filter"
plant.model = "unicycle"
bounds = { a = [-4.0, 4.0], omega = [-2.0, 2.0] }
x0 = { theta = -1.0, v = 1.0 }
u_ref = { a = "-0.3 * v", omega = "0.5 * cos(t)" }
experiment = { stop_time = 3.0, step_size = 0.02 }

[[barrier]]
name = "goal"
centre = [8.0, 4.0]
radius = 2.0
deadline = 6.0

[[barrier]]
name = "tree"
shape = "obstacle"
centre = [5.0, 7.0]
radius = 2.0
"#;

/// A wall that must be kept, and a controller that drives towards it, or away from it.
#[test]
fn a_run_says_how_much_of_u_ref_was_changed() {
    let workshop = Workshop::new();
    let file = "kind = \"filter\"\nx0 = { x = 0.0 }\nu_ref = { u = \"WANTED\" }\n\
                experiment = { stop_time = 3.0, step_size = 0.02 }\n\
                [plant]\nstates = [{ name = \"x\" }]\ninputs = [{ name = \"u\", min = -2.0, max = 2.0 }]\n\
                derivatives = { x = \"u\" }\n[[barrier]]\nname = \"wall\"\nexpression = \"1 - x\"\n";
    let printed = |wanted: &str, json: &[&str]| {
        workshop.write("my.toml", file.replace("WANTED", wanted));
        workshop.punctual(["run", "my.toml"].into_iter().chain(json.iter().copied())).success()
    };
    let away = printed("-0.5", &[]);
    assert!(away.contains("\nfilter left u_ref as it is at all 151 samples.\nEvery promise"), "{away}");
    // The change is twice the bound. The bounds are 4 apart, so a change of 1 is a quarter.
    let report: Value = serde_json::from_str(&printed("1.0", &["--json"])).expect("JSON");
    let of = &report["interference"][0];
    let [samples, changed] = ["samples", "changed"].map(|key| of[key].as_u64().expect("a number"));
    let [mean, most] = ["mean", "most"].map(|key| of[key].as_f64().expect("a number"));
    // It reaches the wall after 1 s, and stays there.
    assert!(samples == 151 && changed > 75 && changed < 140, "{of}");
    assert!(mean > 0.1 && mean <= most && most <= 0.25 + 1e-9, "{of}");
    assert_eq!(of["filter"], "filter");
    let towards = printed("1.0", &[]);
    let shown = format!("\nfilter changed u_ref at {changed} of 151 samples (");
    assert!(towards.contains(&shown) && towards.contains(" % of the bounds in the mean and "), "{towards}");
}

#[test]
fn a_new_file_is_checked_and_run_and_keeps_its_promise() {
    for model in ["unicycle", "expressions"] {
        let workshop = Workshop::new();
        let done = workshop.punctual(["new", "my.toml", "--model", model]);
        assert_eq!(done.stderr, "next: `punctual check my.toml`, then `punctual run my.toml`\n");
        assert_eq!(done.success(), "written: my.toml\n");
        let checked = workshop.punctual(["check", "my.toml"]).success();
        assert!(checked.contains("with the u_ref of the file"), "{checked}");
        assert!(checked.contains("\nbackup plan: found"), "{checked}");
        let ran = workshop.punctual(["run", "my.toml", "--require", "kept"]).success();
        assert!(ran.contains("written: my/my.csv"), "{ran}");
        let inputs = if model == "unicycle" { &["u-a", "u-omega", "path"][..] } else { &["u-F", "h-2"] };
        for picture in inputs.iter().chain(&["h"]) {
            let text = workshop.text(&format!("my/my-{picture}.svg"));
            assert!(text.starts_with("<svg") || text.starts_with("<?xml"), "{picture}");
        }
        workshop.punctual(["build", "my.toml", "-o", "my.fmu"]).success();
        workshop
            .punctual(["new", "my.toml"])
            .fails(2, "FILE: my.toml already exists; name another file, or remove that one");
    }
    Workshop::new().punctual(["new", "my.fmu"]).fails(2, "FILE: is \"my.fmu\", must end in .toml");
}

#[test]
fn a_new_file_for_an_fmu_runs_with_one() {
    let workshop = Workshop::new();
    workshop.punctual(["new", "cart.toml", "--model", "fmu"]).success();
    assert_eq!(workshop.files(), ["cart-filter.toml", "cart.toml"]);
    // The plant of another tool, with the names used in the template.
    let plant = "kind = \"plant\"\n[plant]\nstates = [{ name = \"position\", unit = \"m\" }, { name = \"speed\", unit = \"m/s\" }]\n\
                 inputs = [{ name = \"force\", unit = \"N\" }]\n[plant.derivatives]\nposition = \"speed\"\n\
                 speed = \"(force - 0.5 * speed) / 4\"\n";
    workshop.write("cart-plant.toml", plant);
    workshop.punctual(["build", "cart-plant.toml", "-o", "cart-plant.fmu"]).success();
    let text = workshop.text("cart.toml");
    assert!(text.contains("feedthrough = false"), "the plant's outputs follow in steps");
    let text = text.replace("plant.position", "plant.x.position").replace("plant.speed", "plant.x.speed");
    workshop.write("cart.toml", text.replace("plant.force", "plant.u.force"));
    workshop.punctual(["run", "cart.toml", "--out", "out", "--require", "kept"]).success();
}

#[test]
fn a_report_has_the_verdicts_and_the_numbers_of_the_run() {
    let workshop = Workshop::new();
    workshop.write("car.toml", CAR.replace("stop_time = 3.0", "stop_time = 8.0"));
    let printed = workshop.punctual(["run", "car.toml", "--report", "--json"]).success();
    let printed: Value = serde_json::from_str(&printed).expect("JSON");
    let files: Vec<_> =
        printed["files"].as_array().expect("files").iter().filter_map(Value::as_str).collect();
    assert_eq!(files.last(), Some(&"car/car.html"), "{files:?}");
    let page = workshop.text("car/car.html");
    // The SVG namespace is not an address that is requested.
    assert!(!page.replace("http://www.w3.org/2000/svg", "").contains("http"), "an address");
    // The verdicts are the printed ones.
    let tree = body(&page);
    let rows = cells(&tree);
    for promise in printed["promises"].as_array().expect("promises") {
        let name = promise["barrier"].as_str().and_then(|name| name.strip_prefix("filter.")).expect("a name");
        let row = rows.iter().find(|row| row[0] == name).unwrap_or_else(|| panic!("no {name} in {rows:?}"));
        assert_eq!((promise["promise"].as_str(), row[1].as_str()), (Some("kept"), "kept"));
        assert_eq!(row[2], "guaranteed");
    }
    let brake = rows.iter().find(|row| row[0] == "a").expect("the input");
    assert_eq!(brake[4..6], ["-4", "4"]);
    // Every chart has a place, and every barrier a curve, with the extremes of the recording.
    let charts = data(&page, "charts");
    let charts = charts.as_array().expect("charts");
    let is_place = |key: &Value| tree.descendants().any(|node| node.attribute("data-chart") == key.as_str());
    assert!(charts.iter().all(|chart| is_place(&chart[0])));
    let curves = || charts.iter().flat_map(|chart| chart[1]["curves"].as_array().expect("curves"));
    let table = Table::parse(&workshop.text("car/car.csv"));
    for barrier in ["goal", "tree"] {
        let h = curves().find(|curve| curve["label"] == barrier).expect("a curve");
        let drawn =
            h["y"].as_array().expect("values").iter().filter_map(Value::as_f64).fold(f64::INFINITY, f64::min);
        let least = table.column(&format!("filter.{barrier}.h")).into_iter().fold(f64::INFINITY, f64::min);
        // Each value keeps seven digits.
        assert!((drawn - least).abs() <= 1e-6 * least.abs(), "{barrier}: {drawn}, not {least}");
    }
    let scene = data(&page, "scene");
    let names: Vec<_> = scene["outlines"].as_array().expect("outlines").iter().map(|o| &o["label"]).collect();
    assert_eq!(names, ["goal", "tree"]);
    let words: Vec<_> =
        scene["strips"][0][1]["words"].as_array().expect("words").iter().map(|w| &w[0]).collect();
    assert!(words.contains(&&Value::from("backup")), "{words:?}");
}

/// Shapes of every kind, a moving one, and names that need escaping.
#[test]
fn a_report_draws_what_has_an_outline_and_escapes_names() {
    let workshop = Workshop::new();
    let barrier = |name: &str, keys: &str| format!("[[barrier]]\nname = \"{name}\"\n{keys}\n");
    let filter = CAR.replace("centre = [8.0, 4.0]", "centre = [8.0, 4.0]\nvelocity = [0.25, 0.0]")
        + &barrier(
            "hall",
            "shape = \"rectangle\"\ncentre = [0.0, 0.0]\nhalf_sides = [40.0, 20.0]\nangle = 0.5",
        )
        + &barrier("pond", "shape = \"elliptic_obstacle\"\ncentre = [-9.0, 9.0]\nhalf_axes = [3.0, 1.0]")
        + &barrier("wall", "shape = \"half_plane\"\ncentre = [0.0, -15.0]\nnormal = [0.0, 2.0]")
        + &barrier("slow", "shape = \"speed_limit\"\nbound = 9.0");
    workshop.write("filter.toml", filter);
    workshop.write("plant.toml", "kind = \"plant\"\nplant.model = \"unicycle\"\nx0.v = 1.0\n");
    let name = "<!--<script>alert(1)</script>";
    let system = format!(
        "[experiment]\nstop_time = 2.0\nstep = 0.02\n[[component]]\nname = \"filter\"\nfmu = \"filter.toml\"\n\
         [[component]]\nname = {name:?}\nfmu = \"plant.toml\"\n[[connect_by_name]]\ncomponents = [\"filter\", {name:?}]\n"
    );
    workshop.write("system.toml", system);
    workshop
        .punctual(["run", "system.toml", "--report"])
        .fails(2, "--report: needs a folder for its page; add --out DIR");
    workshop.punctual(["run", "system.toml", "--report", "--out", "out"]).success();
    let page = workshop.text("out/system.html");
    assert_eq!((page.matches("<script").count(), page.matches("<!--").count()), (1, 0));
    let tree = body(&page);
    assert!(tree.descendants().any(|node| node.text() == Some(name)), "the name as it is");
    let scene = data(&page, "scene");
    assert_eq!(scene["vehicles"][0]["label"], name);
    let outline = |name: &str| {
        let found = scene["outlines"].as_array().expect("outlines").iter().find(|o| o["label"] == name);
        found.unwrap_or_else(|| panic!("no {name}")).clone()
    };
    let numbers = |list: &Value| -> Vec<f64> {
        list.as_array().expect("numbers").iter().filter_map(Value::as_f64).collect()
    };
    // A disc moves 0.25 m/s · 2 s; at each corner of the others h is 0.
    assert_eq!(numbers(&outline("goal")["centre"][1]), [8.0, 8.5]);
    let corners = |name: &str| -> Vec<[f64; 2]> {
        let corner = |c: &Value| [c[0].as_f64().expect("x"), c[1].as_f64().expect("y")];
        outline(name)["rings"][0].as_array().expect("a ring").iter().map(corner).collect()
    };
    // Each coordinate keeps seven digits.
    for [x, y] in corners("pond") {
        assert!(((x / 3.0).powi(2) + y.powi(2) - 1.0).abs() < 1e-5, "{x}, {y}");
    }
    let (sin, cos) = 0.5_f64.sin_cos();
    for [x, y] in corners("hall") {
        let (along, across) = (cos * x + sin * y, cos * y - sin * x);
        assert!(((along / 40.0).powi(4) + (across / 20.0).powi(4) - 1.0).abs() < 1e-5, "{x}, {y}");
    }
    let above = corners("wall");
    assert!(
        above.iter().all(|c| c[1] >= 0.0) && above.iter().filter(|c| c[1] == 0.0).count() == 2,
        "{above:?}"
    );
    assert_eq!(scene["outlines"].as_array().map(Vec::len), Some(5), "a speed limit has none");
    // The picture shows the barriers that do not move, with one legend entry for all obstacles.
    let picture = workshop.text("out/system-path.svg");
    for (word, is_there) in
        [("hall", true), ("wall", true), ("obstacle", true), ("goal", false), ("pond", false)]
    {
        assert_eq!(
            picture.contains(&format!(">{word}<")) || picture.contains(&format!("\n{word}\n")),
            is_there,
            "{word}"
        );
    }
}

/// A point among sets given by expressions, with a number that the system file changes.
#[test]
fn an_expression_of_the_place_has_an_outline() {
    let workshop = Workshop::new();
    let plant = "[plant]\nstates = [{ name = \"x\", unit = \"m\" }, { name = \"y\", unit = \"m\" }]\n\
                 inputs = [{ name = \"vx\", unit = \"m/s\" }, { name = \"vy\", unit = \"m/s\" }]\n\
                 derivatives = { x = \"vx\", y = \"vy\" }\n\
                 parameters = [{ name = \"r\", start = 1.0, min = 0.1, unit = \"m\" }, { name = \"w\", start = 0.1, unit = \"m/s\" }]\n";
    let barrier = |name: &str, expression: &str| {
        format!("[[barrier]]\nname = \"{name}\"\nexpression = \"{expression}\"\nunit = \"m2\"\n")
    };
    let filter = format!("kind = \"filter\"\n{plant}")
        + &barrier("goal", "r^2 - (x - 3)^2 - y^2")
        + "deadline = 1.5\n"
        + &barrier("rock", "(x - 2)^2 + 4 * (y - 4)^2 - 1")
        + &barrier("wall", "9 * (y + 3)")
        + &barrier("gate", "100 - (x + w * t)^2");
    workshop.write("filter.toml", filter);
    workshop.write("plant.toml", format!("kind = \"plant\"\n{plant}"));
    let system = "[experiment]\nstop_time = 2.0\nstep = 0.01\n[[component]]\nname = \"filter\"\nfmu = \"filter.toml\"\n\
                  start = { r = 1.5 }\n[[component]]\nname = \"plant\"\nfmu = \"plant.toml\"\n\
                  [[connect_by_name]]\ncomponents = [\"filter\", \"plant\"]\n";
    workshop.write("system.toml", system);
    workshop.punctual(["run", "system.toml", "--report", "--out", "out"]).success();
    let page = workshop.text("out/system.html");
    assert!(page.contains("Without an outline, for more than the place is in them: gate."), "the gate moves");
    let scene = data(&page, "scene");
    let outlines = scene["outlines"].as_array().expect("outlines");
    assert_eq!(outlines.iter().map(|o| &o["label"]).collect::<Vec<_>>(), ["wall", "goal", "rock"]);
    assert_eq!(outlines.iter().map(|o| &o["obstacle"]).collect::<Vec<_>>(), [false, false, true]);
    let corners = |k: usize| -> Vec<[f64; 2]> {
        let rings = outlines[k]["rings"].as_array().expect("rings");
        assert_eq!(rings.len(), 1);
        let corner = |c: &Value| [c[0].as_f64().expect("x"), c[1].as_f64().expect("y")];
        rings[0].as_array().expect("corners").iter().map(corner).collect()
    };
    // Along a straight line between two points, h curves by less than 0.1 m, the square of a cell. A set
    // beside the path is drawn completely.
    for [x, y] in corners(1) {
        assert!((1.5_f64.powi(2) - (x - 3.0).powi(2) - y.powi(2)).abs() < 0.1_f64.powi(2), "{x}, {y}");
    }
    for [x, y] in corners(2) {
        assert!(
            ((x - 2.0).powi(2) + 4.0 * (y - 4.0).powi(2) - 1.0).abs() < 4.0 * 0.1_f64.powi(2),
            "{x}, {y}"
        );
    }
    // The wall is unbounded, so the part of it inside the square around the path is drawn, with h = 0 along
    // one edge.
    let lowest = corners(0).into_iter().map(|[_, y]| y).fold(f64::INFINITY, f64::min);
    assert!((lowest + 3.0).abs() < 1e-5, "{lowest}");
    let picture = workshop.text("out/system-path.svg");
    assert_eq!(picture.matches("evenodd").count(), 3);
}

#[test]
fn a_file_alone_is_its_filter_and_plant_coupled() {
    let workshop = Workshop::new();
    workshop.write("car.toml", CAR);
    workshop.punctual(["run", "car.toml", "--out", "alone"]).success();
    // The same by hand, once with FMUs and once with their configurations.
    let experiment = "[experiment]\nstop_time = 3.0\nstep_size = 0.02\n";
    workshop.write(
        "plant.toml",
        format!(
            "kind = \"plant\"\nplant.model = \"unicycle\"\nx0 = {{ theta = -1.0, v = 1.0 }}\n{experiment}"
        ),
    );
    let u_ref = "u_ref = { a = \"-0.3 * v\", omega = \"0.5 * cos(t)\" }\n";
    workshop.write(
        "controller.toml",
        format!(
            "kind = \"controller\"\ncontroller = \"expressions\"\nplant.model = \"unicycle\"\n{u_ref}{experiment}"
        ),
    );
    let mut system = "[experiment]\nstop_time = 3.0\nstep = 0.02\n".to_owned();
    for (name, file) in [("filter", "car"), ("plant", "plant"), ("controller", "controller")] {
        system += &format!("[[component]]\nname = \"{name}\"\nfmu = \"{file}.toml\"\n");
        workshop.punctual(["build", &format!("{file}.toml"), "-o", &format!("{file}.fmu")]).success();
    }
    for pair in [["filter", "plant"], ["controller", "plant"], ["controller", "filter"]] {
        system += &format!("[[connect_by_name]]\ncomponents = {pair:?}\n");
    }
    workshop.write("files.toml", &system);
    workshop.write("fmus.toml", system.replace(".toml\"", ".fmu\""));
    for name in ["files", "fmus"] {
        workshop.punctual(["run", &format!("{name}.toml"), "--out", "out"]).success();
        assert!(
            workshop.bytes(&format!("out/{name}.csv")) == workshop.bytes("alone/car.csv"),
            "{name}: other numbers"
        );
    }
    // The keys of the run are not part of the FMU.
    let alone = CAR.lines().filter(|line| !line.starts_with("x0") && !line.starts_with("u_ref"));
    workshop.write("filter.toml", alone.collect::<Vec<_>>().join("\n"));
    workshop.punctual(["build", "filter.toml", "-o", "filter.fmu"]).success();
    assert!(workshop.bytes("filter.fmu") == workshop.bytes("car.fmu"), "another FMU");
    // An FMU that was not built from the file beside it.
    workshop.write("plant.toml", workshop.text("plant.toml").replace("v = 1.0", "v = 2.0"));
    let done = workshop.punctual(["run", "fmus.toml"]);
    let stale = "note: plant.fmu was not built from the current plant.toml; rebuild it, or name the .toml file in the system\n";
    assert!(done.stderr.contains(stale), "{}", done.stderr);
}

#[test]
fn a_file_alone_has_the_plant_outside_its_integrator() {
    let workshop = Workshop::new();
    for (model, state) in [("bicycle_small_slip_rate", "beta"), ("bicycle_kinematic", "delta")] {
        workshop.write(
            "bicycle.toml",
            format!(
                "kind = \"filter\"\nplant.model = \"{model}\"\nintegrator = {{ state = \"{state}\", min = -0.5, max = 0.5 }}\n\
                 x0.v = 3.0\nu_ref = {{ a = \"1 - v / 4\", {state} = \"0.1\" }}\n\
                 experiment = {{ stop_time = 8.0, step_size = 0.02 }}\n\
                 [[barrier]]\nname = \"goal\"\ncentre = [20.0, 3.0]\nradius = 3.0\ndeadline = 7.0\n"
            ),
        );
        workshop
            .punctual(["run", "bicycle.toml", "--out", "out", "--require", "on_time_and_inside"])
            .success();
        let table = Table::parse(&workshop.text("out/bicycle.csv"));
        let moved = table.column(&format!("plant.u.{state}"));
        assert!(moved.iter().all(|u| u.abs() <= 0.5) && moved.iter().any(|u| u.abs() > 0.01), "{moved:?}");
    }
}

#[test]
fn what_cannot_be_run_alone_is_told() {
    for (from, to, wanted) in [
        (
            "x0 = { theta",
            "x0 = { tetha",
            "car.toml: x0.tetha: unknown state (did you mean theta?), must be one of x_p, y_p, theta, v",
        ),
        (
            "omega = \"0.5 * cos(t)\"",
            "",
            "car.toml: u_ref.omega: missing, every input needs one; \"0\" is one",
        ),
        (
            "-0.3 * v",
            "-0.3 * w",
            "car.toml: u_ref.a: names w, which is unknown; the names are x_p, y_p, theta, v",
        ),
        ("x0 = {", "simulated.model = \"point\"\nx0 = {", "car.toml: simulated.model"),
    ] {
        let workshop = Workshop::new();
        workshop.write("car.toml", CAR.replace(from, to));
        workshop.punctual(["run", "car.toml"]).fails_like(2, wanted, &[]);
    }
    let workshop = Workshop::new();
    workshop.write("external.toml", fs::read(examples().join("../models/external-filter.toml")).unwrap());
    workshop.punctual(["run", "external.toml"]).fails(
        2,
        "external.toml: simulated: missing: of the filter's plant only the inputs are known, so give the plant to simulate",
    );
    workshop.write("plant.toml", "kind = \"plant\"\nplant.model = \"unicycle\"\n");
    workshop.punctual(["run", "plant.toml"]).fails(
        2,
        "plant.toml: kind: is \"plant\"; must be \"filter\", which runs with its own model, or a system file, which couples components",
    );
}

#[test]
fn units_are_the_second_line_where_they_are_asked_for() {
    let workshop = Workshop::new();
    workshop.write("car.toml", CAR.replace("stop_time = 3.0", "stop_time = 0.1"));
    workshop.punctual(["run", "car.toml"]).success();
    let plain = workshop.text("car/car.csv");
    for more in [&["--units"][..], &["--units", "--isolate"]] {
        workshop.punctual([&["run", "car.toml", "--out", "with"], more].concat()).success();
        let with = workshop.text("with/car.csv");
        let (header, rest) = with.split_once('\n').expect("lines");
        let (units, rows) = rest.split_once('\n').expect("lines");
        // Without that line, it is the same as without the option.
        assert_eq!(format!("{header}\n{rows}"), plain);
        let units: Vec<_> = header.split(',').zip(units.split(',')).collect();
        assert_eq!(header.split(',').count(), units.len());
        for (column, unit) in [
            ("time", "s"),
            ("filter.u.a", "m/s2"),
            ("filter.u.omega", "rad/s"),
            ("filter.goal.h", "m"),
            ("plant.x.x_p", "m"),
            ("plant.x.v", "m/s"),
            ("filter.status", ""),
        ] {
            assert!(units.contains(&(column, unit)), "{column} in {unit}: {units:?}");
        }
    }
}

#[test]
fn two_vehicles_in_one_model_avoid_each_other() {
    let workshop = Workshop::new();
    workshop
        .write("two.toml", fs::read(examples().join("../models/two-unicycles.toml")).expect("the example"));
    workshop.punctual(["run", "two.toml", "--require", "on_time_and_inside"]).success();
    let table = Table::parse(&workshop.text("two/two.csv"));
    assert!(table.column("filter.clear.guaranteed").iter().all(|g| *g == 1.0));
    let [xa, ya, xb, yb] = ["xa", "ya", "xb", "yb"].map(|state| table.column(&format!("plant.x.{state}")));
    let near = |k: usize| (xa[k] - xb[k]).hypot(ya[k] - yb[k]);
    let nearest = (0..xa.len()).map(near).fold(f64::INFINITY, f64::min);
    assert!(nearest >= 3.0, "{nearest} m");
}

/// A cart is pushed by a two-thousandth of its bound towards a wall at which it starts, and to which it comes back at full
/// speed: plans that lead to h = 0 exactly are lost.
#[test]
fn the_default_margin_of_an_expression_keeps_a_promise_that_0_loses() {
    const CART: &str = r#"
kind = "filter"
bounds = { F = [-2.0, 2.0] }
x0 = { p = 4.999 }
u_ref = { F = "2 * tanh(50 * (t - 3))" }
experiment = { step_size = 0.02, stop_time = 16.0 }
[plant]
states = [{ name = "p", unit = "m" }, { name = "v", unit = "m/s" }]
inputs = [{ name = "F", unit = "m/s2" }]
derivatives = { p = "v", v = "F" }
[simulated]
states = [{ name = "p", unit = "m" }, { name = "v", unit = "m/s" }]
inputs = [{ name = "F", unit = "m/s2" }]
derivatives = { p = "v", v = "F + 0.001" }
[[barrier]]
name = "wall"
expression = "5 - p"
unit = "m"
"#;
    let workshop = Workshop::new();
    workshop.write("default.toml", CART);
    workshop.write("zero.toml", format!("{CART}margin = 0.0\n"));
    workshop.punctual(["run", "default.toml"]).success();
    let table = Table::parse(&workshop.text("default/default.csv"));
    assert!(table.column("filter.wall.guaranteed").iter().all(|g| *g == 1.0));
    // The wall is approached, and half of the margin stays in reserve.
    let nearest = table.column("filter.wall.h").into_iter().fold(f64::INFINITY, f64::min);
    assert!((0.00025..0.0005).contains(&nearest), "{nearest} m");
    assert_eq!(workshop.punctual(["run", "zero.toml"]).code, 1, "not kept");
    let table = Table::parse(&workshop.text("zero/zero.csv"));
    assert!(table.column("filter.wall.guaranteed").contains(&0.0));
    for (file, wanted) in [("default.toml", "0.0005 m (default)\n"), ("zero.toml", "2e-7 m\n")] {
        let checked = workshop.punctual(["check", file]).stdout;
        assert!(checked.contains(&format!("  margin           {wanted}")), "{checked}");
    }
}

/// Wind, errors and weak inputs, all declared: the promise is kept, and never withdrawn.
#[test]
fn a_vehicle_that_is_not_its_model_keeps_its_promise() {
    let workshop = Workshop::new();
    workshop.write("windy.toml", fs::read(examples().join("windy.toml")).expect("the example"));
    let checked = workshop.punctual(["check", "windy.toml"]).success();
    let covers = "covers: rates theta 0.02 rad/s, v 0.1 m/s2; \
                  measurement errors x_p 0.02 m, y_p 0.02 m, theta 0.01 rad, v 0.02 m/s; \
                  gain of a 0.95 to 1.05; gain of omega 0.95 to 1.05\n";
    assert!(checked.contains(covers), "{checked}");
    workshop.punctual(["run", "windy.toml", "--require", "on_time_and_inside"]).success();
    let table = Table::parse(&workshop.text("windy/windy.csv"));
    for barrier in ["goal", "rock"] {
        let guaranteed = table.column(&format!("filter.{barrier}.guaranteed"));
        assert!(guaranteed.iter().all(|g| *g == 1.0), "{barrier}: {guaranteed:?}");
    }
    // The end of the promise moves on.
    let (time, until) = (table.column("time"), table.column("filter.assured_until"));
    assert!(time.iter().zip(&until).all(|(time, until)| until > time), "{until:?}");
    // A sum of holds is rounded.
    const ROUND_OFF: f64 = 1e-12;
    assert!(until.is_sorted_by(|before, after| *after >= before - ROUND_OFF), "{until:?}");
    assert!(until[0] < time[time.len() - 1], "{until:?}");
}

/// A cyclist whose acceleration alone is known: kept clear of, and the promise moves on with the run.
#[test]
fn a_measured_cyclist_is_kept_clear_of() {
    let workshop = Workshop::new();
    workshop.write("crossing.toml", fs::read(examples().join("crossing.toml")).expect("the example"));
    let checked = workshop.punctual(["check", "crossing.toml"]).success();
    for line in [
        "beside it: acceleration of the centre of cyclist 0.3 m/s2, errors 0.02 m\n",
        "guaranteed until 3 s, whatever u_ref is\n",
        "the plan: until 3 s, however the centres move that it covers; ",
    ] {
        assert!(checked.contains(line), "{checked}");
    }
    workshop.punctual(["run", "crossing.toml", "--require", "guaranteed"]).success();
    let table = Table::parse(&workshop.text("crossing/crossing.csv"));
    // Moved in the run, at the velocity with which it starts.
    let (time, y) = (table.column("time"), table.column("filter.cyclist.centre[2]"));
    assert!(time.iter().zip(&y).all(|(t, y)| (y - (1.6 * t - 7.0)).abs() < 1e-9), "{y:?}");
    let until = table.column("filter.assured_until");
    assert!(time.iter().zip(&until).all(|(time, until)| *until >= time + 1.0), "{until:?}");
}

/// A set that moves forever has no plan that ends at rest. The message names the key that helps.
#[test]
fn a_set_that_moves_asks_for_a_horizon() {
    let workshop = Workshop::new();
    let text = r#"kind = "filter"
[plant]
states = [{ name = "x", unit = "m" }]
inputs = [{ name = "u", unit = "m/s", min = -5.0, max = 5.0 }]
parameters = [{ name = "speed", start = 1.0, unit = "m/s" }]
derivatives = { x = "u" }
[[barrier]]
name = "goal"
expression = "2 - x + speed * t"
deadline = 12.0
"#;
    let reason =
        "goal moves with time, so that no plan ends; with a horizon one may end earlier (`plan_horizon`)";
    workshop.write("moving.toml", text);
    let checked = workshop.punctual(["check", "moving.toml"]).success();
    assert!(checked.contains(&format!("plans: none, since {reason}\n")), "{checked}");
    workshop.write("moving.toml", format!("assurance = \"on\"\n{text}"));
    let message = format!("moving.toml: assurance: is \"on\", must be \"off\": {reason}");
    workshop.punctual(["check", "moving.toml"]).fails(2, &message);
    workshop.write("moving.toml", format!("plan_horizon = 2.0\n{text}"));
    let checked = workshop.punctual(["check", "moving.toml"]).success();
    assert!(!checked.contains("plans: none"), "{checked}");
}

/// The guarantee ends at some time, which `check` and the run report and which is extended during the run.
#[test]
fn an_aeroplane_that_cannot_stop_is_promised_to_loiter() {
    let workshop = Workshop::new();
    let file = String::from_utf8(fs::read(examples().join("../models/aeroplane.toml")).expect("the example"));
    let file = file.expect("a text").replace("stop_time = 120.0", "stop_time = 45.0");
    workshop.write("plane.toml", &file);
    let checked = workshop.punctual(["check", "plane.toml"]).success();
    assert!(
        checked.contains("outside, h = -215.4 m; guaranteed until 60.8 s, whatever u_ref is"),
        "{checked}"
    );
    assert!(
        checked.contains("whatever u_ref is, until 60.8 s; it is extended if a longer one is found"),
        "{checked}"
    );
    workshop.punctual(["run", "plane.toml", "--require", "on_time_and_inside"]).success();
    let table = Table::parse(&workshop.text("plane/plane.csv"));
    let until = table.column("filter.assured_until");
    assert!(until.is_sorted() && until[0] > 50.0 && until[until.len() - 1] > 65.0, "{until:?}");
    // Without a horizon, the message says what to do. If no plans are followed, it says that there is none to
    // extend.
    workshop.write("plane.toml", file.replace("plan_horizon = 20.0", ""));
    let refused = workshop.punctual(["check", "plane.toml"]);
    assert!(refused.code == 1 && refused.stdout.contains("backup plan: NONE was found"), "{refused:#?}");
    assert!(
        refused.stdout.contains("none ends at an equilibrium; with plan_horizon = 30 there is one until "),
        "{refused:#?}"
    );
    for (value, message) in [
        ("0.01", "plan_horizon: is 0.01 s, must be finite, and at least a step (0.05 s)"),
        (
            "20.0\nassurance = \"off\"",
            "plan_horizon: is for plans, of which there are none: assurance is \"off\"",
        ),
    ] {
        workshop.write("plane.toml", file.replace("= 20.0 # s", &format!("= {value}")));
        let done = workshop.punctual(["check", "plane.toml"]);
        assert!(done.code != 0 && done.stderr.contains(message), "{done:#?}");
    }
}

#[test]
fn a_campaign_takes_a_file_alone() {
    let workshop = Workshop::new();
    workshop.write("car.toml", CAR.replace("stop_time = 3.0", "stop_time = 8.0"));
    workshop.write(
        "many.toml",
        "system = \"car.toml\"\n[campaign]\nruns = 4\n[vary]\n\"plant.x0.theta\" = { distribution = \"uniform\", min = -1.0, max = 1.0 }\n",
    );
    workshop.punctual(["campaign", "many.toml", "--require", "success"]).success();
    workshop.punctual(["replay", "many.parquet", "--run", "2"]).success();
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_keeps_its_rows() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};

    let workshop = Workshop::new();
    workshop.write("car.toml", CAR.replace("stop_time = 3.0", "stop_time = 1e5"));
    let mut child = Command::new(env!("CARGO_BIN_EXE_punctual"))
        .args(["run", "car.toml", "--out", "out"])
        .current_dir(workshop.path(""))
        .stderr(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the binary under test");
    // The folder is created before the first step; by then, or soon after, the handler is installed.
    let begin = Instant::now();
    while !workshop.path("out").exists() && begin.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(10));
    }
    std::thread::sleep(Duration::from_secs(1));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill").success());
    assert_eq!(child.wait().expect("a child").code(), Some(130));
    let mut printed = String::new();
    std::io::Read::read_to_string(&mut child.stderr.take().expect("piped"), &mut printed).expect("UTF-8");
    assert!(
        printed
            .starts_with("note: what was recorded until then is in out/car.csv\nerror: interrupted at t = "),
        "{printed}"
    );
    assert!(Table::parse(&workshop.text("out/car.csv")).len() > 1);
}
