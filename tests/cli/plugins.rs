//! Plug-ins: the examples compared with the same models as expressions, everything that is refused, and
//! crashes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use punctual_cosim::host::PLATFORM;
use punctual_fmu::plugin_file_name;

use crate::merging::{elsewhere, entries, for_other_processor, write};
use crate::table::{Table, assert_same_bits};
use crate::workshop::{Workshop, assert_golden, without_guids};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_path_buf()
}

/// Runs a compiler, which these tests need.
#[track_caller]
fn compile(program: &str, arguments: &[&str], source: &Path, product: &Path) {
    let mut command = Command::new(program);
    command.args(arguments).arg("-o").arg(product).arg(source);
    let done = command.output().unwrap_or_else(|e| panic!("{program} cannot be started: {e}"));
    assert!(done.status.success(), "{program}: {}", String::from_utf8_lossy(&done.stderr));
}

/// The compiler given by the variable `variable`, or else `default`.
fn compiler(variable: &str, default: &str) -> String {
    std::env::var(variable).unwrap_or_else(|_| default.to_owned())
}

const STRICT: [&str; 6] = ["-O1", "-shared", "-fPIC", "-Wall", "-Wextra", "-Werror"];

/// Compiles the example `source` to the plug-in `name` of `workshop`.
fn example(workshop: &Workshop, source: &str, name: &str) {
    let product = workshop.path(&plugin_file_name(name));
    let source = root().join("examples/plugin").join(source);
    let header = format!("-I{}", root().join("fmu/include").display());
    match source.extension().and_then(|e| e.to_str()) {
        Some("c") => {
            let arguments: Vec<&str> =
                STRICT.into_iter().chain(["-std=c99", "-Wpedantic", &header]).collect();
            compile(&compiler("CC", "cc"), &arguments, &source, &product);
        }
        Some("cpp") => {
            let arguments: Vec<&str> =
                STRICT.into_iter().chain(["-std=c++11", "-Wpedantic", &header]).collect();
            compile(&compiler("CXX", "c++"), &arguments, &source, &product);
        }
        _ => {
            let arguments = ["--edition=2024", "-Dwarnings", "-Cstrip=symbols", "--crate-type=cdylib"];
            compile(&compiler("RUSTC", "rustc"), &arguments, &source, &product);
        }
    }
}

/// Compiles `tests/fixtures/plugin.c` with `macros` to the plug-in `fixture` of `workshop`.
fn fixture(workshop: &Workshop, macros: &[&str]) {
    let product = workshop.path(&plugin_file_name("fixture"));
    // An ending child may still have the file loaded that the linker overwrites.
    let _ = fs::remove_file(&product);
    let macros: Vec<String> = macros.iter().map(|name| format!("-D{name}")).collect();
    let arguments: Vec<&str> = STRICT.into_iter().chain(macros.iter().map(String::as_str)).collect();
    compile(&compiler("CC", "cc"), &arguments, &root().join("tests/fixtures/plugin.c"), &product);
}

fn copy(workshop: &Workshop, folder: &str, name: &str) {
    workshop.write(name, fs::read(root().join("examples").join(folder).join(name)).expect("an example"));
}

/// Builds filter and plant of `stem` and runs them; returns the table after asserting that every promise was
/// kept.
fn run(workshop: &Workshop, stem: &str) -> Table {
    for kind in ["filter", "plant"] {
        let name = format!("{stem}-{kind}");
        workshop.punctual(["build", &format!("{name}.toml"), "-o", &format!("{name}.fmu")]).success();
    }
    workshop.punctual(["run", &format!("{stem}.toml"), "--out", "out", "--require", "kept"]).success();
    Table::parse(&workshop.text(&format!("out/{stem}.csv")))
}

/// The system `stem` with the plug-in of `examples/plugin`, and with the expressions of `examples/models`.
/// The edits `of_both` are made in both filters, `of_expressions` only in the one with expressions.
fn both(source: &str, stem: &str, of_both: &[(&str, &str)], of_expressions: &[(&str, &str)]) -> [Table; 2] {
    let (plugin, expressions) = (Workshop::with_library(), Workshop::with_library());
    example(&plugin, source, source.split('.').next().expect("a stem"));
    for (workshop, folder) in [(&plugin, "plugin"), (&expressions, "models")] {
        for kind in ["-filter", "-plant", ""] {
            copy(workshop, folder, &format!("{stem}{kind}.toml"));
        }
    }
    let filter = format!("{stem}-filter.toml");
    for (workshop, edits) in [(&plugin, of_both), (&expressions, of_both), (&expressions, of_expressions)] {
        let mut text = workshop.text(&filter);
        for (from, to) in edits {
            assert!(text.contains(from), "{from:?} in {text}");
            text = text.replacen(from, to, 1);
        }
        workshop.write(&filter, text);
    }
    let check = ["check", &filter, "--plant", &format!("{stem}-plant.toml")];
    assert!(plugin.punctual(check).success().contains(": every promise is kept\n"));
    [run(&plugin, stem), run(&expressions, stem)]
}

/// Both perform the same operations in the same order, so the results are bitwise equal.
#[test]
fn the_car_in_c_is_the_car_of_expressions() {
    // A plug-in has no margin by default, since its expressions are not known.
    let named = [("\"limit\"", "\"speed\"\nmargin = 0.0")];
    let [plugin, expressions] = both("jerk_car.c", "jerk-car", &[], &named);
    let mut compared = 0;
    for name in expressions.header() {
        assert_same_bits(name, &plugin.column(name), &expressions.column(name));
        compared += 1;
    }
    assert!(compared > 20 && plugin.len() > 700);
}

/// The mass matrix is solved in another order, so round-off differs. The loop of filter and plant neither
/// damps nor amplifies it much over its 800 steps. A step of the input along the profile is of the order of
/// its rates, 100 1/s², times that of the state. Only rows are used, since round-off would decide whether a
/// plan passes.
#[test]
fn the_arm_in_rust_is_the_arm_of_expressions() {
    const STATE: f64 = 1e-11;
    const INPUT: f64 = 1e-8;
    let rows = ("kind = \"filter\"\n", "kind = \"filter\"\nassurance = \"off\"\n");
    let [plugin, expressions] = both("arm.rs", "arm", &[rows], &[]);
    assert_eq!(plugin.len(), expressions.len());
    for (prefix, tolerance) in [("plant.x.", STATE), ("filter.u.", INPUT)] {
        for name in expressions.header().iter().filter(|name| name.starts_with(prefix)) {
            let pairs = plugin.column(name).into_iter().zip(expressions.column(name));
            let apart = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(apart <= tolerance, "{name}: {apart:e}, must be at most {tolerance:e}");
        }
    }
}

#[test]
fn the_unicycle_in_cpp_finds_its_disc() {
    let workshop = Workshop::with_library();
    example(&workshop, "lagging_unicycle.cpp", "lagging_unicycle");
    copy(&workshop, "plugin", "lagging-unicycle-filter.toml");
    copy(&workshop, "models", "lagging-unicycle-plant.toml");
    copy(&workshop, "models", "lagging-unicycle.toml");
    let table = run(&workshop, "lagging-unicycle");
    let (time, h) = (table.column("time"), table.column("filter.goal.h"));
    assert!(time.iter().zip(&h).all(|(t, h)| *t < 10.0 || *h >= 0.0));
}

const FILTER: &str =
    "kind = \"filter\"\nplant = { plugin = \"fixture\" }\n[[barrier]]\nname = \"wall\"\ndeadline = 2.0\n";

/// One defect of the library at a time: the message of each.
#[test]
fn libraries_that_are_refused() {
    let workshop = Workshop::with_library();
    workshop.write("f.toml", FILTER);
    let mut printed = String::new();
    for macros in [
        "NO_SYMBOL",
        "MODEL=NULL",
        "MODEL=(void*)((char*)&model+2)",
        "ABI=2",
        "ABI=0",
        "SIZE=96",
        "SIZE=8",
        "STATES=0",
        "STATES=65",
        "INPUTS=33",
        "PARAMETERS=257",
        "BARRIERS=129",
        "PLANT=NULL",
        "BARRIER_VALUE=NULL",
        "STATE=NULL",
        "PARAMETER=NULL",
        "NAME=NULL",
        "NAME=\"\"",
        "NAME=\"2v\"",
        "NAME=\"x\"",
        "NAME=\"end\"",
        "NAME=\"v\\xff\"",
        "UNIT=\"mile\"",
        "UNIT=\"\\xc3\"",
        "DESCRIPTION=\"\\x80\"",
        "MINIMUM=NAN",
        "MINIMUM=8, -DMAXIMUM=7",
        "START=NAN",
        "START=-1.0",
        "PARAMETER_NAME=\"status\"",
        "REFUSES",
        "FORGED",
        "OPERATION",
        "DIFFERENT",
        "LOST",
        "ENDLESS",
        "CRASH_LOADING",
        "CRASH_MODEL",
        "CRASH_INITIALIZE",
        "CRASH_PLANT",
        "EXIT_INITIALIZE",
    ] {
        fixture(&workshop, &macros.split(", -D").collect::<Vec<_>>());
        let done = workshop.punctual(["build", "f.toml", "-o", "f.fmu"]);
        assert_eq!((done.code, done.stdout.as_str()), (2, ""), "{macros}: {done:?}");
        printed += &format!("{macros}\n    {}", done.stderr);
        assert!(!workshop.files().contains(&"f.fmu".to_owned()), "{macros}");
    }
    let printed = printed.replace(&plugin_file_name("fixture"), "LIBRARY");
    assert_golden("plugins-refused.txt", &printed);
    let page = fs::read_to_string(root().join("docs/plugin.md")).expect("the page");
    let messages: Vec<_> =
        page.lines().filter_map(|line| line.split_once("| `plant.")?.1.strip_suffix("` |")).collect();
    assert_eq!(messages.len(), 5);
    for message in messages {
        assert!(printed.contains(&format!(" f.toml: plant.{message}\n")), "docs/plugin.md says {message:?}");
    }
}

/// One defect of the configuration at a time.
#[test]
fn configurations_that_are_refused() {
    let workshop = Workshop::with_library();
    fixture(&workshop, &[]);
    let head = "kind = \"filter\"\n[plant]\nplugin = \"fixture\"\n";
    let wall = "[[barrier]]\nname = \"wall\"\ndeadline = 2.0\n";
    let mut printed = String::new();
    for text in [
        FILTER.replace("\"fixture\"", "\"other\""),
        FILTER.replace("\"fixture\"", "\"../fixture\""),
        FILTER.replace("plugin = \"fixture\"", "plugin = \"fixture\", model = \"unicycle\""),
        FILTER.replace("plugin = \"fixture\"", "model = \"unicycle\", plugin_digest = \"1\""),
        format!("{head}plugin_digest = \"1\"\n{wall}"),
        format!("{head}plugin_digest = {{ {PLATFORM} = \"1\", other = \"2\" }}\n{wall}"),
        format!("{head}plugin_digest = {{ other = \"2\" }}\n{wall}"),
        format!("{head}plugin_digest = {{ {PLATFORM} = 1 }}\n{wall}"),
        format!("{head}derivatives = {{ x = \"v\" }}\n{wall}"),
        format!("{head}l_r = 1.0\n{wall}"),
        format!("{head}states = [{{ name = \"x\" }}, {{ name = \"w\" }}]\n{wall}"),
        format!("{head}inputs = [{{ name = \"u\", unit = \"N\" }}]\n{wall}"),
        format!("{head}inputs = [{{ name = \"u\", min = 1.0, max = 0.0 }}]\n{wall}"),
        format!("{head}parameters = [{{ name = \"length\", start = 1.0 }}]\n{wall}"),
        format!("{head}parameters = [{{ name = \"end\", start = -1.0 }}]\n{wall}"),
        format!(
            "{head}parameters = [{{ name = \"end\", start = 1.0 }}, {{ name = \"end\", start = 2.0 }}]\n{wall}"
        ),
        format!("{head}{}", wall.replace("wall", "door")),
        format!("{head}{wall}output = \"door\"\n"),
        format!("{head}{wall}unit = \"s\"\n"),
        format!("{head}{wall}shape = \"disc\"\n"),
        format!("{head}{wall}expression = \"x\"\n"),
        format!("kind = \"filter\"\nplant.model = \"unicycle\"\n{wall}shape = \"plugin\"\n"),
        format!("kind = \"filter\"\nplant.model = \"unicycle\"\n{wall}output = \"wall\"\n"),
    ] {
        workshop.write("f.toml", &text);
        let done = workshop.punctual(["check", "f.toml"]);
        assert_eq!((done.code, done.stdout.as_str()), (2, ""), "{text}: {done:?}");
        printed += &format!("{}    {}", text.split_once('\n').expect("lines").1, done.stderr);
    }
    let printed =
        printed.replace(&plugin_file_name("fixture"), "LIBRARY").replace(&plugin_file_name("other"), "OTHER");
    // The digest depends on the bytes that the compiler wrote.
    let digest = printed.split("has \"").nth(1).and_then(|rest| rest.get(..36)).expect("a digest").to_owned();
    assert_golden(
        "plugins-configured.txt",
        &printed.replace(&digest, "DIGEST").replace(PLATFORM, "PLATFORM"),
    );
}

/// A file other than the one the FMU was built with is refused before any of it runs, since a truncated
/// library may end the process that loads it.
#[test]
fn a_file_that_was_cut_short_is_told_by_its_digest() {
    let workshop = Workshop::with_library();
    let library = plugin_file_name("fixture");
    fixture(&workshop, &[]);
    let whole = workshop.bytes(&library);
    workshop.write("g.toml", FILTER.replace("\"fixture\"", "\"fixture\", plugin_digest = \"1\""));
    for length in [0, 100, whole.len() / 4, whole.len() - 1] {
        workshop.write(&library, &whole[..length]);
        let done = workshop.punctual(["check", "g.toml"]);
        let words = "plant.plugin_digest: is \"1\", but ";
        assert!(done.code == 2 && done.stderr.contains(words), "{length}: {done:?}");
    }
}

/// Two different compilations give two GUIDs; the same one twice gives the same bytes.
#[test]
fn the_guid_and_the_fmu_depend_on_the_library() {
    let workshop = Workshop::with_library();
    workshop.write("f.toml", FILTER);
    let build = |macros: &[&str]| {
        fixture(&workshop, macros);
        let printed = workshop.punctual(["build", "f.toml", "-o", "f.fmu"]).success();
        (printed, workshop.bytes("f.fmu"))
    };
    let (first, again, second) = (build(&[]), build(&[]), build(&["OWN_SINE"]));
    assert!(first == again, "{} and {}", first.0, again.0);
    assert_ne!(first.0, second.0);
    assert_eq!(without_guids(&first.0), without_guids(&second.0));
}

/// The library of an FMU was replaced, or is missing.
#[test]
fn an_fmu_with_another_library_is_refused() {
    let workshop = Workshop::with_library();
    workshop.write("f.toml", FILTER);
    workshop.write(
        "s.toml",
        "experiment = { stop_time = 1.0, step = 0.1 }\n[[component]]\nname = \"f\"\nfmu = \"f.fmu\"\n\
         start = { \"x.x\" = 0.0, \"x.v\" = 0.0 }\n",
    );
    fixture(&workshop, &["OWN_SINE"]);
    let other = workshop.bytes(&plugin_file_name("fixture"));
    fixture(&workshop, &[]);
    let place = format!("resources/{PLATFORM}/{}", plugin_file_name("fixture"));
    for (exchange, message) in [
        (Some(other), "plant.plugin_digest: is \""),
        (None, "plant.plugin: is \"fixture\", but "),
        (Some(b"text".to_vec()), "plant.plugin_digest: is \""),
    ] {
        workshop.punctual(["build", "f.toml", "-o", "f.fmu"]).success();
        workshop.punctual(["run", "s.toml", "--out", "out"]).success();
        let mut seen = false;
        workshop.edit_fmu("f.fmu", |entry, bytes| {
            seen |= entry == place;
            if entry == place { exchange.clone() } else { Some(bytes) }
        });
        assert!(seen, "no {place}");
        let done = workshop.punctual(["run", "s.toml", "--out", "out"]);
        done.fails_like(1, "fmi2Instantiate of f (f.fmu) returned no instance", &[message]);
    }
}

/// Libraries of two systems: each gives another GUID, unless the configuration has the digests of both.
#[test]
fn an_fmu_of_two_systems_has_the_digests_of_both() {
    const OTHER: &str = "aarch64-linux";
    let workshop = Workshop::with_library();
    let file = plugin_file_name("fixture");
    let build = |name: &str, macros: &[&str], digests: &str| {
        fixture(&workshop, macros);
        let digests = format!("\"fixture\"{digests}");
        workshop.write("f.toml", FILTER.replacen("\"fixture\"", &digests, 1));
        let done = workshop.punctual(["build", "f.toml", "-o", name]);
        (workshop.bytes(&file), done)
    };
    let merge = || workshop.punctual(["merge", "here.fmu", "there.fmu", "-o", "both.fmu"]);
    let (_, here) = build("here.fmu", &[], "");
    let (theirs, there) = build("there.fmu", &["OWN_SINE"], "");
    assert_ne!(here.success(), there.success());
    let printed = merge().stderr;
    let advice = "; the GUID of an FMU with a plug-in is made from its library too: build with a plugin_digest for \
                  every platform (docs/plugin.md)\n";
    assert!(printed.starts_with(
        "error: there.fmu: cannot be merged: modelDescription.xml differs from here.fmu's: guid"
    ));
    assert!(printed.ends_with(advice), "{printed}");

    // The messages of a build without digests contain them.
    let digest = |macros: &[&str]| {
        let printed = build("x.fmu", macros, &format!(", plugin_digest = {{ {OTHER} = \"\" }}")).1.stderr;
        printed.split("has \"").nth(1).and_then(|rest| rest.get(..36)).expect("a digest").to_owned()
    };
    let digests = format!(
        ", plugin_digest = {{ {OTHER} = {:?}, {PLATFORM} = {:?} }}",
        digest(&["OWN_SINE"]),
        digest(&[])
    );
    build("here.fmu", &[], &digests).1.success();
    let mut there = elsewhere(&entries(&workshop, "here.fmu"), OTHER, |bytes| for_other_processor(bytes));
    there.insert(format!("resources/{OTHER}/{file}"), theirs);
    write(&workshop, "there.fmu", &there);
    let done = merge();
    assert_eq!(done.stderr, "");
    assert!(
        done.success()
            .starts_with(&format!("both.fmu: filter for {OTHER} (there.fmu), {PLATFORM} (here.fmu)"))
    );
    let both = entries(&workshop, "both.fmu");
    for platform in [OTHER, PLATFORM] {
        assert!(both.contains_key(&format!("resources/{platform}/{file}")), "{:?}", both.keys());
    }
}

/// Outside the domain of a model, the filter returns a status, and the plant's step fails.
#[test]
fn outside_the_domain_nothing_crashes() {
    let workshop = Workshop::with_library();
    fixture(&workshop, &["STOPS"]);
    workshop.write("f.toml", FILTER.replace("wall", "root"));
    for (x, status) in [("x=0.5", "unchanged"), ("x=-4", "singular")] {
        let printed = workshop.punctual(["check", "f.toml", "--x0", x]);
        assert!(printed.stdout.contains(&format!("u_ref = 0: {status}\n")), "{printed:?}");
    }
    workshop.write("p.toml", "kind = \"plant\"\nplant.plugin = \"fixture\"\nx0.v = 1.0\n");
    workshop.punctual(["build", "p.toml", "-o", "p.fmu"]).success();
    let system = "experiment = { stop_time = 4.0, step = 0.1 }\n[[component]]\nname = \"p\"\nfmu = \"p.fmu\"\n\
         start = { \"u.u\" = 0.0 }\n";
    workshop.write("s.toml", system);
    let done = workshop.punctual(["run", "s.toml", "--out", "out"]);
    let parts = ["error: fmi2DoStep of p (p.fmu) at t = 1.1 s returned fmi2Error", "x.x becomes NaN"];
    assert!(done.code == 1 && parts.iter().all(|part| done.stderr.contains(part)), "{done:?}");
}

/// A function given by its derivatives equals the function: the sine of the header and one implemented in the
/// model.
#[test]
fn a_function_by_its_derivatives_is_the_function() {
    let workshop = Workshop::with_library();
    workshop.write("f.toml", FILTER.replace("wall", "sine") + "margin = 0.1\n");
    let plant = "kind = \"plant\"\nplant.plugin = \"fixture\"\nx0 = { x = -1.0, v = 0.3 }\n";
    workshop.write("p.toml", plant);
    let system = "experiment = { stop_time = 4.0, step = 0.01 }\n[[component]]\nname = \"f\"\nfmu = \"f.fmu\"\n\
                  [[component]]\nname = \"p\"\nfmu = \"p.fmu\"\n[[connect_by_name]]\ncomponents = [\"f\", \"p\"]\n";
    workshop.write("s.toml", system);
    let run = |macros: &[&str]| {
        fixture(&workshop, macros);
        for name in ["f", "p"] {
            workshop.punctual(["build", &format!("{name}.toml"), "-o", &format!("{name}.fmu")]).success();
        }
        workshop.punctual(["run", "s.toml", "--out", "out"]).success();
        Table::parse(&workshop.text("out/s.csv"))
    };
    let (header, own) = (run(&[]), run(&["OWN_SINE"]));
    for name in ["f.u.u", "f.sine.h", "p.x.x", "p.x.v"] {
        // Round-off over 400 steps, for inputs of order 100.
        let pairs = header.column(name).into_iter().zip(own.column(name));
        let apart = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart <= 1e-9, "{name}: {apart:e}");
    }
    assert!(header.column("f.sine.h").last().is_some_and(|h| *h >= 0.1));
}
