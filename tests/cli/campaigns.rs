//! `punctual campaign` and `punctual replay`: rows compared with `punctual run`, interruption at any point,
//! errors.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use punctual_cosim::campaign::{self, Campaign, Cell, Measures, Row};
use serde_json::Value;

use crate::html::{body, cells, data};
use crate::misbehaving;
use crate::table::Table;
use crate::workshop::{Workshop, examples};

/// Communication step in s: coarse, for speed.
const STEP: &str = "step = 0.05";

/// The example's system in these steps.
fn system() -> String {
    crate::running::system(&[("step = 0.001", STEP), ("stop_time = 20.0", "stop_time = 12.0")])
}

/// A campaign of `runs` runs over starts and bounds. 0.1 m/s2 in both directions is too little, 20 in either
/// is enough, and a lower bound above the upper one is refused.
fn file(runs: u64, sampling: &str) -> String {
    format!(
        "system = \"system.toml\"\n[campaign]\nruns = {runs}\nseed = 7\nsampling = \"{sampling}\"\n\
         [vary.\"plant.x0.x_p\"]\ndistribution = \"uniform\"\nmin = 0\nmax = 20\n\
         [vary.\"plant.x0.v\"]\ndistribution = \"normal\"\nmean = 0\ndeviation = 2\n\
         [vary.\"plant.inner_step\"]\ndistribution = \"choice\"\nvalues = [0.05]\n\
         [vary.\"filter.u_min.a\"]\ndistribution = \"choice\"\nvalues = [-20, -0.1, -0.1, 30]\n\
         [vary.\"filter.u_max.a\"]\ndistribution = \"choice\"\nvalues = [0.1, 0.1, 20]\n"
    )
}

/// A workshop with the FMUs of the example.
fn with_fmus(runs: u64, sampling: &str) -> Workshop {
    let workshop = Workshop::with_fmus();
    workshop.write("system.toml", system());
    workshop.write("c.toml", file(runs, sampling));
    workshop
}

/// A workshop with the configurations in place of the FMUs, so that nothing is unpacked.
fn workshop(runs: u64, sampling: &str) -> Workshop {
    let workshop = Workshop::new();
    for name in ["filter", "plant"] {
        let example = examples().join(format!("unicycle-{name}.toml"));
        workshop.write(&format!("{name}.toml"), fs::read(example).expect("an example"));
    }
    workshop.write("system.toml", system().replace(".fmu\"", ".toml\""));
    workshop.write("c.toml", file(runs, sampling));
    workshop
}

/// All rows of a result, and the names of its columns.
pub(crate) fn rows(path: &Path) -> (Vec<String>, Vec<Row>) {
    let (reader, source) = campaign::recorded(path).expect("a result");
    let measures = Measures::new(&Campaign::of(source, path, path).expect("its campaign")).expect("names");
    let rows = (0..reader.groups()).flat_map(|g| reader.group(g, measures.columns()).expect("a group"));
    (measures.columns().iter().map(|c| c.name.clone()).collect(), rows.collect())
}

fn number(cell: &Cell) -> Option<f64> {
    match cell {
        Cell::Number(number) => *number,
        Cell::Count(count) => Some(*count as f64),
        Cell::Flag(flag) => Some(f64::from(u8::from(*flag))),
        Cell::Text(_) => None,
    }
}

/// Compares a row with the findings of `punctual run` with the library of an FMU, from the start that
/// `--list` reports. Every recorded signal agrees bitwise, and each measure agrees by its definition.
#[test]
fn a_row_is_what_a_run_of_the_fmus_finds() {
    let workshop = with_fmus(8, "latin_hypercube");
    workshop.punctual(["campaign", "c.toml"]).success();
    let (names, rows) = rows(&workshop.path("c.parquet"));
    assert_eq!(rows.len(), 8);
    let listed: Value = serde_json::from_str(
        &workshop.punctual(["campaign", "c.toml", "--list", "0..8", "--json"]).success(),
    )
    .expect("JSON");
    let (mut successes, mut refused) = (0, 0);
    for (k, row) in rows.iter().enumerate() {
        let cell =
            |name: &str| &row[names.iter().position(|n| n == name).unwrap_or_else(|| panic!("no {name}"))];
        let of = |name: &str| number(cell(name));
        let drawn = &listed[k];
        assert_eq!((drawn["run"].as_u64(), of("run")), (Some(k as u64), Some(k as f64)));
        assert_eq!(drawn["seed"].as_u64().map(|seed| seed as f64), of("seed"));
        let start = |component: &str| {
            let values = drawn["values"].as_object().expect("a table");
            let own = values.iter().filter_map(|(name, value)| {
                assert_eq!(value.as_f64(), of(name), "{name}");
                Some(format!("\"{}\" = {:?}", name.strip_prefix(&format!("{component}."))?, value.as_f64()?))
            });
            own.collect::<Vec<_>>().join(", ")
        };
        let mut text = system();
        for component in ["filter", "plant"] {
            let fmu = format!("fmu = \"{component}.fmu\"");
            text = text.replace(&fmu, &format!("{fmu}\nstart = {{ {} }}", start(component)));
        }
        workshop.write("one.toml", text);
        let done = workshop.punctual(["run", "one.toml", "--out", "one", "--json", "--require", "nothing"]);
        if of("filter.u_min.a") > of("filter.u_max.a") {
            refused += 1;
            assert_eq!(done.code, 1, "{done:?}");
            let Cell::Text(Some(failure)) = cell("failure") else { panic!("run {k} did not fail") };
            assert!(
                failure.starts_with("fmi2ExitInitializationMode of filter at t = 0 s was refused: "),
                "{failure}"
            );
            assert_eq!((of("success"), of("filter.status.filtered")), (Some(0.0), Some(0.0)));
            continue;
        }
        let report: Value = serde_json::from_str(&done.success()).expect("JSON");
        let run = k.to_string();
        workshop.punctual(["replay", "c.parquet", "--run", &run, "--out", "again"]).success();
        assert_eq!(workshop.text(&format!("again/c-{k}.csv")), workshop.text("one/one.csv"), "run {k}");

        let table = Table::parse(&workshop.text("one/one.csv"));
        let column = |name: &str| table.column(name);
        let peak = |name: &str| column(name).iter().fold(0.0, |peak: f64, u| peak.max(u.abs()));
        assert_eq!(of("filter.peak.a"), Some(peak("filter.u.a")));
        assert_eq!(of("filter.peak.omega"), Some(peak("filter.u.omega")));
        for (status, name) in [(0.0, "unchanged"), (1.0, "filtered"), (2.0, "infeasible")] {
            let count = column("filter.status").iter().filter(|s| **s == status).count();
            assert_eq!(of(&format!("filter.status.{name}")), Some(count as f64), "run {k}, {name}");
        }
        let (time, h) = (column("time"), column("filter.goal.h"));
        let after = time.iter().zip(&h).filter(|(t, _)| **t >= 10.0 - 1e-9).map(|(_, h)| *h);
        let least = after.fold(f64::INFINITY, f64::min);
        assert_eq!(
            (of("filter.goal.least_h"), of("filter.goal.inside")),
            (Some(least), Some(f64::from(least >= 0.0)))
        );
        let promise = &report["promises"][0];
        for (field, name) in
            [("arrival", "arrival"), ("late", "late"), ("unmet", "unmet"), ("violation", "violation")]
        {
            assert_eq!(of(&format!("filter.goal.{name}")), promise[field].as_f64(), "run {k}, {field}");
        }
        let on_time = promise["arrival"].as_f64().is_some_and(|arrival| arrival <= 10.0 + 1e-9);
        assert_eq!(of("filter.goal.on_time"), Some(f64::from(on_time)));
        let kept = promise["late"].is_null() && promise["left"].is_null() && promise["unmet"] == 0;
        assert_eq!((of("success"), of("filter.goal.kept")), (Some(f64::from(kept)), Some(f64::from(kept))));
        successes += usize::from(kept);
    }
    assert!(
        successes > 0 && refused > 0 && successes + refused < 8,
        "{successes}, {refused}: all kinds are there"
    );
}

/// Starts a campaign in the background.
fn begin(workshop: &Workshop, more: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_punctual"))
        .args(["campaign", "c.toml", "-o", "cut.parquet"])
        .args(more)
        .current_dir(workshop.path(""))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary under test starts")
}

/// The runs in the segments so far.
fn kept(workshop: &Workshop) -> u64 {
    let Ok(entries) = fs::read_dir(workshop.path("cut.parquet.parts")) else { return 0 };
    let names = entries.flatten().map(|e| e.file_name().to_string_lossy().into_owned());
    let next = |name: String| name.strip_suffix(".parquet")?.rsplit('-').next()?.parse().ok();
    names.filter_map(next).max().unwrap_or(0)
}

/// Waits until more than `kept_before` runs are kept, and `more` after that.
fn wait(workshop: &Workshop, child: &mut Child, kept_before: u64, more: Duration) {
    let begin = Instant::now();
    while kept(workshop) <= kept_before {
        assert!(begin.elapsed() < Duration::from_secs(60), "no segment in a minute");
        assert!(child.try_wait().expect("a child").is_none(), "it was done before it could be ended");
        thread::sleep(Duration::from_millis(1));
    }
    thread::sleep(more);
}

/// Enough runs to be interrupted three times, but not many more, since a debug build is slow.
const MANY: u64 = if cfg!(debug_assertions) { 120 } else { 40_000 };

/// Killed, interrupted, and killed again, on one and on two threads, it gives the same file.
#[test]
fn a_campaign_can_be_ended_at_any_point() {
    let workshop = workshop(MANY, "random");
    workshop.write("system.toml", workshop.text("system.toml").replace(STEP, "step = 0.25"));
    let mut before = 0;
    // Any instant between two segments.
    let moment = || {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970");
        Duration::from_micros(u64::from(now.subsec_nanos()) % 20_000)
    };
    for (threads, ending) in [("1", "-KILL"), ("2", "-INT"), ("2", "-KILL")] {
        let report: &[&str] = if ending == "-INT" { &["--report"] } else { &[] };
        let mut child = begin(&workshop, &[&["--threads", threads], report].concat());
        wait(&workshop, &mut child, before, moment());
        let sent = Command::new("kill").args([ending, &child.id().to_string()]).status().expect("kill");
        assert!(sent.success());
        let code = child.wait().expect("a child").code();
        assert_eq!(code, (ending == "-INT").then_some(130));
        before = kept(&workshop);
        assert!(before > 0 && before < MANY, "{before}");
        // A page with the rows so far, and no others.
        assert_eq!(workshop.path("cut.html").exists(), ending == "-INT" || threads == "2");
        if ending == "-INT" {
            let page = workshop.text("cut.html");
            assert!(page.contains(&format!("Interrupted: {before} of {MANY} runs are made.")), "{before}");
            let runs = data(&page, "scene")["runs"].as_array().map_or(0, Vec::len) as u64;
            assert!(runs > 0 && runs <= before, "{runs} of {before}");
        }
    }
    // Another campaign does not resume from there.
    workshop.write("c.toml", file(MANY, "random") + "# another\n");
    let folder = "cut.parquet.parts";
    let begin_of_message = format!("--output: {folder} is of another campaign (fingerprint ");
    workshop.punctual(["campaign", "c.toml", "-o", "cut.parquet"]).fails_like(
        2,
        &begin_of_message,
        &["Remove it, or give another output"],
    );
    workshop.write("c.toml", file(MANY, "random"));

    let resumed = workshop.punctual(["campaign", "c.toml", "-o", "cut.parquet", "--json"]);
    assert_eq!(resumed.stderr, format!("note: {before} of {MANY} runs already existed\n"));
    let report: Value = serde_json::from_str(&resumed.success()).expect("JSON");
    assert!(!workshop.path(folder).exists());
    workshop.punctual(["campaign", "c.toml", "-o", "whole.parquet", "--threads", "1"]).success();
    assert!(workshop.bytes("cut.parquet") == workshop.bytes("whole.parquet"), "the bytes differ");

    // A complete campaign is not repeated, and its file is kept.
    let again: Value = serde_json::from_str(
        &workshop.punctual(["campaign", "c.toml", "-o", "cut.parquet", "--json"]).success(),
    )
    .expect("JSON");
    assert_eq!((&again["success"], &again["wall_time"]), (&report["success"], &0.0.into()));
    workshop.write("c.toml", file(MANY - 1, "random"));
    workshop.punctual(["campaign", "c.toml", "-o", "cut.parquet"]).fails_like(
        2,
        "--output: cut.parquet is of another campaign",
        &[],
    );

    // The summary, compared with the rows.
    let (names, rows) = rows(&workshop.path("whole.parquet"));
    let success = names.iter().position(|n| n == "success").expect("a column");
    let count = rows.iter().filter(|row| matches!(row[success], Cell::Flag(true))).count();
    assert_eq!(
        (report["success"]["count"].as_u64(), report["runs"].as_u64()),
        (Some(count as u64), Some(MANY))
    );
    // A third of the bounds is too little and a quarter contradictory, so at most half succeed, within
    // 1/√(4·120) = 0.046 for 120 runs; the tolerance is five of these.
    let rate = count as f64 / MANY as f64;
    assert!(rate > 0.0 && rate < 0.5 + 5.0 * 0.046, "{rate}");
    let worst = report["worst"].as_array().expect("a list");
    assert_eq!((worst.len(), &worst[0]["success"]), (10, &false.into()));
}

/// Rows whose segments are damaged or missing are made again, but no others.
#[test]
fn what_is_damaged_among_the_rows_kept_is_made_again() {
    let workshop = workshop(20, "random");
    workshop.punctual(["campaign", "c.toml", "-o", "whole.parquet"]).success();
    let (reader, _) = campaign::recorded(&workshop.path("whole.parquet")).expect("a result");
    let segment = |first: u64, next: u64| {
        let (runs, part) = (format!("{first}..{next}"), format!("{first}-{next}"));
        workshop.punctual(["campaign", "c.toml", "--shard", &runs, "-o", &part]).success();
        let name = format!("cut.parquet.parts/runs-{first:016}-{next:016}.parquet");
        fs::rename(workshop.path(&part), workshop.path(&name)).expect("a file");
        name
    };
    let resumed = || workshop.punctual(["campaign", "c.toml", "-o", "cut.parquet"]);
    let begin = || {
        fs::create_dir(workshop.path("cut.parquet.parts")).expect("a folder");
        let fingerprint = reader.text("punctual.fingerprint").expect("one");
        workshop.write("cut.parquet.parts/fingerprint", fingerprint);
    };
    let is_whole = || {
        assert!(workshop.bytes("cut.parquet") == workshop.bytes("whole.parquet"), "the bytes differ");
        assert!(!workshop.path("cut.parquet.parts").exists());
        fs::remove_file(workshop.path("cut.parquet")).expect("a file");
    };
    // Of 20 runs, 3 are in half a file, 4 in one with a flipped bit, 5 in none. 8 are kept.
    begin();
    segment(0, 2);
    let (half, flipped) = (segment(2, 5), segment(5, 9));
    segment(14, 20);
    let bytes = workshop.bytes(&half);
    workshop.write(&half, &bytes[..bytes.len() / 2]);
    let mut bytes = workshop.bytes(&flipped);
    // The seed of a run: a random number, which is stored verbatim.
    let (_, rows) = rows(&workshop.path("whole.parquet"));
    let Cell::Count(seed) = rows[6][1] else { panic!("a seed is a count") };
    let at = bytes.windows(8).position(|w| w == seed.to_le_bytes()).expect("the seed of run 6");
    bytes[at] ^= 1;
    workshop.write(&flipped, bytes);
    let made = resumed();
    assert_eq!(
        made.stderr,
        "note: 8 of 20 runs already existed\nnote: the kept rows of 7 runs were damaged; these were made again\n"
    );
    made.success();
    is_whole();
    // A duplicate run is reported.
    begin();
    segment(3, 8);
    let twice = segment(7, 9);
    resumed().fails_like(2, &format!("cannot use {twice}: "), &["its runs 7..9 are there twice"]);
    fs::remove_file(workshop.path(&twice)).expect("a file");
    assert_eq!(resumed().stderr, "note: 5 of 20 runs already existed\n");
    is_whole();
}

/// A row that differs from its run is reported, with the column.
#[test]
fn a_row_that_was_changed_is_told() {
    let workshop = workshop(20, "sobol");
    let text = workshop.punctual(["campaign", "c.toml", "--require", "success", "--worst", "3"]);
    assert_eq!(text.code, 1, "some fail");
    assert!(text.stdout.starts_with("20 runs in "), "{}", text.stdout);
    assert!(
        text.stdout.contains("again, with pictures: punctual replay c.parquet --run "),
        "{}",
        text.stdout
    );
    let (names, rows) = rows(&workshop.path("c.parquet"));
    let column = names.iter().position(|n| n == "plant.x0.x_p").expect("a column");
    // The least and the greatest number are also in the statistics.
    let mut sorted: Vec<f64> = rows.iter().filter_map(|row| number(&row[column])).collect();
    sorted.sort_by(f64::total_cmp);
    let value = sorted[10];
    let run = rows.iter().position(|row| number(&row[column]) == Some(value)).expect("a row").to_string();
    let same = workshop.punctual(["replay", "c.parquet", "--run", &run, "--out", "out", "--units"]).success();
    assert!(same.contains("the row is as recorded, bit for bit"), "{same}");
    assert!(
        workshop.text(&format!("out/c-{run}-filter.goal.svg")).trim_end().ends_with("</svg>"),
        "a picture of h"
    );
    let table = workshop.text(&format!("out/c-{run}.csv"));
    assert!(table.lines().nth(1).is_some_and(|units| units.starts_with("s,")), "the units");
    // The last bit of the number.
    let mut bytes = workshop.bytes("c.parquet");
    let old = value.to_le_bytes();
    let places: Vec<usize> = (0..bytes.len() - 8).filter(|&i| bytes[i..i + 8] == old).collect();
    assert_eq!(places.len(), 1, "{value} in the file");
    bytes[places[0]] ^= 1;
    workshop.write("changed.parquet", bytes);
    let done = workshop.punctual(["replay", "changed.parquet", "--run", &run, "--json"]);
    assert_eq!(done.code, 1, "{done:?}");
    let report: Value = serde_json::from_str(&done.stdout).expect("JSON");
    let differences = report["differences"].as_array().expect("a list");
    assert_eq!((&report["same"], differences.len()), (&false.into(), 1), "{report}");
    assert_eq!(
        (&differences[0]["column"], &differences[0]["found"]),
        (&"plant.x0.x_p".into(), &value.to_string().into())
    );
    workshop.punctual(["replay", "c.parquet", "--run", "20"]).fails(2, "--run: is 20, must be from 0 to 19");
    workshop.punctual(["replay", "c.toml", "--run", "0"]).fails_like(2, "cannot read c.toml: ", &[]);
}

/// The draws depend only on the file and the number.
#[test]
fn runs_are_listed_as_they_are_drawn() {
    for sampling in ["random", "latin_hypercube", "sobol"] {
        let workshop = workshop(1 << 20, sampling);
        let list = |range: &str| workshop.punctual(["campaign", "c.toml", "--list", range]).success();
        let all = list("0..300");
        let head = "run,seed,filter.u_max.a,filter.u_min.a,plant.inner_step,plant.x0.v,plant.x0.x_p\n0,";
        assert!(all.starts_with(head), "{all}");
        let line = all.lines().nth(1 + 250).expect("a line").to_owned();
        assert_eq!(list("250..251").lines().nth(1), Some(line.as_str()));
        assert!(list("1048575..1048576").lines().nth(1).is_some_and(|line| line.starts_with("1048575,")));
    }
    let workshop = workshop(10, "random");
    let list = |range| workshop.punctual(["campaign", "c.toml", "--list", range]);
    list("0..11").fails(2, "--list: ends at 11, must be at most 10, the number of runs");
    list("5..5").fails_like(2, "invalid value '5..5' for '--list <FIRST..LAST>': ", &["has no run"]);
    list("5").fails_like(2, "invalid value '5' for '--list <FIRST..LAST>': ", &["not of the form"]);
}

#[test]
fn each_defect_is_told_with_its_field() {
    let campaign = |from: &str, to: &str| {
        let workshop = workshop(10, "random");
        let text = file(10, "random");
        assert!(text.contains(from), "{from}");
        workshop.write("c.toml", text.replacen(from, to, 1));
        workshop.punctual(["campaign", "c.toml"])
    };
    let fails = |from: &str, to: &str, field: &str, part: &str| {
        campaign(from, to).fails_like(2, &format!("c.toml: {field}: "), &[part]);
    };
    fails("runs = 10", "", "campaign.runs", "missing, it must be given");
    fails("runs = 10", "runs = 0", "campaign.runs", "is 0, must be from 1 to 9007199254740992");
    fails("seed = 7", "seed = -7", "campaign.seed", "is -7, must be a whole number >= 0");
    fails("seed = 7", "sead = 7", "campaign.sead", "is an unknown key (did you mean seed?)");
    fails("\"random\"", "\"halton\"", "campaign.sampling", "is \"halton\", must be \"random\", ");
    fails("seed = 7", "step = nan", "campaign.step", "is NaN; must be finite");
    fails("seed = 7", "stop_time = -1.0", "campaign.stop_time", "is -1 s; must be after start_time = 0 s");
    fails("\"system.toml\"", "3", "system", "is 3, must be the name of a system file or a table like one");
    let x = "vary.\"plant.x0.x_p\"";
    fails("max = 20", "max = nan", &format!("{x}.max"), "is NaN, must be finite");
    let varied = |name: &str, part: &str| {
        fails("plant.x0.x_p", name, &format!("vary.{name:?}"), part);
    };
    varied("plant.x0.q", "plant (plant.toml) has no variable \"x0.q\"");
    varied("plan.x0.x_p", "no component \"plan\"; there are filter, plant");
    varied(
        "filter.goal.h",
        "is of type Real and causality output; only Real parameters and inputs can be varied",
    );
    varied(
        "filter.rearm",
        "is of type Boolean and causality input; only Real parameters and inputs can be varied",
    );
    varied("filter.x.v", "is an input whose values come from plant.x.v");
    let deadline = "vary.\"filter.goal.deadline\".min";
    fails("plant.x0.x_p", "filter.goal.deadline", deadline, "is 0, must be finite and >= 1e-9");
    varied("plant.x0.xp", "has no variable \"x0.xp\" (did you mean x0.x_p?)");
    let quotes = "a name with dots is written in quotes, [vary.\"plant.x0.x_p\"]";
    fails("\"plant.x0.x_p\"", "plant.x0.x_p", "vary.plant.x0.x_p", quotes);
    fails("seed = 7", "stop_time = 1e300", "campaign.step", "up to stop_time = 1e300 s; at most 1e12");
    fails("\"system.toml\"", "\"nothing.toml\"", "system", "there is no file nothing.toml");

    let workshop = workshop(10, "random");
    workshop.write("old.parquet", "no Parquet");
    workshop.punctual(["campaign", "c.toml", "-o", "old.parquet"]).fails_like(
        2,
        "--output: old.parquet already exists: ",
        &["it is not a Parquet file", "remove it, or give another output"],
    );
    // A column for each number of a barrier, and for the peak of each input.
    workshop.write(
        "own.toml",
        "kind = \"filter\"\nname = \"own\"\n\
         [plant]\nstates = [{ name = \"p\" }]\ninputs = [{ name = \"left\", min = -1, max = 1 }]\nderivatives = { p = \"left\" }\n\
         [[barrier]]\nname = \"peak\"\nexpression = \"1 - p\"\n",
    );
    workshop.write("c.toml", "system = \"own.toml\"\n[campaign]\nruns = 1\n");
    workshop.punctual(["campaign", "c.toml"]).fails(
        2,
        "component: two columns of a row are called filter.peak.left; rename the barrier or the input",
    );
}

/// The numbers of a JSON list; NaN for anything else.
fn numbers(list: &Value) -> Vec<f64> {
    list.as_array().expect("a list").iter().map(|v| v.as_f64().unwrap_or(f64::NAN)).collect()
}

/// The page of a campaign, compared with its rows.
#[test]
fn a_report_has_the_runs_and_how_to_see_them_again() {
    /// One of them arrives late.
    const RUNS: u32 = 56;
    let workshop = workshop(u64::from(RUNS), "sobol");
    let report = workshop.punctual(["campaign", "c.toml", "--report", "--json"]).success();
    let report: Value = serde_json::from_str(&report).expect("JSON");
    assert_eq!(report["report"], serde_json::json!(["c.html", "c.svg"]));
    let (names, rows) = rows(&workshop.path("c.parquet"));
    let column = |name: &str| -> Vec<Option<f64>> {
        let c = names.iter().position(|n| n == name).unwrap_or_else(|| panic!("no {name}"));
        rows.iter().map(|row| number(&row[c])).collect()
    };
    let count = |name: &str| column(name).iter().filter(|flag| **flag == Some(1.0)).count();
    let page = workshop.text("c.html");
    // The SVG namespace is not an address that is requested.
    assert!(!page.replace("http://www.w3.org/2000/svg", "").contains("http"), "an address");
    // Every run is included, and every quantity that differs is an axis.
    let scene = data(&page, "scene");
    assert_eq!(numbers(&scene["runs"]), (0..RUNS).map(f64::from).collect::<Vec<_>>());
    let good: Vec<Option<f64>> = scene["good"]
        .as_array()
        .expect("a list")
        .iter()
        .map(|good| good.as_bool().map(|good| f64::from(u8::from(good))))
        .collect();
    assert_eq!(good, column("success"));
    let axes = scene["axes"].as_array().expect("a list");
    let labels: Vec<&str> = axes.iter().filter_map(|axis| axis["label"].as_str()).collect();
    assert_eq!(
        labels[..4],
        ["filter.u_max.a (m/s2)", "filter.u_min.a (m/s2)", "plant.x0.v (m/s)", "plant.x0.x_p (m)"],
        "what was varied, but for plant.inner_step, which has one value"
    );
    for axis in axes {
        let name = axis["label"].as_str().and_then(|label| label.split(' ').next()).expect("a label");
        for (drawn, recorded) in numbers(&axis["values"]).iter().zip(column(name)) {
            // Seven digits are kept.
            let same = recorded.map_or(drawn.is_nan(), |v| (drawn - v).abs() <= 1e-6 * v.abs());
            assert!(same, "{name}: {drawn}, not {recorded:?}");
        }
    }
    // Success depends on the lower bound and not on the start, so that is shown first.
    assert!(numbers(&scene["shown"]).contains(&1.0), "{}", scene["shown"]);
    let picture = workshop.text("c.svg");
    // A mark for each run that fails, and one in the legend.
    assert_eq!(picture.matches("l6 6m0 -6l-6 6").count(), RUNS as usize - count("success") + 1);
    // All runs are among the first ones, so the cells count them all; the reader chooses how they are shown.
    assert_eq!(scene["first"], RUNS);
    assert!(page.contains(">rate of success by cell</option>"), "a choice");
    // The bars count the rows, on the correct side of the deadline.
    let arrivals = &scene["arrivals"][0];
    let (on_time, arrived) =
        (count("filter.goal.on_time"), column("filter.goal.arrival").iter().flatten().count());
    let said = format!(
        "filter.goal: of {RUNS} runs {on_time} arrive by the deadline, {} later, {} not in their time.",
        arrived - on_time,
        RUNS as usize - arrived
    );
    assert_eq!(arrivals["said"], said);
    assert_eq!(arrivals["chart"]["verticals"][0]["at"], 10.0);
    let curves = arrivals["chart"]["curves"].as_array().expect("a list");
    let heights = |label: &str| {
        let curve =
            curves.iter().find(|curve| curve["label"] == label).unwrap_or_else(|| panic!("no {label}"));
        (numbers(&curve["x"]), numbers(&curve["y"]).iter().sum::<f64>())
    };
    let ((early, before), (late, after)) = (heights("on time"), heights("late"));
    assert_eq!((before, after), (on_time as f64, (arrived - on_time) as f64));
    assert!(early.iter().all(|t| *t <= 10.0) && late.iter().all(|t| *t >= 10.0), "{early:?}, {late:?}");
    // The rate, what was varied, and the worst runs.
    let tree = body(&page);
    let texts: Vec<_> = tree.descendants().filter_map(|node| node.text()).collect();
    let rate = format!("{} of {RUNS} runs succeed: ", count("success"));
    assert!(texts.iter().any(|text| text.starts_with(&rate)), "{texts:?}");
    let [low, high] = [0, 1].map(|end| report["success"]["interval"][end].as_f64().expect("a number"));
    let interval = texts.iter().find(|text| text.starts_with("The rate of success is ")).expect("a sentence");
    let printed: Vec<f64> = interval.split([' ', '\u{202f}']).filter_map(|word| word.parse().ok()).collect();
    assert!(
        (printed[0] - 100.0 * low).abs() < 0.005 && (printed[1] - 100.0 * high).abs() < 0.005,
        "{interval}"
    );
    assert!(interval.contains("a rough guide"), "{interval}");
    let cells = cells(&tree);
    let row = |name: &str| cells.iter().find(|row| row[0] == name).unwrap_or_else(|| panic!("no {name}"));
    assert_eq!(row("plant.x0.x_p")[1..3], ["uniform from 0 to 20", "m"]);
    assert_eq!(row("plant.x0.v")[1..3], ["normal, mean 0, deviation 2", "m/s"]);
    assert_eq!(row("filter.u_min.a")[1], "one of -20, -0.1, -0.1, 30");
    let commands: Vec<_> =
        tree.descendants().filter(|node| node.attribute("class") == Some("command")).collect();
    let first = commands.iter().find_map(|node| node.text()).expect("a command");
    assert_eq!(first, format!("punctual replay c.parquet --run {} --out out", report["worst"][0]["run"]));
    workshop.punctual(first.split(' ').skip(1)).success();
    // The page is written again without a run, but never over the file of the rows.
    fs::remove_file(workshop.path("c.html")).expect("the page");
    workshop.punctual(["campaign", "c.toml", "--report"]).success();
    assert_eq!(workshop.text("c.html"), page);
    workshop.punctual(["campaign", "c.toml", "--report", "-o", "c.html"]).fails(
        2,
        "--output: ends in .html, the ending of what --report writes beside it; give another ending, such as .parquet",
    );
}

/// Varied deadlines, names that need escaping, and nothing to choose from.
#[test]
fn a_report_counts_from_the_deadline_where_that_is_varied() {
    let workshop = workshop(6, "random");
    let name = "<!--<script>";
    workshop.write(
        "system.toml",
        workshop
            .text("system.toml")
            .replace("\"filter\"", &format!("{name:?}"))
            .replace("filter.u", &format!("{name}.u")),
    );
    let deadline =
        format!("[vary.\"{name}.goal.deadline\"]\ndistribution = \"log_uniform\"\nmin = 6\nmax = 11\n");
    let head = "system = \"system.toml\"\n[campaign]\nruns = 6\n";
    workshop.write("c.toml", format!("{head}{deadline}"));
    workshop.punctual(["campaign", "c.toml", "--report"]).success();
    let page = workshop.text("c.html");
    assert_eq!((page.matches("<script").count(), page.matches("<!--").count()), (1, 0));
    let scene = data(&page, "scene");
    assert_eq!((&scene["axes"][0]["logarithmic"], &scene["shown"][0]), (&true.into(), &0.into()));
    let chart = &scene["arrivals"][0]["chart"];
    assert_eq!(
        (&chart["x"]["label"], &chart["verticals"][0]["at"]),
        (&"arrival, from the deadline on (s)".into(), &0.0.into())
    );
    assert!(numbers(&chart["curves"][0]["x"]).iter().all(|t| (-11.0..=0.0).contains(t)), "{chart}");
    // All runs are alike, so there is nothing to draw them over.
    fs::remove_file(workshop.path("c.parquet")).expect("the rows");
    fs::remove_file(workshop.path("c.svg")).expect("the picture");
    workshop.write("c.toml", head);
    workshop.punctual(["campaign", "c.toml", "--report"]).success();
    let page = workshop.text("c.html");
    assert_eq!(data(&page, "scene")["shown"], Value::Null);
    assert!(
        body(&page)
            .descendants()
            .any(|node| node.text().is_some_and(|text| text.starts_with("Nothing: all runs")))
    );
    assert!(!workshop.path("c.svg").exists());
}

/// An inline system with configurations in place of FMUs, and a disturbance whose seed is the run's own.
#[test]
fn a_campaign_needs_no_fmus() {
    let workshop = workshop(1, "random");
    let plant = workshop.text("plant.toml") + "[disturbance]\nperiod = 0.1\ninputs = { a = 0.1 }\n";
    workshop.write("plant.toml", plant);
    let inline = workshop
        .text("system.toml")
        .replace("[experiment]", "[system.experiment]")
        .replace("[[component]]", "[[system.component]]")
        .replace("[[connection]]", "[[system.connection]]")
        .replace("[[connect_by_name]]", "[[system.connect_by_name]]");
    let file = inline
        + "[campaign]\nruns = 3\nsuccess = \"on_time_and_inside\"\nstop_time = 11.0\n\
           [vary.\"plant.disturbance.seed\"]\ndistribution = \"seed\"\n";
    workshop.write("c.toml", &file);
    let report: Value =
        serde_json::from_str(&workshop.punctual(["campaign", "c.toml", "--json"]).success()).expect("JSON");
    assert_eq!(report["success"]["count"], 3, "{report}");
    let (names, rows) = rows(&workshop.path("c.parquet"));
    let column = |name: &str| names.iter().position(|n| n == name).expect("a column");
    let least: Vec<_> = rows.iter().map(|row| number(&row[column("filter.goal.least_h")])).collect();
    assert!(least[0] != least[1] && least[1] != least[2], "each run is disturbed in its own way: {least:?}");
    for row in &rows {
        assert_eq!(number(&row[column("seed")]), number(&row[column("plant.disturbance.seed")]));
    }
    workshop.punctual(["replay", "c.parquet", "--run", "2"]).success();
    workshop.write("c.toml", file.replace(STEP, "step = -0.05"));
    workshop
        .punctual(["campaign", "c.toml"])
        .fails(2, "c.toml: system.experiment.step: is -0.05 s; must be > 0");
}

/// An FMU built by another version of this program cannot run in process, and the message says so.
#[test]
fn fmus_of_another_version_are_refused() {
    let workshop = with_fmus(3, "random");
    workshop.edit_fmu("plant.fmu", |name, bytes| {
        if name != "modelDescription.xml" {
            return Some(bytes);
        }
        let text = String::from_utf8(bytes).expect("UTF-8");
        Some(text.replace("guid=\"{", "guid=\"{0").into_bytes())
    });
    workshop.punctual(["campaign", "c.toml"]).fails_like(
        2,
        "system.toml: component[1].fmu: plant.fmu is the work of another version of Punctual",
        &[],
    );
}

/// The example, with three runs in coarse steps.
#[test]
fn the_example_runs() {
    let workshop = Workshop::with_library();
    let folder = examples().join("../campaign");
    for entry in fs::read_dir(&folder).expect("the examples").flatten() {
        workshop.write(&entry.file_name().to_string_lossy(), fs::read(entry.path()).expect("an example"));
    }
    for name in ["unicycle-filter", "unicycle-plant"] {
        let (from, to) = (format!("{name}.toml"), format!("{name}.fmu"));
        workshop.punctual(["build", &from, "-o", &to]).success();
    }
    let text = workshop.text("unicycle.toml").replace("runs = 1000", "runs = 3\nstep = 0.02");
    workshop.write("unicycle.toml", text);
    let report = workshop.punctual(["campaign", "unicycle.toml", "--json"]).success();
    let report: Value = serde_json::from_str(&report).expect("JSON");
    assert_eq!((&report["runs"], &report["success"]["count"]), (&3.into(), &3.into()), "{report}");
    workshop.punctual(["replay", "unicycle.parquet", "--run", "1", "--out", "out"]).success();
    for picture in ["path", "h", "input"] {
        assert!(workshop.text(&format!("out/unicycle-1-{picture}.svg")).trim_end().ends_with("</svg>"));
    }
}

/// Parts made separately, one of them interrupted, join to the campaign of one machine. Anything that is not
/// a part of it is named.
#[test]
fn shards_join_to_the_campaign_of_one_machine() {
    let workshop = workshop(20, "latin_hypercube");
    workshop.punctual(["campaign", "c.toml", "-o", "whole.parquet"]).success();
    let shard = |part: &str| workshop.punctual(["campaign", "c.toml", "--shard", part]);
    for part in ["1/3", "3/3"] {
        shard(part).success();
    }
    let join = |files: &[&str]| {
        let fixed = ["campaign", "c.toml", "-o", "joined.parquet", "--join"];
        workshop.punctual([fixed.as_slice(), files].concat())
    };
    let (first, second, third) = ("c.1-of-3.parquet", "c.2-of-3.parquet", "c.3-of-3.parquet");
    join(&[third, first])
        .fails(2, "--join: the runs 6..13 are in none of the 2 files; `--shard 6..13` makes them");
    join(&[first]).fails(2, "--join: the runs 6..20 are in none of the 1 files; `--shard 6..20` makes them");
    assert!(shard("2/3").success().starts_with("7 runs in "));
    join(&[first, second, third, second]).fails(
        2,
        "--join: the runs 6..13 are both in c.2-of-3.parquet and in c.2-of-3.parquet; leave one out",
    );
    // Half a file, and none at all although it was begun.
    let bytes = workshop.bytes(second);
    workshop.write("half.parquet", &bytes[..bytes.len() / 2]);
    join(&[first, "half.parquet", third]).fails_like(
        2,
        "--join: half.parquet is not part of a campaign, or is incomplete: ",
        &["make it again with --shard"],
    );
    fs::create_dir(workshop.path("begun.parquet.parts")).expect("a folder");
    join(&[first, "begun.parquet", third]).fails(
        2,
        "--join: begun.parquet is not complete: what is there is in begun.parquet.parts, and the same --shard goes on",
    );
    // A bit flipped by a disk is detected, or changes nothing.
    let mut damaged = 0;
    for k in 0..24 {
        let mut flipped = bytes.clone();
        let at = 4 + k * bytes.len() / 60;
        flipped[at] ^= 1 << (k % 8);
        workshop.write("flipped.parquet", flipped);
        let joined = join(&[first, "flipped.parquet", third]);
        if joined.code == 0 {
            assert!(workshop.bytes("joined.parquet") == workshop.bytes("whole.parquet"), "byte {at}");
            fs::remove_file(workshop.path("joined.parquet")).expect("a file");
        } else {
            damaged += usize::from(joined.stderr.contains("so it is damaged; make it again"));
        }
    }
    assert!(damaged > 0, "no checksum was compared");
    // Another version, wherever the file contains it as text.
    let mut other = bytes.clone();
    let key = other.windows(16).position(|w| w == b"punctual.version").expect("the key");
    let ours = env!("CARGO_PKG_VERSION").as_bytes();
    let at = key + other[key..].windows(ours.len()).position(|w| w == ours).expect("the version");
    other[at] = b'9';
    workshop.write("older.parquet", other);
    join(&[first, "older.parquet", third]).fails_like(
        2,
        "--join: older.parquet was made by version 9",
        &["of this program, this is version"],
    );
    // Other campaigns.
    let other = |name: &str| {
        workshop.punctual(["campaign", "other.toml", "--shard", "6..13", "-o", name]).success();
    };
    let refused = |name: &str, message: &str| {
        let expected = format!("--join: {name} is a part of another campaign: {message}");
        join(&[first, name, third]).fails(2, &expected);
    };
    let of_file = |name: &str, text: String, message: &str| {
        workshop.write("other.toml", text);
        other(name);
        refused(name, message);
    };
    let text = file(20, "latin_hypercube");
    of_file("seed.parquet", text.replace("seed = 7", "seed = 8"), "its seed is 8, must be 7");
    of_file("runs.parquet", file(21, "latin_hypercube"), "it is one of 21 runs, must be of 20");
    let wider = text.replace("deviation = 2", "deviation = 3");
    of_file("file.parquet", wider, "its campaign file has another text");
    let of_part = |name: &str, part: &str, more: &str, message: &str| {
        let before = workshop.text(part);
        workshop.write(part, format!("{before}{more}"));
        other(name);
        workshop.write(part, before);
        refused(name, message);
    };
    workshop.write("other.toml", text);
    of_part("system.parquet", "system.toml", "# another\n", "its system file has another text");
    let message = "its component \"plant\" has another configuration";
    of_part("plant.parquet", "plant.toml", "[disturbance]\nperiod = 0.1\ninputs = { a = 0.1 }\n", message);
    assert!(!workshop.path("joined.parquet").exists() && !workshop.path("joined.parquet.parts").exists());

    // A folder stands for its files. The rows, and all reports on them, are those of one machine.
    fs::create_dir(workshop.path("all")).expect("a folder");
    for name in [first, second, third] {
        workshop.write(&format!("all/{name}"), workshop.bytes(name));
    }
    let report: Value = serde_json::from_str(&join(&["all", "--json", "--report"]).success()).expect("JSON");
    assert!(workshop.bytes("joined.parquet") == workshop.bytes("whole.parquet"), "the bytes differ");
    assert_eq!((&report["runs"], &report["report"][0]), (&20.into(), &"joined.html".into()));
    // Once more into the same folder: a complete result there does not count as a part.
    for _ in 0..2 {
        workshop.punctual(["campaign", "c.toml", "-o", "all/joined.parquet", "--join", "all"]).success();
    }
    workshop.punctual(["campaign", "c.toml", "-o", "again.parquet", "--join", "all"]).success();
    assert!(workshop.bytes("again.parquet") == workshop.bytes("whole.parquet"), "the bytes differ");
    join(&[first, "nothing.parquet"]).fails(2, "--join: nothing.parquet is not there");
    // A part knows its own runs, and no others.
    workshop.punctual(["replay", second, "--run", "6"]).success();
    workshop.punctual(["replay", second, "--run", "12"]).success();
    workshop.punctual(["replay", second, "--run", "13"]).fails(2, "--run: is 13, must be from 6 to 12");
    workshop.punctual(["campaign", "c.toml", "--shard", "2/4", "-o", second]).fails(
        2,
        "--output: c.2-of-3.parquet has the runs 6..13 of this campaign, must have 5..10; remove it, or give another \
         output",
    );
    shard("0/3").fails_like(2, "invalid value '0/3'", &["K must be from 1 to N"]);
    shard("3").fails_like(2, "invalid value '3'", &["such as 0..100; or K/N, such as 1/8"]);
    let threads = |number| workshop.punctual(["campaign", "c.toml", "--threads", number]);
    threads("0").fails_like(2, "invalid value '0'", &["1..=1024"]);
    threads("1025").fails_like(2, "invalid value '1025'", &["1..=1024"]);
    shard("1/21").fails(2, "--shard: is one of 21 parts, must be of at most 20, the number of runs");
    shard("6..21").fails(2, "--shard: ends at 21, must be at most 20, the number of runs");
}

/// A shard that was killed resumes, but only as the same shard.
#[test]
fn a_shard_can_be_ended_at_any_point() {
    let workshop = workshop(MANY, "random");
    workshop.write("system.toml", workshop.text("system.toml").replace(STEP, "step = 0.25"));
    let mut child = begin(&workshop, &["--threads", "1", "--shard", "2/2"]);
    wait(&workshop, &mut child, 0, Duration::from_millis(5));
    let sent = Command::new("kill").args(["-KILL", &child.id().to_string()]).status().expect("kill");
    assert!(sent.success());
    child.wait().expect("a child");
    let before = kept(&workshop) - MANY / 2;
    assert!(before > 0 && before < MANY / 2, "{before}");
    let shard =
        |part: &str, output: &str| workshop.punctual(["campaign", "c.toml", "--shard", part, "-o", output]);
    shard("1/2", "cut.parquet").fails_like(2, "--output: cut.parquet.parts is of another campaign", &[]);
    let resumed = shard("2/2", "cut.parquet");
    assert_eq!(resumed.stderr, format!("note: {before} of {} runs already existed\n", MANY / 2));
    resumed.success();
    shard("2/2", "whole.parquet").success();
    assert!(workshop.bytes("cut.parquet") == workshop.bytes("whole.parquet"), "the bytes differ");
}

/// One file is enough on another machine. It is refused if it was changed or comes from another version.
#[test]
fn a_packed_campaign_needs_no_other_file() {
    let workshop = with_fmus(6, "random");
    workshop.punctual(["campaign", "c.toml"]).success();
    workshop.punctual(["campaign", "c.toml", "--pack", "new/folder/c.json"]).success();
    workshop.punctual(["campaign", "c.toml", "--pack", "c.json"]).success();
    assert_eq!(workshop.text("new/folder/c.json"), workshop.text("c.json"));
    // It may overwrite its own output, but nothing else.
    workshop.punctual(["campaign", "c.toml", "--pack", "c.json"]).success();
    workshop
        .punctual(["campaign", "c.toml", "--pack", "c.toml"])
        .fails(2, "--pack: c.toml already exists and is not a packed campaign; give another name");
    let packed = workshop.text("c.json");
    let elsewhere = Workshop::new();
    elsewhere.write("c.json", &packed);
    elsewhere.punctual(["campaign", "c.json"]).success();
    assert!(elsewhere.bytes("c.parquet") == workshop.bytes("c.parquet"), "the bytes differ");
    let refused = |text: String, message: &str| {
        elsewhere.write("other.json", text);
        elsewhere.punctual(["campaign", "other.json"]).fails_like(2, "other.json: ", &[message]);
    };
    refused(packed.replace("seed = 7", "seed = 8"), "was changed after `--pack` wrote it");
    refused(packed.replace("\"runs\": 6", "\"runs\": 7"), "was changed after `--pack` wrote it");
    refused(
        packed.replacen(env!("CARGO_PKG_VERSION"), "0.0.0", 1),
        "was packed by version 0.0.0 of this program",
    );
    refused(packed[..packed.len() / 2].to_owned(), "is not a complete campaign written by `--pack`");
}

/// A plant whose distance is the sum of four normal numbers times 1 - exp(-2), and a wall at `d` (m) that
/// nothing keeps it from, since the filter acts on nothing.
fn drifting(workshop: &Workshop, d: f64) -> String {
    let model = "[plant]\nstates = [{ name = \"x\", unit = \"m\" }, { name = \"a\" }, { name = \"b\" }, { name = \"c\" }, \
                 { name = \"d\" }]\ninputs = [{ name = \"u\" }]\n[plant.derivatives]\n\
                 x = \"a + b + c + d + u\"\na = \"-a\"\nb = \"-b\"\nc = \"-c\"\nd = \"-d\"\n";
    workshop.write("plant.toml", format!("kind = \"plant\"\n{model}"));
    let barrier = format!("[[barrier]]\nname = \"wall\"\nexpression = \"{d:?} - x\"\n");
    workshop.write("filter.toml", format!("kind = \"filter\"\nassurance = \"off\"\n{model}{barrier}"));
    let states = ["x", "a", "b", "c", "d"];
    let connected = states.map(|state| {
        format!("[[system.connection]]\nfrom = \"plant.x.{state}\"\nto = \"filter.x.{state}\"\n")
    });
    let varied = states[1..].iter().map(|state| {
        format!("[vary.\"plant.x0.{state}\"]\ndistribution = \"normal\"\nmean = 0\ndeviation = 1\n")
    });
    let system = "[system.experiment]\nstop_time = 2.0\nstep = 1.0\n\
                  [[system.component]]\nname = \"filter\"\nfmu = \"filter.toml\"\n\
                  [[system.component]]\nname = \"plant\"\nfmu = \"plant.toml\"\n\
                  start = { \"u.u\" = 0.0, inner_step = 0.1 }\n";
    let campaign = "[campaign]\nruns = 1\nsuccess = \"on_time_and_inside\"\n";
    [system, &connected.concat(), campaign, &varied.collect::<String>()].concat()
}

/// A known probability, and a replay of the worst run.
#[test]
fn a_rare_failure_is_estimated_and_shown() {
    let workshop = Workshop::new();
    // 2.17009 standard deviations of 2 (1 - exp(-2)) m each: a probability of 0.015, by tables of the normal
    // distribution.
    let text = drifting(&workshop, 2.170_090 * 2.0 * (1.0 - (-2.0_f64).exp()));
    workshop.write("c.toml", &text);
    let rare = |more: &[&str]| workshop.punctual([&["campaign", "c.toml"], more].concat());
    let report: Value = serde_json::from_str(&rare(&["--rare=5", "--json"]).success()).expect("JSON");
    let interval = numbers(&report["interval"]);
    assert!(interval[0] < 0.015 && 0.015 < interval[1], "{report}");
    assert!(interval[0] > 0.0075 && interval[1] < 0.03, "{report}");
    let levels = numbers(&report["levels"]);
    assert!(levels.len() == 2 && levels.is_sorted_by(|a, b| a > b) && levels[1] >= 0.0, "{levels:?}");
    // The replay ends where the estimate says, and as badly.
    let values = report["worst"]["values"].as_array().expect("a list");
    let sum: f64 = values.iter().filter_map(|value| value["value"].as_f64()).sum();
    let least = report["worst"]["least_h"].as_f64().expect("a number");
    assert!(least < 0.0 && values.len() == 4);
    let expected = (2.170_090 * 2.0 - sum) * (1.0 - (-2.0_f64).exp());
    assert!((least - expected).abs() < 1e-3, "{least}, not {expected}");
    let again = workshop.punctual(["replay", "c-worst.parquet", "--run", "0"]).success();
    assert!(again.contains("the row is as recorded, bit for bit") && again.contains("not kept"), "{again}");
    let (names, rows) = rows(&workshop.path("c-worst.parquet"));
    let place = names.iter().position(|n| n == "filter.wall.least_h").expect("a column");
    assert_eq!(number(&rows[0][place]).map(f64::to_bits), Some(least.to_bits()));
    // The result does not depend on the number of threads.
    let one = rare(&["--rare=5", "--json", "--threads", "1", "-o", "again.parquet"]).success();
    let one: Value = serde_json::from_str(&one).expect("JSON");
    assert_eq!((&one["probability"], &one["interval"]), (&report["probability"], &report["interval"]));
    assert!(workshop.bytes("again.parquet") == workshop.bytes("c-worst.parquet"), "the bytes differ");

    rare(&["--rare"]).fails(2, "--output: c-worst.parquet already exists; remove it, or give another output");
    rare(&["--rare=4"]).fails_like(2, "invalid value '4' for '--rare", &[]);
    let refused = |text: String, message: &str| {
        workshop.write("c.toml", text);
        rare(&["--rare=5", "-o", "none.parquet"]).fails_like(2, message, &[]);
        assert!(!workshop.path("none.parquet").exists());
    };
    let success = "success = \"on_time_and_inside\"\n";
    refused(text.replace(success, ""), "campaign.success: is \"kept\"; --rare goes by h, so it must be");
    let (system, _) = text.split_once("[vary.").expect("the first table");
    refused(system.to_owned(), "vary: is empty, so that all runs are alike");
    let plant = workshop.text("plant.toml");
    workshop.write("plant.toml", plant + "[disturbance]\nperiod = 0.3\ninputs = { u = 0.1 }\n");
    let seed = "[vary.\"plant.disturbance.seed\"]\ndistribution = \"seed\"\n";
    refused(
        text.clone() + seed,
        "vary.\"plant.disturbance.seed\".distribution: is \"seed\"; --rare needs steps, now of 1 s, a whole number of \
         which is one of its periods of 0.3 s",
    );
    refused(
        text.clone() + &seed.replace("disturbance.seed", "x0.x"),
        "c.toml: vary.\"plant.x0.x\".distribution: is \"seed\", which is for variables that may be any number >= 0",
    );
    let period = "[vary.\"plant.disturbance.period\"]\ndistribution = \"choice\"\nvalues = [0.1]\n";
    refused(
        text.clone() + seed + period,
        "vary.\"plant.disturbance.seed\".distribution: is \"seed\" where plant.disturbance.period is varied too; --rare takes one of them",
    );
    // No drawn start can fail, so there is no way to failure and no estimate of its probability.
    let narrow = text.replace(
        "distribution = \"normal\"\nmean = 0\ndeviation = 1",
        "distribution = \"choice\"\nvalues = [0.0, 0.1]",
    );
    refused(narrow, "--rare: found no path to a failure: the least h that ");
}

/// Runs that end before a deadline keep no promise, and every command gives this reason.
#[test]
fn runs_that_end_before_a_deadline_say_so() {
    let workshop = Workshop::new();
    let deadline = |seconds: f64| {
        workshop.write("c.toml", drifting(&workshop, -30.0));
        workshop.write("filter.toml", workshop.text("filter.toml") + &format!("deadline = {seconds:?}\n"));
    };
    deadline(3.0);
    let noted = |arguments: &[&str]| workshop.punctual(arguments.iter().copied()).stderr;
    let counts = "it does from the deadline on (stop_time = 2 s), or from the start where a run begins inside, until a call fails";
    let note = format!("note: filter.wall: no run has an h that counts; {counts}\n");
    assert_eq!(noted(&["campaign", "c.toml"]), note);
    let note = format!("note: the worst run lacks an h that counts; {counts}\n");
    assert_eq!(noted(&["campaign", "c.toml", "--rare=5"]), note);
    // With a deadline in time there is nothing to report.
    deadline(1.5);
    assert_eq!(noted(&["campaign", "c.toml", "-o", "in_time.parquet"]), "");
}

/// A wall that only noise can reach: `--rare` agrees with plain sampling, and the worst run is replayed.
#[test]
fn a_rare_sequence_of_noise_is_estimated_and_shown() {
    let workshop = Workshop::new();
    // x(2) is a fifth of the sum of ten numbers uniform from -1 to 1: about one in 100 reaches 0.84.
    let text = drifting(&workshop, 0.84);
    let (system, _) = text.split_once("[vary.").expect("the first table");
    let text = system.replace("step = 1.0", "step = 0.1")
        + "[vary.\"plant.disturbance.seed\"]\ndistribution = \"seed\"\n";
    let plant = workshop.text("plant.toml") + "[disturbance]\nperiod = 0.2\ninputs = { u = 1.0 }\n";
    workshop.write("plant.toml", &plant);
    workshop.write("c.toml", text.replace("runs = 1\n", "runs = 20000\n"));
    let campaign = |more: &[&str]| {
        serde_json::from_str(&workshop.punctual([&["campaign", "c.toml", "--json"], more].concat()).success())
            .expect("JSON")
    };
    let plain: Value = campaign(&[]);
    let rare: Value = campaign(&["--rare=10"]);
    let [plain, found] = [&plain["failure"]["interval"], &rare["interval"]].map(numbers);
    assert!(plain[0] < found[1] && found[0] < plain[1], "{plain:?}, {found:?}");
    assert!(
        plain[0] > 0.004 && plain[1] < 0.02 && found[0] > 0.5 * plain[0] && found[1] < 2.0 * plain[1],
        "{found:?}"
    );

    // The worst run is a file of its own, with a seed for each period.
    assert_eq!(rare["worst"]["values"][0]["changes"], 11, "{rare}");
    let least = rare["worst"]["least_h"].as_f64().expect("a number");
    assert!(least < 0.0);
    let again = workshop.punctual(["replay", "c-worst.parquet", "--run", "0", "--out", "out"]).success();
    assert!(again.contains("the row is as recorded, bit for bit") && again.contains("not kept"), "{again}");
    let (names, rows) = rows(&workshop.path("c-worst.parquet"));
    let place = names.iter().position(|n| n == "filter.wall.least_h").expect("a column");
    assert_eq!(number(&rows[0][place]).map(f64::to_bits), Some(least.to_bits()));
}

/// Killed and interrupted, an estimate resumes and gives the same numbers.
#[test]
fn a_rare_estimate_can_be_ended_at_any_point() {
    let workshop = Workshop::new();
    workshop.write("c.toml", drifting(&workshop, 2.170_090 * 2.0 * (1.0 - (-2.0_f64).exp())));
    let rare = |repeats: &str, output: &str| {
        workshop.punctual(["campaign", "c.toml", repeats, "--json", "-o", output])
    };
    let made = workshop.path("cut.parquet.rare.parts/made");
    let kept = || {
        let made = fs::read_to_string(&made).ok()?;
        let made: Value = serde_json::from_str(made.split_once('\n')?.1).ok()?;
        made["repeats"].as_array().map(Vec::len)
    };
    let mut before = 0;
    for ending in ["-KILL", "-INT"] {
        let mut child = begin(&workshop, &["--rare=10000"]);
        while kept().is_none_or(|now| now <= before) {
            assert!(child.try_wait().expect("a child").is_none(), "it ended before");
            thread::sleep(Duration::from_millis(1));
        }
        let sent = Command::new("kill").args([ending, &child.id().to_string()]).status().expect("kill");
        assert!(sent.success());
        let output = child.wait_with_output().expect("a child");
        assert_eq!(output.status.code(), (ending == "-INT").then_some(130));
        before = kept().expect("repeats");
        let printed = String::from_utf8_lossy(&output.stderr);
        let note =
            format!("interrupted with {before} of 10000 repeats kept; the same command goes on from there");
        assert_eq!(printed.contains(&note), ending == "-INT", "{printed}");
    }
    // Another campaign does not resume from there.
    let text = workshop.text("c.toml");
    workshop.write("c.toml", text.clone() + "# another\n");
    let message = "--output: cut.parquet.rare.parts is of another campaign (fingerprint ";
    workshop.punctual(["campaign", "c.toml", "--rare", "-o", "cut.parquet"]).fails_like(2, message, &[]);
    // Neither does this one if the file with the fingerprint is gone.
    let fingerprint = made.with_file_name("fingerprint");
    fs::remove_file(&fingerprint).expect("a file");
    let message = "--output: cut.parquet.rare.parts/made is of another campaign (fingerprint ";
    let refused = || workshop.punctual(["campaign", "c.toml", "--rare", "-o", "cut.parquet"]);
    refused().fails_like(2, message, &[]);
    fs::remove_file(&fingerprint).expect("a file");
    workshop.write("c.toml", text);
    // One changed number, and half a file.
    let good = fs::read_to_string(&made).expect("a text");
    let another = good.replacen("\"probability\":0", "\"probability\":1", 1);
    assert_ne!(another, good);
    for bad in [another.as_str(), &good[..good.len() / 2], ""] {
        fs::write(&made, bad).expect("a writable folder");
        let parts = ["was changed since it was written; remove it"];
        refused().fails_like(2, "cannot use cut.parquet.rare.parts/made", &parts);
    }
    fs::write(&made, good).expect("a writable folder");
    let repeats = format!("--rare={}", before.max(4) + 1);
    let resumed = rare(&repeats, "cut.parquet").success();
    let whole = rare(&repeats, "whole.parquet").success();
    assert_eq!(resumed.replace("cut.parquet", "whole.parquet"), whole);
    assert!(workshop.bytes("cut.parquet") == workshop.bytes("whole.parquet"), "the bytes differ");
    assert!(!made.parent().expect("a folder").exists());
}

/// An FMU of another program runs too, with a new instance for each run, since its reset forgets nothing.
#[test]
fn a_campaign_takes_fmus_of_others() {
    let workshop = Workshop::new();
    // Its output counts its steps, so the plant moves 1 m and then 2 m further.
    misbehaving::write(
        &workshop,
        "counter.fmu",
        misbehaving::description("no-reset", &[]),
        &misbehaving::library(&[]),
    );
    let counter = "[[system.component]]\nname = \"counter\"\nfmu = \"counter.fmu\"\nstart = { u = 0.0 }\n\
                   [[system.connection]]\nfrom = \"counter.y\"\nto = \"plant.u.u\"\n[campaign]\n";
    let way = 1.0 - (-2.0_f64).exp();
    let d = 2.170_090 * 2.0 * way + 3.0;
    let text = drifting(&workshop, d).replace("\"u.u\" = 0.0, ", "").replace("[campaign]\n", counter);
    workshop.write("c.toml", text.replace("runs = 1\n", "runs = 9\n"));
    let campaign = |more: &[&str]| workshop.punctual([&["campaign", "c.toml"], more].concat());
    campaign(&[]).success();
    let (names, found) = rows(&workshop.path("c.parquet"));
    let place = |name: &str| names.iter().position(|n| n == name).expect("a column");
    for row in &found {
        let of = |name: &str| number(&row[place(name)]).expect("a number");
        let sum: f64 = ["a", "b", "c", "d"].iter().map(|state| of(&format!("plant.x0.{state}"))).sum();
        // If the states pull it back, the maximum may be before the end.
        let reached = [0.0, sum * (1.0 - (-1.0_f64).exp()) + 1.0, sum * way + 3.0];
        let expected = d - reached.into_iter().fold(0.0, f64::max);
        let least = of("filter.wall.least_h");
        assert!((least - expected).abs() < 1e-3, "{least}, not {expected}");
    }
    let alone = campaign(&["--threads", "1", "-o", "alone.parquet"]);
    alone.success();
    assert!(workshop.bytes("alone.parquet") == workshop.bytes("c.parquet"), "the bytes differ");
    let replay = || workshop.punctual(["replay", "c.parquet", "--run", "8"]);
    let again = replay().success();
    assert!(again.contains("the row is as recorded, bit for bit"), "{again}");
    // A failure probability of 0.015, as without the FMU.
    let rare: Value = serde_json::from_str(&campaign(&["--rare=5", "--json"]).success()).expect("JSON");
    let interval = numbers(&rare["interval"]);
    assert!(interval[0] < 0.015 && 0.015 < interval[1] && interval[1] < 0.03, "{rare}");

    // Apart from the notes on units.
    let done = campaign(&["--pack", "c.json"]);
    let refused = "error: --pack: counter.fmu of component \"counter\" is an FMU of another program, which is not packed; run \
                   shards where its file is\n";
    assert!(done.code == 2 && done.stderr.ends_with(refused), "{done:?}");
    misbehaving::write(
        &workshop,
        "counter.fmu",
        misbehaving::description("none", &[]),
        &misbehaving::library(&[]),
    );
    replay().fails(2, "component \"counter\": counter.fmu is another FMU than the campaign was made with");
    let done = campaign(&[]);
    assert!(
        done.code == 2 && done.stderr.contains("error: --output: c.parquet is of another campaign"),
        "{done:?}"
    );
    fs::remove_file(workshop.path("counter.fmu")).expect("a file");
    replay().fails(
        2,
        "component \"counter\": there is no file counter.fmu, the FMU that the campaign was made with",
    );
}

/// A sequence of values: whatever may change during a run takes them at the stated times.
#[test]
fn a_sequence_is_the_same_in_every_run() {
    let workshop = Workshop::new();
    let text = drifting(&workshop, 9.0).replace("runs = 1\n", "runs = 2\n");
    let (system, _) = text.split_once("[vary.").expect("the first table");
    let system = system.replace("start = { \"u.u\" = 0.0, inner", "start = { inner");
    let course = "[vary.\"plant.u.u\"]\ndistribution = \"sequence\"\nvalues = [1.0, -3.0]\nperiod = 1.0\n";
    workshop.write("c.toml", system.clone() + course);
    workshop.punctual(["campaign", "c.toml"]).success();
    let (names, rows) = rows(&workshop.path("c.parquet"));
    let place = names.iter().position(|n| n == "filter.wall.least_h").expect("a column");
    // The maximum is x(1) = 1.
    for row in &rows {
        assert_eq!(number(&row[place]), Some(8.0));
    }
    let refused = |course: String, message: &str| {
        workshop.write("c.toml", system.clone() + &course);
        workshop.punctual(["campaign", "c.toml", "-o", "none.parquet"]).fails_like(
            2,
            &format!("c.toml: vary.\"plant.{message}"),
            &[],
        );
    };
    refused(course.replace("1.0\n", "1.5\n"), "u.u\".period: is 1.5, must be a whole number of steps of 1 s");
    refused(course.replace("1.0\n", "0.0\n"), "u.u\".period: is 0, must be finite and >= 1e-9");
    refused(
        course.replace("values = [1.0, -3.0]\n", ""),
        "u.u\".values: missing; distribution = \"sequence\" needs values, period",
    );
    let fixed = course.replace("plant.u.u", "plant.x0.x")
        + "[vary.\"plant.u.u\"]\ndistribution = \"choice\"\nvalues = [0.0]\n";
    refused(fixed, "x0.x\".distribution: is \"sequence\", which is for what may change in a run");
}
