//! `punctual demo`: the numbers that it promises and the files that it writes. (The README has its output.)

use serde_json::Value;

use crate::table::Table;
use crate::workshop::Workshop;

/// The run of a vehicle with bounds: it begins in the wrong direction, avoids the rock and stays within the
/// bounds.
fn hindered(workshop: &Workshop, model: &str, run: &Value) {
    let bounds = match model {
        "point_mass" => [5.0, 5.0],
        "unicycle" => [5.0, 1.5],
        _ => [5.0, 0.5],
    };
    let table = Table::parse(&workshop.text(&format!("demo/{model}-plans.csv")));
    for (i, bound) in bounds.into_iter().enumerate() {
        assert!(run["peak"][i].as_f64().is_some_and(|peak| peak <= bound), "{run}");
    }
    let [x, y] = ["plant.x.x_p", "plant.x.y_p"].map(|name| table.column(name));
    let far = |centre: [f64; 2], k: usize| (x[k] - centre[0]).hypot(y[k] - centre[1]);
    assert!(far([45.0, 45.0], 10) > far([45.0, 45.0], 0), "it goes away at first");
    assert!((0..x.len()).all(|k| far([22.0, 24.0], k) >= 5.0), "it keeps clear of the rock");
    assert!((1000..x.len()).all(|k| far([45.0, 45.0], k) <= 2.0), "inside from 10 s on");
    let guaranteed = table.column("filter.goal.guaranteed");
    assert!(guaranteed.iter().all(|flag| *flag == 1.0), "a plan is behind every input");
    assert!(workshop.text(&format!("demo/{model}-plans.html")).contains("Every promise is kept."));
    workshop
        .punctual(["run", &format!("demo/{model}-plans.toml"), "--out", "again", "--require", "kept"])
        .success();
}

#[test]
fn the_demonstration_keeps_its_promise_and_leaves_everything_behind() {
    let workshop = Workshop::with_library();
    let done = workshop.punctual(["demo", "--out", "demo", "--json"]);
    assert_eq!(done.stderr, "");
    let runs: Value = serde_json::from_str(&done.success()).expect("JSON");
    let runs = runs.as_array().expect("a list");
    assert_eq!(runs.len(), 9);
    for run in runs {
        let (model, method) =
            (run["model"].as_str().expect("a name"), run["method"].as_str().expect("a name"));
        // The paper's method arrives late by the time in its table; ours is on time and stays.
        assert_eq!(run["kept"], method != "repeated_root", "{run}");
        if method == "plans" {
            hindered(&workshop, model, run);
            continue;
        }
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

    // Its files can be run again by hand, with the same result.
    workshop.punctual(["run", "demo/unicycle-reference_profile.toml", "--out", "again"]).success();
    let file = "unicycle-reference_profile.csv";
    assert!(workshop.bytes(&format!("again/{file}")) == workshop.bytes(&format!("demo/{file}")));
}
