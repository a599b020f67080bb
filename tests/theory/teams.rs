//! Teams: 4, 6 and 10 robots in the plane that go through one another to places of their own.
//!
//! The judge moves them by an integrator of its own and looks at every pair and every place at several instants of each step. More of them:
//! `PUNCTUAL_TEAMS=100 cargo test --release --test theory -- --nocapture teams::`.

#![allow(clippy::print_stdout, reason = "the figures are wanted")]

use std::fmt::Write as _;
use std::time::Instant;

use punctual_fmu::configuration::Configuration;

use crate::judge::case::Numbers;

const PERIOD: f64 = 0.05;
/// Parts of a period at which a run is judged.
const PARTS: u32 = 8;
/// What round-off may do to a distance in m.
const ROUND_OFF: f64 = 1e-9;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// Commanded by its velocity.
    Integrator,
    PointMass,
    Unicycle,
}

impl Kind {
    fn states(self) -> usize {
        if self == Self::Integrator { 2 } else { 4 }
    }

    fn plant(self) -> &'static str {
        match self {
            Self::Integrator => {
                "plant.states = [{ name = \"x\" }, { name = \"y\" }]\nplant.inputs = [{ name = \"u\" }, { name = \"w\" }]\n\
                 plant.derivatives = { x = \"u\", y = \"w\" }"
            }
            Self::PointMass => "plant.model = \"point_mass\"",
            Self::Unicycle => "plant.model = \"unicycle\"",
        }
    }

    fn inputs(self) -> [&'static str; 2] {
        match self {
            Self::Integrator => ["u", "w"],
            Self::PointMass => ["u_x", "u_y"],
            Self::Unicycle => ["a", "omega"],
        }
    }

    fn rate(self, x: &[f64], u: &[f64], rate: &mut [f64]) {
        match self {
            Self::Integrator => rate.copy_from_slice(u),
            Self::PointMass => rate.copy_from_slice(&[x[2], x[3], u[0], u[1]]),
            Self::Unicycle => rate.copy_from_slice(&[x[3] * x[2].cos(), x[3] * x[2].sin(), u[1], u[0]]),
        }
    }

    /// The state after `dt`, by the classical method of order 4.
    fn step(self, x: &[f64], u: &[f64], dt: f64) -> Vec<f64> {
        let n = self.states();
        let rate = |x: &[f64]| {
            let mut all = vec![0.0; x.len()];
            for (i, part) in all.chunks_mut(n).enumerate() {
                self.rate(&x[n * i..n * (i + 1)], &u[2 * i..2 * (i + 1)], part);
            }
            all
        };
        let at = |k: &[f64], h: f64| x.iter().zip(k).map(|(x, k)| x + h * k).collect::<Vec<_>>();
        let a = rate(x);
        let b = rate(&at(&a, 0.5 * dt));
        let c = rate(&at(&b, 0.5 * dt));
        let d = rate(&at(&c, dt));
        (0..x.len()).map(|i| x[i] + dt / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i])).collect()
    }
}

struct Team {
    kind: Kind,
    apart: f64,
    radius: f64,
    deadline: f64,
    bound: f64,
    starts: Vec<Vec<f64>>,
    goals: Vec<[f64; 2]>,
}

/// `count` points of a square, each at least `apart` from the others.
fn places(numbers: &mut Numbers, count: usize, half: f64, apart: f64) -> Vec<[f64; 2]> {
    let mut found: Vec<[f64; 2]> = Vec::new();
    while found.len() < count {
        let place = [numbers.within(-half, half), numbers.within(-half, half)];
        if found.iter().all(|other| (place[0] - other[0]).hypot(place[1] - other[1]) > apart) {
            found.push(place);
        }
    }
    found
}

impl Team {
    fn draw(numbers: &mut Numbers, count: usize) -> Self {
        let kind = [Kind::Integrator, Kind::PointMass, Kind::Unicycle][numbers.below(3)];
        let apart = numbers.within(0.3, 1.0);
        let half = apart * (count as f64).sqrt() * numbers.within(1.5, 2.5);
        let starts = places(numbers, count, half, 1.3 * apart);
        let goals = places(numbers, count, half, 1.5 * apart);
        let bound = numbers.within(0.3, 1.0);
        // From a slow start across the square and back: some time to spare, and often to wait for others.
        let across = 2.0 * half * 2.0_f64.sqrt();
        let deadline = match kind {
            Kind::Integrator => across / bound,
            _ => 2.0 * (across / bound).sqrt(),
        } * numbers.within(1.5, 3.0)
            + 2.0;
        let mut start = |place: [f64; 2]| match kind {
            Kind::Integrator => place.to_vec(),
            Kind::PointMass => vec![place[0], place[1], numbers.within(-0.1, 0.1), numbers.within(-0.1, 0.1)],
            Kind::Unicycle => vec![place[0], place[1], numbers.within(-3.1, 3.1), numbers.within(0.0, 0.1)],
        };
        let starts = starts.into_iter().map(&mut start).collect();
        Self { kind, apart, radius: 0.4 * apart, deadline, bound, starts, goals }
    }

    fn file(&self) -> String {
        let [first, second] = self.kind.inputs();
        let (bound, turn) = (self.bound, if self.kind == Kind::Unicycle { 1.5 } else { self.bound });
        let mut text = format!(
            "kind = \"filter\"\n{}\nkeep_apart = {:?}\nexperiment.step_size = {PERIOD}\n\
             bounds = {{ {first} = [-{bound:?}, {bound:?}], {second} = [-{turn:?}, {turn:?}] }}\n",
            self.kind.plant(),
            self.apart
        );
        for (i, [x, y]) in self.goals.iter().enumerate() {
            let _ = write!(
                text,
                "[[agent]]\nname = \"r{i}\"\n[[barrier]]\nname = \"goal\"\nagent = \"r{i}\"\ncentre = [{x:?}, {y:?}]\n\
                 radius = {:?}\ndeadline = {:?}\n",
                self.radius, self.deadline
            );
        }
        text
    }

    /// What is wrong with the state `x` at `t`.
    fn flaw(&self, t: f64, x: &[f64]) -> Option<String> {
        let n = self.kind.states();
        let place = |i: usize| [x[n * i], x[n * i + 1]];
        let distance = |p: [f64; 2], q: [f64; 2]| (p[0] - q[0]).hypot(p[1] - q[1]);
        let count = self.goals.len();
        let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| [i, j]));
        let near = pairs
            .map(|[i, j]| (i, j, distance(place(i), place(j))))
            .find(|(.., d)| *d < self.apart - ROUND_OFF);
        if let Some((i, j, d)) = near {
            return Some(format!("{i} and {j} are {d} m apart at {t}, {} m were promised", self.apart));
        }
        let away = (0..count).map(|i| (i, distance(place(i), self.goals[i])));
        let late = away.clone().find(|(_, d)| t >= self.deadline - ROUND_OFF && *d > self.radius + ROUND_OFF);
        late.map(|(i, d)| format!("{i} is {d} m from its goal at {t}"))
    }

    /// What the controllers want: nothing, rest, their goals, anything, or one another.
    fn wanted(&self, kind: usize, x: &[f64], numbers: &mut Numbers) -> Vec<f64> {
        let n = self.kind.states();
        let count = self.goals.len();
        let mean = [0, 1].map(|axis| (0..count).map(|i| x[n * i + axis]).sum::<f64>() / count as f64);
        (0..count)
            .flat_map(|i| {
                let x = &x[n * i..n * (i + 1)];
                let towards = |[px, py]: [f64; 2]| {
                    let [dx, dy] = [px - x[0], py - x[1]];
                    match self.kind {
                        Kind::Integrator => [dx, dy],
                        Kind::PointMass => [dx - 1.5 * x[2], dy - 1.5 * x[3]],
                        Kind::Unicycle => [1.0 - x[3], 2.0 * (dy.atan2(dx) - x[2]).sin()],
                    }
                };
                match kind {
                    0 => [0.0; 2],
                    1 if self.kind == Kind::PointMass => [-x[2], -x[3]],
                    1 if self.kind == Kind::Unicycle => [-x[3], 0.0],
                    1 | 2 => towards(self.goals[i]),
                    3 => [numbers.within(-self.bound, self.bound), numbers.within(-self.bound, self.bound)],
                    _ => towards(mean),
                }
            })
            .collect()
    }
}

#[test]
fn teams_keep_apart_and_arrive() {
    let teams: usize = std::env::var("PUNCTUAL_TEAMS").map_or(1, |count| count.parse().expect("a number"));
    let seed: u64 = std::env::var("PUNCTUAL_SEED").map_or(1, |seed| seed.parse().expect("a number"));
    let mut broken = Vec::new();
    for count in [4, 6, 10] {
        // By day ten are for the figures alone.
        if teams == 1 && count == 10 {
            continue;
        }
        let (mut accepted, mut search, mut steps, mut longest) = (0, Vec::new(), Vec::new(), 0.0_f64);
        for run in 0..teams {
            let mut numbers = Numbers::new(1000 * seed + 100_000 * count as u64 + run as u64);
            let team = Team::draw(&mut numbers, count);
            let Ok(Configuration::Filter(configuration)) = Configuration::parse(&team.file()) else {
                panic!("{:?}", Configuration::parse(&team.file()))
            };
            let mut filter = configuration.build_loop().expect("a filter");
            let (mut x, mut u) = (team.starts.concat(), vec![0.0; 2 * count]);
            let mut flaw = None;
            for k in 0..((team.deadline + 2.0) / PERIOD) as u32 {
                let t = f64::from(k) * PERIOD;
                let u_ref = team.wanted(run % 5, &x, &mut numbers);
                let began = Instant::now();
                let report = filter.step(t, &x, &u_ref, &mut u).expect("right dimensions");
                let took = began.elapsed().as_secs_f64();
                let assurance = report.assurance.expect("plans");
                if k == 0 {
                    search.push(took);
                    if !assurance.is_assured() {
                        println!(
                            "{count}/{run}: refused, {:?}, {:?} in {} s, {took:.1} s",
                            assurance.failure, team.kind, team.deadline
                        );
                        break;
                    }
                    accepted += 1;
                } else {
                    steps.push(took);
                    longest = longest.max(took);
                    if !assurance.is_assured() {
                        flaw = Some(format!("lost at {t}, {assurance:?}"));
                        break;
                    }
                }
                let instants = (1..=PARTS).map(|part| PERIOD * f64::from(part) / f64::from(PARTS));
                let seen: Vec<_> = instants.map(|dt| (t + dt, team.kind.step(&x, &u, dt))).collect();
                flaw = seen.iter().find_map(|(t, x)| team.flaw(*t, x));
                if flaw.is_some() {
                    break;
                }
                x.clone_from(&seen[seen.len() - 1].1);
            }
            broken.extend(flaw.map(|flaw| format!("{count}/{run}: {flaw}, {:?}", team.kind)));
        }
        search.sort_by(f64::total_cmp);
        steps.sort_by(f64::total_cmp);
        println!(
            "{count} robots: {accepted} of {teams} accepted; search: median {:.2} s, longest {:.2} s; step: median {:.2} ms, longest {:.1} ms",
            search[search.len() / 2],
            search[search.len() - 1],
            1e3 * steps.get(steps.len() / 2).copied().unwrap_or(f64::NAN),
            1e3 * longest
        );
        assert!(2 * accepted >= teams, "{accepted} of {teams}");
    }
    println!("{} broken", broken.len());
    assert!(broken.is_empty(), "{broken:#?}");
}

/// The search needs no policy for robots that all meet in the middle.
#[test]
fn ten_robots_swap_places() {
    let file = include_str!("../../examples/models/swarm.toml");
    let Ok(Configuration::Filter(configuration)) = Configuration::parse(file) else { panic!("no filter") };
    let mut filter = configuration.build_loop().expect("a filter");
    let on_circle = |i: u32| f64::from(i) * std::f64::consts::PI / 5.0;
    let x: Vec<f64> = (0..10).flat_map(|i| [on_circle(i).cos(), on_circle(i).sin()]).collect();
    let report = filter.step(0.0, &x, &[0.0; 20], &mut [0.0; 20]).expect("right dimensions");
    assert!(report.assurance.expect("plans").is_assured(), "{:?}", report.assurance);
}
