//! Missions: places to visit by a time and in an order, to stay at, to keep, to keep out of, one or the other.
//!
//! The judge moves the vehicle by an integrator of its own, and reads a mission as signal temporal logic: a visit is an instant in
//! its window, what is kept is kept at every instant that it looks at, between samples too. More missions:
//! `PUNCTUAL_MISSIONS=1000 cargo test --release -p punctual-core --test all -- --nocapture missions::`. With `PUNCTUAL_ORACLE` they
//! are also written to that file, for `tests/oracle/missions.py`, and no run goes on past its first sample.

#![allow(clippy::print_stdout, reason = "the figures are wanted")]

use serde_json::json;

use crate::uncertain;

use punctual_core::barriers::{DistanceDisc, Outside};
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::*;
use punctual_core::plants::{PointMass, Unicycle};
use uncertain::Draws;

const PERIOD: f64 = 0.05;
/// Parts of a period at which a run is judged.
const PARTS: u32 = 8;

#[derive(Clone, Copy, Debug)]
struct Disc {
    centre: [f64; 2],
    radius: f64,
}

impl Disc {
    fn h(&self, x: &[f64; 4]) -> f64 {
        self.radius - (x[0] - self.centre[0]).hypot(x[1] - self.centre[1])
    }

    fn barrier(&self) -> DistanceDisc {
        DistanceDisc::new(self.centre, self.radius, self.radius).expect("a disc")
    }
}

/// A part of a mission.
#[derive(Clone, Copy, Debug)]
enum Part {
    /// F\[a, b\] A, or F\[a, b\] G\[0, s\] A.
    Visit { place: Disc, window: [f64; 2], stay: f64 },
    /// G\[b, ∞) A, and enforced from a on.
    Reach { place: Disc, window: [f64; 2] },
    /// G\[a, b\] !C.
    Avoid { place: Disc, window: [f64; 2] },
    /// !C until the visit of the part of this number.
    Closed { place: Disc, until: usize },
}

struct Mission {
    parts: Vec<Part>,
    /// Of the parts of these numbers, one is to be done.
    one_of: Option<[usize; 2]>,
    /// The first is visited before the second.
    order: Option<[usize; 2]>,
    x: [f64; 4],
    bounds: [f64; 2],
    end: f64,
}

impl Mission {
    /// A mission of 2 to 6 parts.
    fn draw(draws: &mut Draws, is_point: bool) -> Self {
        let end = draws.within(12.0, 30.0);
        let mut place = |size: [f64; 2]| Disc {
            centre: [draws.within(-10.0, 10.0), draws.within(-10.0, 10.0)],
            radius: draws.within(size[0], size[1]),
        };
        let places: [Disc; 6] = core::array::from_fn(|_| place([0.6, 1.5]));
        let rocks: [Disc; 3] = core::array::from_fn(|_| place([0.6, 2.0]));
        let count = 1 + (draws.part() * 3.0) as usize;
        let mut parts: Vec<Part> = (0..count)
            .map(|i| {
                let latest = draws.within(0.3, 1.0) * end;
                let begin = if draws.part() < 0.3 { draws.within(0.0, 0.8) * latest } else { 0.0 };
                let stay = if draws.part() < 0.3 { draws.within(0.2, 2.0) } else { 0.0 };
                Part::Visit { place: places[i], window: [begin, latest], stay }
            })
            .collect();
        let mut one_of = None;
        if count >= 2 && draws.part() < 0.4 {
            one_of = Some([0, 1]);
        }
        // What begins by the clock does not begin with an arrival too.
        let is_free = matches!(parts.get(1), Some(Part::Visit { window: [0.0, _], .. }));
        let order = (is_free && one_of.is_none() && draws.part() < 0.4).then_some([0, 1]);
        if draws.part() < 0.6 {
            let begin = if draws.part() < 0.5 { draws.within(0.1, 0.8) * end } else { 0.0 };
            parts.push(Part::Reach { place: places[4], window: [begin, end] });
        }
        if draws.part() < 0.6 {
            let begin = if draws.part() < 0.4 { draws.within(0.1, 0.5) * end } else { 0.0 };
            let until = if draws.part() < 0.4 { begin + draws.within(1.0, 5.0) } else { f64::INFINITY };
            parts.push(Part::Avoid { place: rocks[0], window: [begin, until] });
        }
        if one_of.is_none() && draws.part() < 0.4 {
            parts.push(Part::Closed { place: rocks[1], until: 0 });
        }
        if parts.len() < 2 {
            parts.push(Part::Avoid { place: rocks[2], window: [0.0, f64::INFINITY] });
        }
        let speed = draws.within(0.0, 1.0);
        let x = match is_point {
            true => [0.0, 0.0, speed, draws.within(-1.0, 1.0)],
            false => [0.0, 0.0, draws.within(-3.0, 3.0), speed],
        };
        let bounds = [draws.within(1.0, 4.0), draws.within(1.0, 3.0)];
        Self { parts, one_of, order, x, bounds, end }
    }

    fn filter<P>(&self, plant: P) -> Filter
    where
        P: ControlAffine<4, 2> + Send + Sync + 'static,
    {
        let mut builder = Filter::builder(plant);
        for (i, part) in self.parts.iter().enumerate() {
            let name = format!("part{i}");
            let begin = |a: f64| if a > 0.0 { Begin::At(a) } else { Begin::AtOnce };
            let keeping = BarrierSettings::keeping();
            let (built, begin, end) = match *part {
                Part::Visit { place, window: [a, b], stay } => {
                    let end = if stay > 0.0 { End::AfterStay(stay) } else { End::OnArrival };
                    let begin = match self.order {
                        Some([first, then]) if then == i => Begin::AfterArrival(first),
                        _ => begin(a),
                    };
                    (builder.barrier(&name, place.barrier(), BarrierSettings::within(b)), begin, end)
                }
                Part::Reach { place, window: [a, b] } => (
                    builder.barrier(&name, place.barrier(), BarrierSettings::within(b)),
                    begin(a),
                    End::Never,
                ),
                Part::Avoid { place, window: [a, b] } => {
                    let end = if b.is_finite() { End::At(b) } else { End::Never };
                    (builder.barrier(&name, Outside(place.barrier()), keeping), begin(a), end)
                }
                Part::Closed { place, until } => {
                    let outside = Outside(place.barrier());
                    (builder.barrier(&name, outside, keeping), Begin::AtOnce, End::AfterArrival(until))
                }
            };
            builder = built.and_then(|b| b.window(begin, end)).expect("a barrier");
        }
        let plans = Plans::every(PERIOD);
        let plans = match self.one_of {
            Some([a, b]) => plans.one_of(&[&[a], &[b]]),
            None => plans,
        };
        let bounds = self.bounds;
        let filter = builder.bounds(&bounds.map(|b| -b), &bounds).expect("bounds");
        let filter = filter.sampling(Sampling::Period(PERIOD)).and_then(FilterBuilder::build);
        filter.and_then(|filter| filter.with_plans(plans)).expect("a filter with plans")
    }

    /// The mission for an optimiser.
    fn case(&self, is_point: bool, accepted: bool) -> serde_json::Value {
        let part = |part: &Part| {
            let of = |kind: &str, place: &Disc, window: [f64; 2], stay: f64, until: Option<usize>| {
                json!({
                    "kind": kind, "centre": place.centre, "radius": place.radius, "window": window, "stay": stay,
                    "until": until,
                })
            };
            match part {
                Part::Visit { place, window, stay } => of("visit", place, *window, *stay, None),
                Part::Reach { place, window } => of("reach", place, *window, 0.0, None),
                Part::Avoid { place, window } => of("avoid", place, *window, 0.0, None),
                Part::Closed { place, until } => of("closed", place, [0.0, f64::INFINITY], 0.0, Some(*until)),
            }
        };
        json!({
            "is_point": is_point, "accepted": accepted, "start": self.x, "bounds": self.bounds, "end": self.end,
            "order": self.order, "one_of": self.one_of, "parts": self.parts.iter().map(part).collect::<Vec<_>>(),
        })
    }

    /// The ends of its windows, which a judge must not miss.
    fn ends(&self) -> impl Iterator<Item = f64> {
        self.parts.iter().flat_map(|part| match *part {
            Part::Visit { window, .. } | Part::Reach { window, .. } | Part::Avoid { window, .. } => window,
            Part::Closed { .. } => [f64::INFINITY; 2],
        })
    }

    /// Why the run did not do the mission: h of its parts at the instants `seen`.
    fn flaw(&self, seen: &[(f64, [f64; 4])]) -> Option<String> {
        let visit = |i: usize, from: f64| -> Option<f64> {
            let Part::Visit { place, window: [a, b], stay } = self.parts[i] else { return None };
            let is_there = |k: usize| {
                let t = seen[k].0;
                let stays = seen[k..].iter().take_while(|(s, _)| *s <= t + stay + 1e-9);
                a.max(from) - 1e-9 <= t && t <= b + 1e-9 && stays.clone().all(|(_, x)| place.h(x) >= -1e-9)
            };
            (0..seen.len()).find(|k| is_there(*k)).map(|k| seen[k].0)
        };
        let fails = |i: usize| match self.parts[i] {
            Part::Visit { .. } => {
                let first = self.order.filter(|[_, then]| *then == i).map(|[first, _]| first);
                let from = first.map_or(Some(0.0), |first| visit(first, 0.0));
                let done = from.is_some_and(|from| visit(i, from).is_some());
                (!done).then(|| format!("part {i} is not visited"))
            }
            Part::Reach { place, window: [_, b] } => {
                let left = seen.iter().find(|(t, x)| *t >= b && place.h(x) < -1e-9);
                left.map(|(t, x)| format!("part {i} is left by {} at {t}", -place.h(x)))
            }
            Part::Avoid { place, window: [a, b] } => {
                // What begins at once is promised to who begins outside.
                let is_promised = a > 0.0 || place.h(&seen[0].1) <= 0.0;
                let hit = seen.iter().find(|(t, x)| a <= *t && *t < b && place.h(x) > 1e-9);
                hit.filter(|_| is_promised).map(|(t, x)| format!("part {i} is hit by {} at {t}", place.h(x)))
            }
            Part::Closed { place, until } => {
                let opens = visit(until, 0.0).unwrap_or(f64::INFINITY);
                let hit = seen.iter().find(|(t, x)| *t < opens && place.h(x) > 1e-9);
                let is_promised = place.h(&seen[0].1) <= 0.0;
                hit.filter(|_| is_promised).map(|(t, x)| format!("part {i} is hit by {} at {t}", place.h(x)))
            }
        };
        let either = self.one_of.unwrap_or([usize::MAX; 2]);
        let of_all = (0..self.parts.len()).filter(|i| !either.contains(i)).find_map(fails);
        let of_either = || {
            let [a, b] = self.one_of?;
            fails(a).and(fails(b))
        };
        of_all.or_else(of_either)
    }
}

fn step(is_point: bool, x: &[f64; 4], u: &[f64; 2], dt: f64) -> [f64; 4] {
    let rate = |x: &[f64; 4]| match is_point {
        true => [x[2], x[3], u[0], u[1]],
        false => [x[3] * x[2].cos(), x[3] * x[2].sin(), u[1], u[0]],
    };
    let at = |k: &[f64; 4], h: f64| core::array::from_fn(|i| x[i] + h * k[i]);
    let a = rate(x);
    let b = rate(&at(&a, 0.5 * dt));
    let c = rate(&at(&b, 0.5 * dt));
    let d = rate(&at(&c, dt));
    core::array::from_fn(|i| x[i] + dt / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]))
}

/// What a controller wants: nothing, damping, anything, to one place after the other, or away from where it has to go.
fn wanted(
    kind: usize,
    mission: &Mission,
    t: f64,
    x: &[f64; 4],
    is_point: bool,
    draws: &mut Draws,
) -> [f64; 2] {
    let bounds = mission.bounds;
    let towards = |to: [f64; 2]| match is_point {
        true => [to[0] - 1.5 * x[2], to[1] - 1.5 * x[3]],
        false => [bounds[0] * (2.0 - x[3]), 3.0 * (to[1].atan2(to[0]) - x[2]).sin()],
    };
    let goals: Vec<[f64; 2]> = mission
        .parts
        .iter()
        .filter_map(|part| match part {
            Part::Visit { place, .. } | Part::Reach { place, .. } => Some(place.centre),
            _ => None,
        })
        .collect();
    let goal = goals.get((t / 4.0) as usize % goals.len().max(1)).copied().unwrap_or([3.0, 3.0]);
    match kind {
        0 => [0.0; 2],
        1 if is_point => [-x[2], -x[3]],
        1 => [-x[3], 0.0],
        2 => bounds.map(|b| draws.within(-1.0, 1.0) * b),
        3 => towards([goal[0] - x[0], goal[1] - x[1]]),
        _ => towards([x[0] - goal[0], x[1] - goal[1]]),
    }
}

#[test]
fn missions_are_done_once_promised() {
    let missions = std::env::var("PUNCTUAL_MISSIONS").map_or(6, |count| count.parse().unwrap());
    let seed = std::env::var("PUNCTUAL_SEED").map_or(1, |seed| seed.parse().unwrap());
    let (mut accepted, mut broken) = (0, Vec::new());
    let (oracle, mut cases) = (std::env::var_os("PUNCTUAL_ORACLE"), Vec::new());
    let mut search = Vec::new();
    for run in 0..missions {
        let mut draws = Draws(1000 * seed + run);
        let is_point = run % 2 == 0;
        let mission = Mission::draw(&mut draws, is_point);
        let mut filter = if is_point { mission.filter(PointMass) } else { mission.filter(Unicycle) };
        let (mut x, mut u) = (mission.x, [0.0; 2]);
        let mut seen = vec![(0.0, x)];
        let steps = (1.2 * mission.end / PERIOD) as u32;
        for k in 0..steps {
            let t = f64::from(k) * PERIOD;
            let u_ref = wanted((run / 2) as usize % 5, &mission, t, &x, is_point, &mut draws);
            let began = std::time::Instant::now();
            let report = filter.step(t, &x, &u_ref, &mut u).expect("right dimensions");
            let assurance = report.assurance.expect("plans");
            if k == 0 {
                search.push(began.elapsed().as_secs_f64());
                cases.push(mission.case(is_point, assurance.is_assured()));
                if !assurance.is_assured() {
                    println!(
                        "{run}: refused, {:?}, {:?}, {:?}, {:?}",
                        assurance.failure, mission.parts, mission.x, mission.bounds
                    );
                    break;
                }
                accepted += 1;
                if oracle.is_some() {
                    break;
                }
            } else if !assurance.is_assured() {
                broken.push(format!("{run}: lost at {t}, {assurance:?}"));
                break;
            }
            let mut instants: Vec<f64> =
                (1..=PARTS).map(|part| PERIOD * f64::from(part) / f64::from(PARTS)).collect();
            instants.extend(mission.ends().map(|end| end - t).filter(|dt| (0.0..PERIOD).contains(dt)));
            instants.sort_by(f64::total_cmp);
            seen.extend(instants.into_iter().map(|dt| (t + dt, step(is_point, &x, &u, dt))));
            x = seen.last().expect("some").1;
            if k + 1 == steps {
                broken.extend(mission.flaw(&seen).map(|flaw| format!("{run}: {flaw}, {:?}", mission.parts)));
            }
        }
    }
    if let Some(path) = oracle {
        let text = serde_json::to_string(&cases).expect("JSON");
        std::fs::write(path, text).expect("a file");
    }
    search.sort_by(f64::total_cmp);
    println!(
        "{accepted} of {missions} accepted, {} broken; search: median {:.2} s, longest {:.2} s",
        broken.len(),
        search[search.len() / 2],
        search[search.len() - 1],
    );
    assert!(broken.is_empty(), "{broken:#?}");
    assert!(2 * accepted >= missions, "{accepted} of {missions}");
}
