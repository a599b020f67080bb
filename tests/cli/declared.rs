//! `campaign.uncertainty = "declared"`: plants drawn within what a filter declares.

use punctual_cosim::campaign::Cell;
use punctual_cosim::coupling::{self, Drawn, Model, Own, Simulation, System};
use punctual_fmu::configuration::Configuration;
use serde_json::Value;

use crate::campaigns::rows;
use crate::table::Table;
use crate::workshop::{Workshop, examples};

const FILTER: &str = r#"
kind = "filter"
assurance = "on"
plant.model = "point_mass"
bounds = { u_x = [-4.0, 4.0], u_y = [-4.0, 4.0] }
x0 = { v_x = 1.0 }
u_ref = { u_x = "3 - v_x", u_y = "0" }
uncertainty = { rates = { v_x = 0.05, v_y = 0.05 }, inputs.u_x = { gain = [0.95, 1.05], lag = [0.0, 0.02] } }
measurement_errors = { x_p = 0.01, y_p = 0.01 }
experiment = { step_size = 0.05, stop_time = 8.0 }
[[barrier]]
name = "goal"
centre = [8.0, 3.0]
radius = 2.0
deadline = 6.0
[[barrier]]
name = "rock"
shape = "obstacle"
centre = [4.0, 0.5]
radius = 1.0
"#;

fn campaign(runs: u64, more: &str) -> String {
    format!(
        "system = \"filter.toml\"\n[campaign]\nruns = {runs}\nseed = 3\nuncertainty = \"declared\"\n{more}"
    )
}

fn workshop(filter: &str, campaign: &str) -> Workshop {
    let workshop = Workshop::new();
    workshop.write("filter.toml", filter);
    workshop.write("c.toml", campaign);
    workshop
}

/// The column `name` of all rows, as text.
fn column(workshop: &Workshop, name: &str) -> Vec<String> {
    let (names, rows) = rows(&workshop.path("c.parquet"));
    let at = names.iter().position(|n| n == name).unwrap_or_else(|| panic!("no {name} in {names:?}"));
    let text = |cell: &Cell| match cell {
        Cell::Number(Some(number)) => format!("{number:?}"),
        Cell::Text(Some(text)) => text.clone(),
        Cell::Count(count) => count.to_string(),
        other => format!("{other:?}"),
    };
    rows.iter().map(|row| text(&row[at])).collect()
}

/// Every plant within what is declared keeps what is promised, whatever kind is drawn. Each run is made again bit for bit.
#[test]
fn a_promise_holds_for_every_plant_that_is_drawn() {
    let workshop = workshop(FILTER, &campaign(9, ""));
    let done = workshop.punctual(["campaign", "c.toml", "--json"]);
    assert!(
        done.stderr.contains("note: plant is the model of filter and deviates from it in each run"),
        "{done:#?}"
    );
    let report: Value = serde_json::from_str(&done.success()).expect("JSON");
    let fates = &report["declared"][0];
    assert_eq!(
        (&fates["filter"], &fates["promised"], &fates["broken"]),
        (&"filter".into(), &9.into(), &0.into())
    );
    assert_eq!((&fates["kept"], &fates["withdrawn"]), (&9.into(), &0.into()), "{report:#}");
    assert_eq!(column(&workshop, "filter.promise"), vec!["kept"; 9]);
    let mut kinds = column(&workshop, "plant.uncertainty.kind");
    let seeds = column(&workshop, "seed").into_iter().map(|seed| format!("{seed}.0"));
    assert_eq!(column(&workshop, "plant.uncertainty.seed"), seeds.collect::<Vec<_>>());
    kinds.sort_unstable();
    kinds.dedup();
    assert_eq!(kinds, ["1.0", "2.0", "3.0"]);
    for barrier in ["goal", "rock"] {
        let least = column(&workshop, &format!("filter.{barrier}.least_guaranteed_h"));
        assert!(least.iter().all(|h| h.parse().is_ok_and(|h: f64| h >= 0.0)), "{least:?}");
        let mut different = least.clone();
        different.sort_unstable();
        different.dedup();
        assert_eq!(different.len(), least.len(), "each plant differs: {least:?}");
    }
    let text = workshop.punctual(["campaign", "c.toml"]).success();
    assert!(
        text.contains(
            "filter: 9 promised; with plants within what is declared 9 kept, 0 withdrawn, 0 broken"
        ),
        "{text}"
    );
    for run in ["0", "4"] {
        let again = workshop.punctual(["replay", "c.parquet", "--run", run, "--out", "out"]).success();
        assert!(again.contains("the row is as recorded, bit for bit"), "{again}");
    }
}

/// The draws go as far as they are declared: plants that do ten times as much as the filter knows lose its promises.
#[test]
fn plants_that_do_more_than_is_declared_lose_the_promise() {
    let Configuration::Filter(filter) = Configuration::parse(FILTER).expect("a filter") else {
        panic!("no filter")
    };
    let (text, configurations) = coupling::alone(Configuration::Filter(filter)).expect("a system");
    let system = System::parse(&text).expect("a system");
    let own = |configuration| {
        let own = Own::new(configuration).expect("a component");
        Model::Own(Box::new(own), "filter.toml".into())
    };
    let mut models: Vec<_> = configurations.into_iter().map(own).collect();
    let mut lost = |times: f64, seed: u64| {
        let (of, descriptions): (Vec<_>, Vec<_>) =
            models.iter().map(|m| (m.configuration(), m.description())).unzip();
        let drawn = coupling::deviations(&system, &descriptions, &of).expect("a plant to draw");
        let [Drawn { plant, configuration, .. }] = &drawn[..] else { panic!("one plant") };
        let mut configuration = configuration.clone();
        let deviation = configuration.deviation.as_mut().expect("a plant that deviates");
        deviation.rates.iter_mut().for_each(|rate| *rate *= times);
        deviation.seed = seed as f64;
        // The plant is the model again for the next one.
        let nominal = std::mem::replace(&mut models[*plant], own(Configuration::Plant(configuration)));
        let mut simulation = Simulation::of(&system, &models).expect("a system that runs");
        let outcome = simulation.run(|_, _| ()).expect("a run");
        models[*plant] = nominal;
        outcome.promises.iter().any(|promise| promise.guaranteed == Some(false))
    };
    assert_eq!((0..3).filter(|seed| lost(1.0, *seed)).count(), 0);
    assert_eq!((0..3).filter(|seed| lost(10.0, *seed)).count(), 3);
}

#[test]
fn what_is_declared_cannot_be_varied() {
    let vary = "[vary.\"filter.uncertainty.rate.v_x\"]\ndistribution = \"choice\"\nvalues = [0.005]\n";
    let workshop = workshop(FILTER, &campaign(6, vary));
    workshop.punctual(["campaign", "c.toml"]).fails(
        2,
        "c.toml: vary.\"filter.uncertainty.rate.v_x\": cannot be varied where `campaign.uncertainty` is \"declared\": the plant is drawn \
         within what the file of the filter states",
    );
}

/// A run at the ends of what is declared: the input, the rates and the measurements differ, and h of the plant as it is is recorded.
#[test]
fn a_run_at_the_ends_of_what_is_declared() {
    let workshop = workshop(FILTER, &campaign(1, ""));
    let run = |seed: &str| {
        let done = workshop.punctual(["run", "filter.toml", "--out", "out", "--uncertainty", seed]);
        assert_eq!(done.code, 0, "{done:#?}");
        workshop.text("out/filter.csv")
    };
    let (one, again, other) = (run("1"), run("1"), run("2"));
    assert!(one == again && one != other);
    let table = Table::parse(&one);
    let (least, seen) = (table.column("plant.least_h.rock"), table.column("filter.rock.h"));
    assert_eq!(least.len(), seen.len());
    // h falls by less than 0.3 m in a step of 50 ms, and a measurement is off by at most 1.5 cm.
    assert!(least.iter().zip(&seen).all(|(least, seen)| (least - seen).abs() < 0.3), "{least:?}, {seen:?}");
    assert!(least.iter().skip(1).zip(&seen).any(|(least, seen)| least != seen));
    let nominal = workshop.punctual(["run", "filter.toml", "--out", "nominal"]);
    assert_eq!(nominal.code, 0, "{nominal:#?}");
    assert!(!workshop.text("nominal/filter.csv").contains("least_h"));
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let refused = |filter: &str, file: &str, message: &str| {
        let workshop = workshop(filter, file);
        workshop
            .punctual(["campaign", "c.toml"])
            .fails(2, &format!("c.toml: campaign.uncertainty: {message}"));
    };
    let nothing =
        FILTER.lines().filter(|line| !line.starts_with("uncertainty") && !line.starts_with("measurement"));
    refused(
        &nothing.collect::<Vec<_>>().join("\n"),
        &campaign(1, ""),
        "has no plant to draw: no filter of the system declares [uncertainty], [measurement_errors] or actuation_delay",
    );
    let follows = FILTER.replacen("radius", "centre_input = true\nacceleration = 0.1\nradius", 1);
    refused(
        &follows,
        &campaign(1, ""),
        "has no plant to draw within what filter declares: goal follows a centre that moves by itself, and how that moves is not \
         drawn yet",
    );
    let rows = FILTER.replace("\"on\"", "\"off\"").replace("uncertainty = {", "# {");
    refused(
        &rows,
        &campaign(1, ""),
        "has no plant to draw within what filter declares: no plans are followed, which alone account for it: assurance is \"off\"",
    );
    let workshop = workshop(FILTER, &campaign(1, ""));
    workshop.write("c.toml", campaign(1, "success = \"on_time_and_inside\"\n"));
    let rare = workshop.punctual(["campaign", "c.toml", "--rare"]);
    let message = "error: campaign.uncertainty: is \"declared\", must be \"none\" for --rare, which draws from [vary] and the noise of \
                   plants alone\n";
    assert!(rare.code == 2 && rare.stderr.ends_with(message), "{rare:#?}");
    workshop.write("c.toml", campaign(1, "").replace("\"declared\"", "\"some\""));
    workshop
        .punctual(["campaign", "c.toml"])
        .fails(2, "c.toml: campaign.uncertainty: is \"some\", must be \"none\" or \"declared\" (did you mean none?) (line 5)");
    // The same signals, and another mass.
    workshop.write(
        "plant.toml",
        "kind = \"plant\"\n[plant]\nstates = [{ name = \"x_p\", unit = \"m\" }, { name = \"y_p\", unit = \"m\" }, \
         { name = \"v_x\", unit = \"m/s\" }, { name = \"v_y\", unit = \"m/s\" }]\n\
         inputs = [{ name = \"u_x\", unit = \"m/s2\" }, { name = \"u_y\", unit = \"m/s2\" }]\n\
         derivatives = { x_p = \"v_x\", y_p = \"v_y\", v_x = \"0.9 * u_x\", v_y = \"0.9 * u_y\" }\n",
    );
    workshop.write(
        "c.toml",
        campaign(1, "").replace("system = \"filter.toml\"\n", "")
            + "[system.experiment]\nstop_time = 1.0\nstep = 0.05\n\
               [[system.component]]\nname = \"filter\"\nfmu = \"filter.toml\"\n\
               [[system.component]]\nname = \"plant\"\nfmu = \"plant.toml\"\n\
               [[system.connect_by_name]]\ncomponents = [\"filter\", \"plant\"]\n",
    );
    workshop.punctual(["campaign", "c.toml"]).fails(
        2,
        "c.toml: campaign.uncertainty: has no plant to draw within what filter declares: plant is not the model of the filter, from which \
         it would be drawn",
    );
}

/// The example declares and simulates. The campaign draws in place of what it simulates.
#[test]
fn the_example_can_be_drawn() {
    let windy = std::fs::read_to_string(examples().join("windy.toml")).expect("an example");
    let workshop = workshop(&windy.replace("stop_time = 12.0", "stop_time = 1.0"), &campaign(2, ""));
    workshop.punctual(["campaign", "c.toml"]).success();
    assert_eq!(column(&workshop, "filter.promise"), ["kept", "kept"]);
}

/// With `jitter` a step is late by at most that part of one, or early, and every run draws its own. The promise holds all the same.
#[test]
fn steps_are_drawn_where_a_filter_declares_jitter() {
    const JITTER: f64 = 0.1;
    const STEP: f64 = 0.05;
    let exact = FILTER.lines().filter(|line| !line.starts_with("measurement_errors")).map(|line| match line
        .starts_with("uncertainty")
    {
        true => format!("uncertainty = {{ rates = {{ v_x = 0.02 }}, jitter = {JITTER} }}"),
        false => line.to_owned(),
    });
    let workshop = workshop(&exact.collect::<Vec<_>>().join("\n"), &campaign(6, ""));
    let run = |seed: &str| {
        let done = workshop.punctual(["run", "filter.toml", "--out", "out", "--uncertainty", seed]);
        assert_eq!(done.code, 0, "{done:#?}");
        let table = Table::parse(&workshop.text("out/filter.csv"));
        assert!(table.column("filter.goal.guaranteed").iter().all(|flag| *flag == 1.0), "{seed}");
        table.column("time")
    };
    let (mut longest, mut shortest) = (0.0_f64, f64::INFINITY);
    for seed in ["1", "2", "3", "4"] {
        let times = run(seed);
        assert_eq!((times[0], times[times.len() - 1]), (0.0, 8.0));
        // The last step ends at the stop time, and may be short.
        let steps: Vec<f64> = times.windows(2).map(|two| two[1] - two[0]).collect();
        for step in &steps[..steps.len() - 1] {
            (longest, shortest) = (longest.max(*step), shortest.min(*step));
        }
    }
    // Round-off of times up to 8 s.
    assert!((longest - (1.0 + JITTER) * STEP).abs() < 1e-12, "{longest}");
    assert!((shortest - 0.2 * STEP).abs() < 1e-12, "{shortest}");
    assert_eq!(run("1"), run("1"));
    workshop.punctual(["campaign", "c.toml"]).success();
    assert_eq!(column(&workshop, "filter.promise"), vec!["kept"; 6]);
}

/// The plant of a filter's file gets each input as late as the file says, and the filter knows.
#[test]
fn a_declared_delay_is_simulated() {
    let exact = FILTER
        .lines()
        .filter(|line| !line.starts_with("measurement_errors") && !line.starts_with("uncertainty"));
    let exact = exact.collect::<Vec<_>>().join("\n");
    let run = |text: &str| {
        let workshop = workshop(text, "");
        let done = workshop.punctual(["run", "filter.toml", "--out", "out", "--require", "guaranteed"]);
        assert_eq!(done.code, 0, "{done:#?}");
        let table = Table::parse(&workshop.text("out/filter.csv"));
        (done.stderr, table.column("plant.x.v_x"), table.column("filter.u.u_x")[0])
    };
    for (delay, step) in [(0.03, 1), (0.12, 3)] {
        let late = exact.replacen("[[barrier]]", &format!("actuation_delay = {delay}\n[[barrier]]"), 1);
        let (said, v, u) = run(&late);
        // v = 1 + u (t − delay) after the step in which the first input acts: nothing acts before. Round-off of the integration.
        let acted = 0.05 * f64::from(step) - delay;
        assert!((v[step as usize] - (1.0 + u * acted)).abs() < 1e-9 && u != 0.0, "{v:?}, {u}");
        let wanted = format!("each input acts {delay} s after its sample, as actuation_delay says");
        assert!(said.contains(&wanted), "{said}");
    }
    let (said, v, u) = run(&exact);
    assert!((v[1] - (1.0 + u * 0.05)).abs() < 1e-9, "{v:?}, {u}");
    assert!(!said.contains("actuation_delay"), "{said}");
}
