//! `punctual demo`: the numbers that it promises and the files that it leaves. (The README has its output.)

use serde_json::Value;

use crate::workshop::Workshop;

#[test]
fn the_demonstration_keeps_its_promise_and_leaves_everything_behind() {
    let workshop = Workshop::with_library();
    let done = workshop.punctual(["demo", "--out", "demo", "--json"]);
    assert_eq!(done.stderr, "");
    let runs: Value = serde_json::from_str(&done.success()).expect("JSON");
    let runs = runs.as_array().expect("a list");
    assert_eq!(runs.len(), 6);
    for run in runs {
        let (model, method) =
            (run["model"].as_str().expect("a name"), run["method"].as_str().expect("a name"));
        // The paper's method arrives late by what its table says; ours on time, to stay.
        assert_eq!(run["kept"], method == "reference_profile", "{run}");
        for file in [
            format!("{model}-plant.toml"),
            format!("{model}-plant.fmu"),
            format!("{model}-{method}-filter.toml"),
            format!("{model}-{method}-filter.fmu"),
            format!("{model}-{method}.toml"),
            format!("{model}-{method}.csv"),
        ] {
            assert!(workshop.path("demo").join(&file).is_file(), "no {file}");
        }
    }
    let files = std::fs::read_dir(workshop.path("demo")).expect("the folder");
    let pictures =
        files.filter(|e| e.as_ref().is_ok_and(|e| e.path().extension().is_some_and(|x| x == "svg")));
    assert!(pictures.count() >= 3, "a picture for each model");

    // Its files can be run again by hand, and give the same.
    workshop.punctual(["run", "demo/unicycle-reference_profile.toml", "--out", "again"]).success();
    let file = "unicycle-reference_profile.csv";
    assert!(workshop.bytes(&format!("again/{file}")) == workshop.bytes(&format!("demo/{file}")));
}
