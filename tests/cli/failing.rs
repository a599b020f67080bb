//! Failures under `--json`: one object on stdout, and on stderr the same message and exit code as without it.

use serde_json::{Value, json};

use crate::workshop::{Workshop, examples};

/// Runs a failing command without `--json` and with it; returns the error object.
#[track_caller]
fn failure(workshop: &Workshop, arguments: &[&str]) -> Value {
    let plain = workshop.punctual(arguments);
    let with_json = workshop.punctual(arguments.iter().chain(&["--json"]));
    assert_eq!((plain.code, plain.stdout.as_str()), (with_json.code, ""), "{arguments:?}");
    // The usage that clap prints includes the options that were given.
    assert_eq!(plain.stderr, with_json.stderr.replace(" --json", ""), "{arguments:?}");
    let printed: Value =
        serde_json::from_str(&with_json.stdout).unwrap_or_else(|e| panic!("{e}: {}", with_json.stdout));
    let object = printed.as_object().expect("an object");
    assert_eq!(object.len(), 1, "{printed}");
    let error = object["error"].clone();
    assert_eq!(error["code"], with_json.code, "{error}");
    // What the parts say is also on stderr.
    for part in ["file", "component", "field"].iter().filter_map(|part| error[*part].as_str()) {
        assert!(with_json.stderr.contains(part), "{part} in {}", with_json.stderr);
    }
    error
}

#[test]
fn a_configuration_is_told_with_file_and_field() {
    let workshop = Workshop::new();
    let filter = "kind = \"filter\"\nplant.model = \"unicycle\"\n[[barrier]]\nname = \"goal\"\ncentre = [1.0, 2.0]\nradius = -1.0\n";
    workshop.write("car.toml", filter);
    for command in ["check", "run"] {
        assert_eq!(
            failure(&workshop, &[command, "car.toml"]),
            json!({
                "kind": "configuration",
                "code": 2,
                "file": "car.toml",
                "field": "barrier[0].radius",
                "message": "is -1, must be finite and >= 1e-9",
            })
        );
    }
    workshop.write("many.toml", "system = \"car.toml\"\n[campaign]\nruns = 0\n");
    let error = failure(&workshop, &["campaign", "many.toml"]);
    assert_eq!((&error["kind"], &error["code"]), (&"configuration".into(), &2.into()), "{error}");
}

#[test]
fn files_and_fmus_are_told() {
    let workshop = Workshop::new();
    for arguments in
        [["run", "none.toml"], ["check", "none.toml"], ["campaign", "none.toml"], ["inspect", "none.toml"]]
    {
        let error = failure(&workshop, &arguments);
        assert_eq!(
            (&error["kind"], &error["file"], &error["code"]),
            (&"file".into(), &"none.toml".into(), &2.into())
        );
        assert!(
            error["message"].as_str().is_some_and(|text| text.starts_with("cannot read it: ")),
            "{error}"
        );
    }
    workshop.write("bad.fmu", "no archive");
    let error = failure(&workshop, &["inspect", "bad.fmu"]);
    assert_eq!(
        (&error["kind"], &error["file"], &error["code"]),
        (&"fmu".into(), &"bad.fmu".into(), &1.into())
    );
    // In a system, the component is given.
    workshop.write("plant.toml", std::fs::read(examples().join("unicycle-plant.toml")).expect("an example"));
    workshop.write(
        "system.toml",
        "[experiment]\nstop_time = 1.0\nstep = 0.1\n[[component]]\nname = \"plant\"\nfmu = \"bad.fmu\"\n",
    );
    let error = failure(&workshop, &["run", "system.toml"]);
    assert_eq!((&error["kind"], &error["component"]), (&"fmu".into(), &"plant".into()), "{error}");
}

#[test]
fn options_and_usage_are_told() {
    let workshop = Workshop::new();
    workshop.write("plant.toml", std::fs::read(examples().join("unicycle-plant.toml")).expect("an example"));
    workshop.write(
        "system.toml",
        "[experiment]\nstop_time = 1.0\nstep = 0.1\n[[component]]\nname = \"plant\"\nfmu = \"plant.toml\"\nstart = { \"u.a\" = 0.0, \"u.omega\" = 0.0 }\n",
    );
    let error = failure(&workshop, &["run", "system.toml", "--report"]);
    let wanted = json!({ "kind": "configuration", "code": 2, "field": "--report", "message": "needs a folder for its page; add --out DIR" });
    assert_eq!(error, wanted);
    // Clap's message, which stderr also gets.
    let error = failure(&workshop, &["replay", "c.parquet"]);
    assert_eq!((&error["kind"], &error["code"]), (&"usage".into(), &2.into()));
    let message = error["message"].as_str().expect("a message");
    assert!(message.starts_with("the following required") && message.contains("--run <N>"), "{message}");
    // Help is not a failure.
    let help = workshop.punctual(["run", "--json", "--help"]).success();
    assert!(help.starts_with("Simulate a filter's file"), "{help}");
}
