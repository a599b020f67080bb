//! Recordings with planted delays, lags, gains, winds and noise: what is found contains them, and little more.

use punctual_fmu::configuration::{Configuration, FilterConfiguration};

use super::*;
use crate::recording::{Column, Recording};

/// The step of the recordings in s.
const STEP: f64 = 0.02;
/// The step of the integration that makes them, in s.
const INNER: f64 = 0.0005;
/// How much larger than planted a bound may be that was found: declared bounds have a factor of 1.2, and few of a thousand draws come near
/// the largest possible, so that winds and noise explain a little of each other.
const AT_MOST: f64 = 2.0;

/// A cart with drag: x = (place in m, speed in m/s), one input in N.
fn cart() -> FilterConfiguration {
    let text = "kind = \"filter\"\nexperiment = { step_size = 0.02 }\n\
                [plant]\nstates = [{ name = \"p\", unit = \"m\" }, { name = \"v\", unit = \"m/s\" }]\n\
                inputs = [{ name = \"F\", unit = \"N\", min = -8.0, max = 8.0 }]\n\
                parameters = [{ name = \"m\", start = 2.0, unit = \"kg\" }, { name = \"c\", start = 0.5, unit = \"kg/s\" }]\n\
                derivatives = { p = \"v\", v = \"(F - c * v) / m\" }\n\
                [[barrier]]\nname = \"wall\"\nexpression = \"100 - p\"\nunit = \"m\"\n";
    match Configuration::parse(text) {
        Ok(Configuration::Filter(filter)) => filter,
        other => panic!("{other:?}"),
    }
}

/// What is planted.
#[derive(Clone, Copy, Debug)]
struct Planted {
    delay: f64,
    lag: f64,
    gain: [f64; 2],
    /// On the speed, in m/s2: a constant part, and one drawn anew at every hold.
    wind: [f64; 2],
    /// Of the place and the speed.
    noise: [f64; 2],
    mass: f64,
    drag: f64,
}

const NOTHING: Planted = Planted {
    delay: 0.0,
    lag: 0.0,
    gain: [1.0, 1.0],
    wind: [0.0, 0.0],
    noise: [0.0, 0.0],
    mass: 2.0,
    drag: 0.5,
};

/// Random numbers from -1 to 1.
struct Random(u64);

impl Random {
    fn draw(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// `holds` holds of the cart as `planted`. The force jumps every few holds, as steps and ramps.
fn recorded(planted: Planted, holds: usize, seed: u64) -> Recording {
    let mut random = Random(seed);
    let (mut forces, mut level) = (Vec::new(), 0.0);
    let mut rest: usize = 0;
    for k in 0..holds {
        if rest == 0 {
            level = if forces.iter().sum::<f64>() > 0.0 { -8.0 } else { 8.0 } * random.draw().abs();
            rest = 2 + (20.0 * random.draw().abs()) as usize;
        }
        rest -= 1;
        // The second half has ramps.
        forces.push(if 2 * k < holds { level } else { 0.5 * level + 4.0 * (0.02 * k as f64).sin() });
    }
    let column = |name: &str| Column { name: name.into(), unit: None };
    let mut recording = Recording::new(vec![column("p"), column("v"), column("F")]);
    let (mut x, mut arrived) = ([0.0_f64, 0.0], 0.0);
    let inner = (STEP / INNER).round() as usize;
    let mut gain = planted.gain[0];
    for k in 0..holds {
        let noise = [random.draw(), random.draw()];
        let seen = [0, 1].map(|i| x[i] + planted.noise[i] * noise[i]);
        recording.push(STEP * k as f64, &[seen[0], seen[1], forces[k]]);
        let wind = planted.wind[0] + planted.wind[1] * random.draw();
        if k % 15 == 0 {
            gain = 0.5 * (planted.gain[0] + planted.gain[1])
                + 0.5 * (planted.gain[1] - planted.gain[0]) * random.draw();
        }
        for i in 0..inner {
            let t = STEP * k as f64 + INNER * i as f64 - planted.delay;
            let asked = if t < -1e-9 { 0.0 } else { forces[((t + 1e-9) / STEP) as usize] };
            let before = arrived;
            arrived = if planted.lag > 0.0 {
                asked + (arrived - asked) * (-INNER / planted.lag).exp()
            } else {
                asked
            };
            let mean = if planted.lag > 0.0 { 0.5 * (before + arrived) } else { asked };
            let rate = |v: f64| (gain * mean - planted.drag * v) / planted.mass + wind;
            let middle = x[1] + 0.5 * INNER * rate(x[1]);
            x = [x[0] + INNER * middle, x[1] + INNER * rate(middle)];
        }
    }
    recording
}

fn proposed(planted: Planted, holds: usize, seed: u64, factor: f64) -> Proposal {
    let c = cart();
    let record = Record::of(&c, &[recorded(planted, holds, seed)], &[]).unwrap();
    let proposal = identify(&c, &record, factor).unwrap();
    assert_eq!(proposal.explained, proposal.holds, "{planted:?}, {seed}: {proposal:#?}");
    proposal
}

fn declared(proposal: &Proposal, kind: Kind, name: &str) -> Option<[f64; 2]> {
    proposal.findings.iter().find(|f| f.kind == kind && f.name == name).map(|f| f.declared)
}

#[test]
fn a_perfect_recording_needs_nothing() {
    let proposal = proposed(NOTHING, 400, 3, 1.2);
    assert!(proposal.findings.is_empty(), "{proposal:#?}");
    // The integrations differ by less than this, and what is unsaid is no more.
    let (_, resolution, unit) = &proposal.resolution[1];
    assert!(*resolution < 1e-4 && unit == "m/s2" && !proposal.difference.is_seen(), "{proposal:#?}");
}

/// Asserts that `declared` contains `planted` and is not much wider: by at most `more` on each side.
#[track_caller]
fn assert_contains(declared: Option<[f64; 2]>, planted: [f64; 2], more: f64, case: &str) {
    let [least, most] = declared.unwrap_or_else(|| panic!("nothing: {case}"));
    let contains = least <= planted[0] + 1e-9 && planted[1] <= most + 1e-9;
    let is_tight = planted[0] - least <= more && most - planted[1] <= more;
    assert!(contains && is_tight, "[{least}, {most}] for {planted:?}: {case}");
}

/// Without noise, everything planted alone is found to the digits of the file, and nothing else is declared.
#[test]
fn each_alone_is_found_exactly() {
    let only = |planted: Planted, kind: Kind, name: &str| {
        let proposal = proposed(planted, 600, 5, 1.2);
        // Other integrations, and a delay that is found to a thousandth of a step, leave a thousandth of the cart's 4 m/s2.
        let is_small = |f: &&Finding| f.kind == Kind::Rate && f.declared[1] < 4e-3;
        let other =
            proposal.findings.iter().find(|f| (f.kind, f.name.as_str()) != (kind, name) && !is_small(f));
        assert!(other.is_none(), "{planted:?}: {:#?}", proposal.findings);
        declared(&proposal, kind, name)
    };
    for delay in [0.004, 0.013, 0.02] {
        // To a thousandth of a step.
        let found = only(Planted { delay, ..NOTHING }, Kind::Delay, "").expect("a delay");
        assert!((found[1] - delay).abs() < 1e-3 * STEP, "{found:?}, not {delay}");
    }
    for lag in [0.01, 0.05, 0.3] {
        // The factor leaves a fifth on both sides.
        assert_contains(only(Planted { lag, ..NOTHING }, Kind::Lag, "F"), [lag; 2], 0.21 * lag, "lag");
    }
    for gain in [0.8, 0.95, 1.1] {
        let more = 0.21 * f64::abs(1.0 - gain) + 1e-3;
        assert_contains(
            only(Planted { gain: [gain; 2], ..NOTHING }, Kind::Gain, "F"),
            [gain; 2],
            more,
            "gain",
        );
    }
    assert_contains(
        only(Planted { gain: [0.85, 0.95], ..NOTHING }, Kind::Gain, "F"),
        [0.85, 0.95],
        // The draws have another mean than the middle, and the factor is for half the width.
        0.035,
        "gains",
    );
    for wind in [[0.2, 0.0], [0.0, 0.2], [0.1, 0.1]] {
        let found = only(Planted { wind, ..NOTHING }, Kind::Rate, "v").expect("a rate");
        // Of 600 draws the largest is within a hundredth of the bound.
        assert!((0.2..=0.2 * 1.22).contains(&found[1]), "{found:?}: {wind:?}");
    }
}

/// Noise is an error of the measurements, and no rate.
#[test]
fn noise_is_told_from_wind() {
    for seed in 0..6 {
        let planted = Planted { noise: [0.01, 0.02], ..NOTHING };
        let proposal = proposed(planted, 1000, seed, 1.2);
        for (name, noise) in [("p", 0.01), ("v", 0.02)] {
            let [_, found] = declared(&proposal, Kind::Error, name).expect("an error");
            assert!((noise..AT_MOST * noise).contains(&found), "{name}, {seed}: {found}");
        }
        // A plan would not notice a hundredth of the cart's 4 m/s2.
        let [_, rate] = declared(&proposal, Kind::Rate, "v").unwrap_or_default();
        assert!(rate < 0.04, "{seed}: {rate}");
        let gusty = proposed(Planted { wind: [0.0, 0.3], ..NOTHING }, 1000, seed, 1.2);
        assert!(gusty.findings.iter().all(|finding| finding.kind != Kind::Error), "{:#?}", gusty.findings);
    }
}

/// Everything at once, drawn at random.
#[test]
fn combinations_are_taken_apart() {
    let mut random = Random(17);
    let mut draw = |least: f64, most: f64| least + (most - least) * 0.5 * (1.0 + random.draw());
    for seed in 0..16 {
        let gain = draw(0.8, 1.1);
        let planted = Planted {
            delay: STEP * [0.0, 1.0, 2.5][seed % 3],
            lag: [0.0, draw(0.03, 0.2)][seed / 2 % 2],
            gain: [gain; 2],
            wind: [draw(-0.2, 0.2), draw(0.0, 0.1)],
            noise: [draw(0.0, 0.01), draw(0.002, 0.01)],
            ..NOTHING
        };
        let proposal = proposed(planted, 1500, seed as u64, 1.2);
        let case = format!("{seed}, {planted:?}: {:#?}", proposal.findings);
        let get = |kind, name: &str| declared(&proposal, kind, name);
        let delay = get(Kind::Delay, "").map_or(0.0, |delay| delay[1]);
        assert!((delay - planted.delay).abs() < 0.05 * STEP, "{case}");
        assert_contains(get(Kind::Lag, "F").or(Some([0.0; 2])), [planted.lag; 2], 0.4 * planted.lag, &case);
        // A gain that is not told from 1 is within what noise hides of it.
        let hidden = if get(Kind::Gain, "F").is_some() { 0.0 } else { 0.05 };
        let [least, most] = get(Kind::Gain, "F").unwrap_or([1.0; 2]);
        assert!(least - hidden <= gain && gain <= most + hidden && most - least < 0.12, "{case}");
        // Gusts of single holds and noise explain each other: what one lacks the other has. Over a second that is no difference.
        let size = |kind, name: &str| get(kind, name).map_or(0.0, |size| size[1]);
        let (wind, noise) = (planted.wind[0].abs() + planted.wind[1], planted.noise[1]);
        let (rate, error) = (size(Kind::Rate, "v"), size(Kind::Error, "v"));
        assert!(rate * STEP + 2.0 * error >= wind * STEP + 2.0 * 0.9 * noise, "{case}");
        assert!(rate + 2.0 * error <= AT_MOST * (wind + 2.0 * noise), "{case}");
        let place = size(Kind::Error, "p");
        assert!(0.9 * planted.noise[0] <= place && place <= AT_MOST * planted.noise[0].max(1e-3), "{case}");
    }
}

/// A delay of several steps, whole ones or not, is declared as it is, and nothing else that counts.
#[test]
fn a_long_delay_is_declared() {
    for steps in [3.0, 7.4] {
        let proposal = proposed(Planted { delay: steps * STEP, ..NOTHING }, 600, 2, 1.2);
        let [_, delay] = declared(&proposal, Kind::Delay, "").expect("a delay");
        assert!((delay - steps * STEP).abs() < 1e-3 * STEP, "{delay}");
        // Of the integration of the plant here, a ten-thousandth of a rate of 1 m/s² may be left.
        let mut others = proposal.findings.iter().filter(|finding| finding.kind != Kind::Delay);
        assert!(others.all(|other| other.declared[1] < 1e-3), "{proposal:#?}");
    }
}

/// The parameter that differs is named before a gain, which explains less.
#[test]
fn a_heavier_cart_is_recognised() {
    let c = cart();
    let record = Record::of(&c, &[recorded(Planted { mass: 2.2, ..NOTHING }, 600, 1)], &[]).unwrap();
    let difference = difference(&c, &record).unwrap();
    let best = &difference.explanations[0];
    let Cause::Parameter { parameter, value, .. } = &best.cause else { panic!("{difference:#?}") };
    assert!(parameter == "m" && (value - 2.2).abs() < 1e-3 && best.share > 0.99, "{difference:#?}");
    assert!(
        difference
            .sentence()
            .is_some_and(|text| text.starts_with("m = 2.2 in place of 2 kg would explain 99 %"))
    );
}

/// What is left out for "without the worst" makes nothing larger, and one bad sample is seen in it.
#[test]
fn one_glitch_is_told_from_the_rest() {
    let c = cart();
    let mut recording = recorded(Planted { wind: [0.0, 0.1], ..NOTHING }, 800, 4);
    let mut glitched = Recording::new(recording.columns().to_vec());
    for k in 0..recording.len() {
        let mut row = recording.row(k).to_vec();
        row[1] += if k >= 500 { 0.1 } else { 0.0 };
        glitched.push(recording.times()[k], &row);
    }
    std::mem::swap(&mut recording, &mut glitched);
    let record = Record::of(&c, &[recording], &[]).unwrap();
    let proposal = identify(&c, &record, 1.0).unwrap();
    let rate = proposal.findings.iter().find(|f| f.kind == Kind::Rate && f.name == "v").expect("a rate");
    // 0.1 m/s within one hold of 20 ms is 5 m/s2.
    assert!(rate.found[1] > 4.8, "{rate:?}");
    let [time, _] = rate.instant.expect("an instant");
    assert!((time - 9.98).abs() < 1e-9, "{rate:?}");
    assert!(rate.without_worst.is_some_and(|without| without[1] < 0.15), "{rate:?}");
}

/// What a test makes of a row: its number, time and values; `None` drops it.
type Edit<'a> = &'a dyn Fn(usize, f64, Vec<f64>) -> Option<(f64, Vec<f64>)>;

/// What is wrong with a recording is said, with the remedy.
#[test]
fn recordings_that_cannot_be_used_are_refused() {
    let c = cart();
    let good = recorded(NOTHING, 40, 1);
    let told = |columns: &[&str], edit: Edit<'_>| {
        let column = |name: &&str| Column { name: (*name).into(), unit: None };
        let mut made = Recording::new(columns.iter().map(column).collect());
        for k in 0..good.len() {
            if let Some((t, row)) = edit(k, good.times()[k], good.row(k).to_vec()) {
                made.push(t, &row);
            }
        }
        Record::of(&c, &[made], &[]).map(drop).unwrap_err().to_string()
    };
    let same = |_: usize, t: f64, row: Vec<f64>| Some((t, row));
    let names = ["p", "v", "F"];
    assert_eq!(
        told(&["p", "speed", "F"], &same),
        "column v: is missing: the state v of the model is looked for as \"v\", \"x.v\" or \"<component>.x.v\" among p, speed, F; \
         name its column by --column v=COLUMN"
    );
    assert_eq!(
        told(&["p", "v", "F"], &|k, t, row| Some((if k == 7 { 0.1 } else { t }, row))),
        "column time: is 0.1 in row 8 after 0.12, must increase; a column \"episode\" separates recordings in one file"
    );
    assert!(told(&names, &|k, t, row| (k != 20).then_some((t, row))).starts_with(
        "column time: goes from 0.38 to 0.42 s, must go on by 0.02 s, the median, to within 5 %: resample it, or "
    ));
    assert_eq!(
        told(&names, &|k, t, row| Some((t, if k == 3 { vec![row[0], f64::NAN, row[2]] } else { row }))),
        "column v: is NaN at t = 0.06 s, must be finite; cut those rows off"
    );
    assert_eq!(
        told(&names, &|k, t, row| (k < 12).then_some((t, row))),
        "recording: has 11 holds between samples, must have at least 20"
    );
}

/// Columns of `punctual run` are found: those of the filter before those of the plant.
#[test]
fn columns_of_a_run_are_found() {
    let c = cart();
    let good = recorded(NOTHING, 40, 1);
    let names =
        ["filter.status", "plant.x.p", "plant.x.v", "plant.u.F", "filter.x.p", "filter.x.v", "filter.u.F"];
    let column = |name: &&str| Column { name: (*name).into(), unit: None };
    let mut made = Recording::new(names.iter().map(column).collect());
    for k in 0..good.len() {
        let mut row = vec![0.0; 4];
        row.extend(good.row(k));
        made.push(good.times()[k], &row);
    }
    let found = Record::of(&c, &[made], &[]).unwrap();
    assert_eq!(found.episodes, Record::of(&c, &[good], &[]).unwrap().episodes);
    // What is written has the same holds.
    let again = Record::of(&c, &[found.recording()], &[]).unwrap();
    assert_eq!((again.holds(), &again.episodes[0].states), (found.holds(), &found.episodes[0].states));
}
