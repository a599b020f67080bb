//! The typical mistakes of a first hour, each with its whole message.

use std::fs;

use crate::running::system;
use crate::workshop::{Workshop, examples};

/// The example with a named model, the one with expressions, its plant, and the system that couples these
/// two.
fn example(name: &str) -> String {
    let place = if name.starts_with("jerk") { "../models" } else { "." };
    fs::read_to_string(examples().join(place).join(format!("{name}.toml"))).expect("an example")
}

/// The file, the mistake in it, and the message after the file's name.
const MISTAKES: [(&str, &str, &str, &str); 38] = [
    (
        "unicycle-filter",
        "radius",
        "raduis",
        "barrier[0].raduis: is an unknown key (did you mean radius?) (line 11)",
    ),
    (
        "unicycle-filter",
        "centre",
        "center",
        "barrier[0].center: is an unknown key (did you mean centre?) (line 10)",
    ),
    ("unicycle-filter", "[plant]", "[Plant]", "Plant: is an unknown key (did you mean plant?) (line 5)"),
    (
        "unicycle-filter",
        "\"filter\"",
        "\"Filter\"",
        "kind: is \"Filter\", must be \"filter\", \"plant\" or \"controller\" (did you mean filter?) (line 2)",
    ),
    (
        "unicycle-filter",
        "kind = \"filter\"",
        "",
        "kind: missing, must be \"filter\", \"plant\" or \"controller\"",
    ),
    (
        "unicycle-filter",
        "[[barrier]]",
        "[barrier]",
        "barrier: is a table, must be a list; a list of tables is written [[barrier]] (line 8)",
    ),
    (
        "unicycle-filter",
        "deadline = 10.0",
        "deadline = -10.0",
        "barrier[0].deadline: is -10, must be finite and >= 1e-9",
    ),
    (
        "unicycle-filter",
        "deadline = 10.0",
        "deadline = inf",
        "barrier[0].deadline: is inf, must be finite and >= 1e-9",
    ),
    (
        "unicycle-filter",
        "deadline = 10.0",
        "deadline = \"10 s\"",
        "barrier[0].deadline: is \"10 s\", must be a number (line 12)",
    ),
    (
        "unicycle-filter",
        "deadline = 10.0",
        "deadline = [10.0]",
        "barrier[0].deadline: is a list, must be a number (line 12)",
    ),
    (
        "unicycle-filter",
        "deadline = 10.0",
        "deadline = 1e400",
        "barrier[0].deadline: is 1e400, must be at most 1.7976931348623157e308 in size (line 12)",
    ),
    (
        "unicycle-filter",
        "deadline = 10.0",
        "deadline = 100000000000000000000",
        "barrier[0].deadline: is 100000000000000000000, which is too large for a whole number; write it with a decimal \
         point (line 12)",
    ),
    (
        "unicycle-filter",
        "[45.0, 45.0]",
        "[45.0, 45.0, 0.0]",
        "barrier[0].centre: has 3 entries, must have 2, along x and y for disc",
    ),
    (
        "unicycle-filter",
        "[[barrier]]",
        "[bounds]\na = [3.0, -3.0]\n[[barrier]]",
        "bounds.a: is [3, -3], must be [min, max] with min <= max (in an FMU: u_min.a, u_max.a)",
    ),
    (
        "unicycle-filter",
        "[[barrier]]",
        "[bounds]\na = [-3.0, 3.0, 9.0]\n[[barrier]]",
        "bounds.a: has 3 entries, must have 2 (line 9)",
    ),
    (
        "unicycle-filter",
        "[[barrier]]",
        "[bounds]\na = 3.0\n[[barrier]]",
        "bounds.a: is 3.0, must be a list with 2 entries (line 9)",
    ),
    (
        "unicycle-filter",
        "[[barrier]]",
        "[bounds]\nomga = [-3.0, 3.0]\n[[barrier]]",
        "bounds.omga: unknown input (did you mean omega?), must be one of a, omega",
    ),
    (
        "unicycle-filter",
        "name = \"goal\"",
        "name = \"goal\"\nshape = \"cube\"",
        "barrier[0].shape: is \"cube\", must be \"disc\", \"quadratic_disc\", \"obstacle\", \"ellipse\", \
         \"elliptic_obstacle\", \"rectangle\", \"rectangular_obstacle\", \"sphere\", \"spherical_obstacle\", \"box\", \"box_obstacle\", \"apart\", \
         \"half_plane\", \"at_most\", \"at_least\", \
         \"speed_limit\", \"expression\", \"plugin\" or \"external\" (line 10)",
    ),
    (
        "unicycle-filter",
        "model = \"unicycle\"",
        "model = \"unicycle\"\nstates = []",
        "plant.states: given beside `model`; unicycle has its own",
    ),
    (
        "unicycle-filter",
        "model = \"unicycle\"",
        "model = \"unicycle\"\ninputs = []",
        "plant.inputs: given beside `model`; unicycle has its own",
    ),
    (
        "jerk-car-filter",
        "name = \"limit\"",
        "name = \"merge\"",
        "barrier[1].name: is \"merge\", which is already the name of something else",
    ),
    (
        "jerk-car-filter",
        "name = \"merge\"",
        "name = \"v_max\"",
        "barrier[0].name: is \"v_max\", which is already the name of something else",
    ),
    (
        "jerk-car-filter",
        "name = \"merge\"",
        "name = \"merge-point\"",
        "barrier[0].name: is \"merge-point\", must be letters, digits and underscores, not starting with a digit (1 to 64)",
    ),
    (
        "jerk-car-filter",
        "[plant.derivatives]",
        "[plant.derivative]",
        "plant.derivative: is an unknown key (did you mean derivatives?) (line 17)",
    ),
    ("jerk-car-filter", "\nv = \"acc\"", "", "plant.derivatives.v: missing, every state needs one"),
    (
        "jerk-car-filter",
        "acc = \"jerk\"",
        "acc = 0",
        "plant.derivatives.acc: is 0, must be a text in quotes (line 20)",
    ),
    (
        "jerk-car-filter",
        "    { name = \"p\", unit = \"m\", description = \"position along the lane\" },",
        "    \"p\",",
        "plant.states[0]: is \"p\", must be a table (line 7)",
    ),
    (
        "jerk-car-filter",
        "unit = \"m/s2\"",
        "unit = \"m/s^2\"",
        "plant.states[2].unit: is \"m/s^2\", must be like \"kg.m2/s\", made of kg, cd, min, h, d, deg, rev, rpm, percent, ppm, t, \
         atm, mmHg, psi, hp, kn, mph, nmi, mi, yd, ft, in, lb, lbf and, also with a prefix as in km, of m, s, A, K, mol, \
         rad, Hz, N, Pa, J, W, C, V, Ohm, S, F, H, T, Wb, lm, lx, g, l, L, bar, Wh, Ah, cal, or \"1\"",
    ),
    (
        "jerk-car-filter",
        "{ name = \"v\", unit = \"m/s\"",
        "{ name = \"v\", unit = \"km/h\"",
        "plant.derivatives.p: is \"v\", which is in km/h; the derivative of p, which is in m, must be in m/s; numbers are \
         taken as they are, so that this is wrong by the factor 0.277778",
    ),
    (
        "jerk-car-filter",
        "unit = \"m\"\ndeadline",
        "unit = \"m/s\"\ndeadline",
        "barrier[0].unit: is \"m/s\", but \"p - d\" is in m",
    ),
    (
        "jerk-car-filter",
        "\"p - d\"",
        "\"p**2 - d\"",
        "barrier[0].expression: at character 3 of \"p**2 - d\" is '*', must be a number, a name, a sign or \"(\"; a power is \
         written ^",
    ),
    (
        "jerk-car-filter",
        "\"p - d\"",
        "\"p >= d\"",
        "barrier[0].expression: at character 3 of \"p >= d\" is '>', must be an operator or the end; an expression has no \
         comparison; a barrier is what is to be >= 0, as a - b for a >= b",
    ),
    (
        "jerk-car-filter",
        "\"p - d\"",
        "\"norm(p - d)\"",
        "barrier[0].expression: calls norm, which is not a function; the functions are sqrt, exp, ln, sin, cos, tan, atan, atan2, \
         abs, tanh, min, max",
    ),
    (
        "jerk-car-filter",
        "acc = \"jerk\"",
        "acc = \"jerk + t\"",
        "plant.derivatives.acc: names t, the time, which a derivative does not depend on; a state with the derivative 1 does",
    ),
    (
        "jerk-car-filter",
        "stop_time = 8.0",
        "stop_time = 0.0",
        "experiment.stop_time: is 0, must be > start_time = 0",
    ),
    (
        "jerk-car-filter",
        "step_size",
        "step",
        "experiment.step: is an unknown key (did you mean step_size?) (line 36)",
    ),
    (
        "jerk-car-plant",
        "[x0]\nv",
        "[x0]\naccl",
        "x0.accl: unknown state (did you mean acc?), must be one of p, v, acc",
    ),
    ("jerk-car-plant", "v = 10.0", "v = nan", "x0.v: is NaN, must be finite"),
];

#[test]
fn mistakes_in_a_configuration() {
    let workshop = Workshop::new();
    for (name, from, to, message) in MISTAKES {
        let valid = example(name);
        assert!(valid.contains(from), "{from:?} in {valid}");
        workshop.write("my.toml", valid.replacen(from, to, 1));
        let done = workshop.punctual(["check", "my.toml"]);
        assert_eq!(
            (done.code, done.stderr.as_str()),
            (2, format!("error: my.toml: {message}\n").as_str()),
            "{to:?}"
        );
    }
    // Text that is not TOML is shown by its line, with a hint at what is meant.
    for (to, hint) in [
        ("deadline = 10,0", "; a decimal point is ."),
        ("direct_feedthrough = True", "; TOML writes true and false in small letters"),
    ] {
        workshop.write("my.toml", example("unicycle-filter").replacen("deadline = 10.0", to, 1));
        let done = workshop.punctual(["check", "my.toml"]);
        done.fails_like(2, "my.toml: TOML parse error at line 12, column ", &[to, hint]);
    }
}

/// For each file of the wrong kind, the message says what it is.
#[test]
fn files_of_another_kind() {
    let workshop = Workshop::new();
    let campaign = examples().join("../campaign/unicycle.toml");
    let files: [(&str, Vec<u8>); 7] = [
        ("filter.toml", example("unicycle-filter").into()),
        ("plant.toml", example("unicycle-plant").into()),
        ("system.toml", example("unicycle").into()),
        ("campaign.toml", fs::read(campaign).expect("an example")),
        ("a.fmu", b"PK\x03\x04 and more".to_vec()),
        ("utf16.toml", b"\xff\xfek\0i\0n\0d\0".to_vec()),
        ("latin1.toml", b"kind = \"filter\"\nname = \"m\xe9rge\"\n".to_vec()),
    ];
    for (name, bytes) in files {
        workshop.write(name, bytes);
    }
    fs::create_dir(workshop.path("folder")).expect("a folder");
    let one = "this is the file of a filter, plant or controller, which `punctual check` and `punctual build` take; `punctual run` takes that of a filter";
    let system = "this is a system file, which `punctual run` takes, and `punctual build` with an output that ends in .ssp";
    let alone = "is \"plant\"; must be \"filter\", which runs with its own model, or a system file, which couples components";
    let many = "this is a campaign file, which `punctual campaign` takes";
    let archive =
        "it is an archive, such as an FMU, and no text; `punctual inspect` and `punctual validate` take FMUs";
    let utf16 = "it is in UTF-16, must be in UTF-8; save the file as UTF-8";
    let latin1 = "line 2 is not valid UTF-8; save the file as UTF-8";
    for (command, file, message) in [
        ("check", "system.toml", format!("system.toml: kind: missing: {system}")),
        ("check", "campaign.toml", format!("campaign.toml: kind: missing: {many}")),
        ("run", "plant.toml", format!("plant.toml: kind: {alone}")),
        ("run", "campaign.toml", format!("campaign.toml: component: missing: {many}")),
        ("campaign", "system.toml", format!("system.toml: campaign: missing: {system}")),
        ("campaign", "filter.toml", format!("filter.toml: campaign: missing: {one}")),
        ("check", "a.fmu", format!("cannot read a.fmu: {archive}")),
        ("run", "a.fmu", format!("cannot read a.fmu: {archive}")),
        ("check", "utf16.toml", format!("cannot read utf16.toml: {utf16}")),
        ("check", "latin1.toml", format!("cannot read latin1.toml: {latin1}")),
        ("check", "folder", "cannot read folder: it is a folder, must be a file".to_owned()),
        ("run", "folder", "cannot read folder: it is a folder, must be a file".to_owned()),
    ] {
        let done = workshop.punctual([command, file]);
        assert_eq!((done.code, done.stderr), (2, format!("error: {message}\n")), "{command} {file}");
    }
    let done = workshop.punctual(["inspect", "filter.toml"]);
    let message = "a TOML file is none; `punctual build` makes an FMU from one, `punctual check` checks it";
    done.fails(1, &format!("filter.toml: not a readable FMU archive: {message}"));
    // A byte order mark does no harm.
    workshop.write("marked.toml", format!("\u{feff}{}", example("unicycle-filter")));
    workshop.punctual(["check", "marked.toml"]).success();
}

/// A run refuses an input that nothing feeds, unless a start value shows that this is intended.
#[test]
fn inputs_that_nothing_feeds() {
    let advice = "connect what moves (`[[connection]]`, or `[[connect_by_name]]` for equal names), and give what stays the \
                  same its value here, as ";
    let by_name = "[[connect_by_name]]\ncomponents = [\"filter\", \"plant\"]\n";
    let workshop = Workshop::with_fmus();
    let short = ("stop_time = 20.0", "stop_time = 0.01");
    workshop.write("system.toml", system(&[short, (by_name, "")]));
    workshop.punctual(["run", "system.toml"]).fails(
        2,
        &format!(
            "system.toml: component[0]: nothing feeds x.x_p, x.y_p, x.theta, x.v of filter: {advice}`start = {{ \"x.x_p\" = 0.0 }}`"
        ),
    );
    let states = "fmu = \"filter.fmu\"\nstart = { \"x.x_p\" = 0.0, \"x.y_p\" = 0.0, \"x.theta\" = 0.0, \"x.v\" = 0.0 }";
    workshop.write("system.toml", system(&[short, (by_name, ""), ("fmu = \"filter.fmu\"", states)]));
    workshop.punctual(["run", "system.toml"]).fails(
        2,
        &format!(
            "system.toml: component[1]: nothing feeds u.a, u.omega of plant: {advice}`start = {{ \"u.a\" = 0.0 }}`"
        ),
    );
    let inputs = "fmu = \"plant.fmu\"\nstart = { \"u.a\" = 0.0, \"u.omega\" = 0.0 }";
    let edits = [short, (by_name, ""), ("fmu = \"filter.fmu\"", states), ("fmu = \"plant.fmu\"", inputs)];
    workshop.write("system.toml", system(&edits));
    workshop.punctual(["run", "system.toml"]).success();
}

/// In a campaign, a varied input counts as fed.
#[test]
fn inputs_that_a_campaign_varies() {
    let workshop = Workshop::new();
    workshop.write("plant.toml", example("unicycle-plant"));
    let alone = "[system.experiment]\nstop_time = 0.01\nstep = 0.001\n[[system.component]]\nname = \"plant\"\n\
                 fmu = \"plant.toml\"\nstart = { \"u.omega\" = 0.0 }\n[campaign]\nruns = 2\n";
    let vary = "[vary.\"plant.u.a\"]\ndistribution = \"uniform\"\nmin = 0.0\nmax = 1.0\n";
    workshop.write("c.toml", alone);
    let begin = "c.toml: component[0]: nothing feeds u.a of plant: ";
    workshop.punctual(["campaign", "c.toml"]).fails_like(2, begin, &["start = { \"u.a\" = 0.0 }"]);
    workshop.write("c.toml", format!("{alone}{vary}"));
    workshop.punctual(["campaign", "c.toml"]).success();
}

/// A run reports a step that is longer than the deadline, as `check` does.
#[test]
fn a_step_longer_than_the_deadline() {
    let workshop = Workshop::with_fmus();
    let start = "fmu = \"filter.fmu\"\nstart = { \"goal.deadline\" = 0.5 }";
    for (step, warned) in [("1.0", true), ("0.5", false)] {
        let text = system(&[("step = 0.001", &format!("step = {step}")), ("fmu = \"filter.fmu\"", start)]);
        workshop.write("system.toml", text);
        let done = workshop.punctual(["run", "system.toml"]);
        let note = "note: filter.goal: the deadline of 0.5 s is shorter than the step of 1 s: nothing is measured until it is \
                    over\n";
        assert_eq!((done.code, done.stderr.contains(note)), (1, warned), "{done:?}");
    }
}
