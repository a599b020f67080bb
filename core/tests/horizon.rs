//! Plants without a rest, and sets that move for ever: what is promised until a time is kept until then, and that time is
//! put off. Judged by an integrator of its own.

#![expect(clippy::print_stdout, reason = "the figures of tests/nightly")]

use punctual_core::barrier::Barrier;
use punctual_core::barriers::{DistanceDisc, Outside, StateBound};
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::{
    AssuranceStatus, BarrierSettings, Begin, End, Filter, FilterBuilder, FilterState, Plans, Sampling,
};
use punctual_core::plan::Failure;
use punctual_core::plants::{PointMass, Unicycle};
use punctual_core::scalar::Scalar;

const PERIOD: f64 = 0.05;
const HORIZON: f64 = 8.0;
const INSTANTS: u32 = 10;
/// What the integrator of the test misses h by, and what the profile aims at beyond 0.
const TOLERANCE: f64 = 1e-6;

/// Numbers that are the same on every machine.
struct Random(u64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// One that flies at one height and one speed in m/s, and turns at a rate in rad/s: x, y, course.
#[derive(Clone, Copy)]
struct Glider(f64);

impl ControlAffine<3, 1> for Glider {
    fn drift<S: Scalar>(&self, x: &[S; 3]) -> [S; 3] {
        let (sin, cos) = x[2].sin_cos();
        [cos * S::from(self.0), sin * S::from(self.0), S::zero()]
    }

    fn input_map<S: Scalar>(&self, _: &[S; 3]) -> [[S; 1]; 3] {
        [[S::zero()], [S::zero()], [S::one()]]
    }
}

/// A disc whose centre circles around `centre`, `arm` m away from it, at `turning` rad/s.
#[derive(Clone, Copy)]
struct Circling {
    centre: [f64; 2],
    arm: f64,
    turning: f64,
    radius: f64,
}

impl Circling {
    fn centre(&self, t: f64) -> [f64; 2] {
        let (sin, cos) = (self.turning * t).sin_cos();
        [self.centre[0] + self.arm * cos, self.centre[1] + self.arm * sin]
    }
}

impl<const NX: usize> Barrier<NX> for Circling {
    fn value<S: Scalar>(&self, t: S, x: &[S; NX]) -> S {
        let (sin, cos) = (t * S::from(self.turning)).sin_cos();
        let dx = x[0] - cos * S::from(self.arm) - S::from(self.centre[0]);
        let dy = x[1] - sin * S::from(self.arm) - S::from(self.centre[1]);
        S::from(self.radius * self.radius) - dx * dx - dy * dy
    }
}

/// A world: what moves, and the sets that it is to be in.
trait World {
    const INPUTS: usize;
    fn rate(&self, x: &[f64], u: &[f64]) -> Vec<f64>;
    fn bounds(&self) -> Vec<f64>;
    /// h of each.
    fn barriers(&self, t: f64, x: &[f64]) -> Vec<f64>;
    fn filter(&self) -> Filter;
    fn deadline(&self) -> f64;

    fn move_by(&self, x: &[f64], u: &[f64], dt: f64) -> Vec<f64> {
        let at = |k: &[f64], s: f64| -> Vec<f64> { x.iter().zip(k).map(|(x, k)| x + s * k).collect() };
        let a = self.rate(x, u);
        let b = self.rate(&at(&a, dt / 2.0), u);
        let c = self.rate(&at(&b, dt / 2.0), u);
        let d = self.rate(&at(&c, dt), u);
        (0..x.len()).map(|i| x[i] + dt / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i])).collect()
    }
}

fn within(deadline: f64) -> BarrierSettings {
    BarrierSettings::within(deadline).margin(0.02)
}

fn keeping() -> BarrierSettings {
    BarrierSettings::keeping().margin(0.02)
}

fn built<P, const NX: usize, const NU: usize>(
    builder: Result<FilterBuilder<P, NX, NU>, punctual_core::Error>,
    bounds: &[f64],
) -> Filter {
    let least: Vec<f64> = bounds.iter().map(|b| -b).collect();
    builder
        .and_then(|b| b.bounds(&least, bounds))
        .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
        .and_then(FilterBuilder::build)
        .expect("valid filter")
}

/// A glider that has to come into a disc, past a tower, and to loiter there.
struct Loiter {
    speed: f64,
    turning: f64,
    deadline: f64,
    goal: ([f64; 2], f64),
    tower: ([f64; 2], f64),
}

impl Loiter {
    fn draw(random: &mut Random) -> (Self, Vec<f64>) {
        let (speed, turning) = (random.between(8.0, 20.0), random.between(0.3, 1.2));
        let turn = speed / turning;
        let (away, at) = (random.between(4.0, 12.0) * turn, random.between(-3.1, 3.1));
        let goal = ([away * at.cos(), away * at.sin()], random.between(1.6, 5.0) * turn);
        let part = random.between(0.3, 0.6);
        let tower = ([part * goal.0[0], part * goal.0[1] + 0.3 * turn], random.between(0.1, 0.4) * turn);
        let deadline = (away / speed + 3.0 / turning) * random.between(1.2, 2.0);
        let world = Self { speed, turning, deadline, goal, tower };
        (world, vec![0.0, 0.0, random.between(-3.1, 3.1)])
    }
}

impl World for Loiter {
    const INPUTS: usize = 1;
    fn rate(&self, x: &[f64], u: &[f64]) -> Vec<f64> {
        vec![self.speed * x[2].cos(), self.speed * x[2].sin(), u[0]]
    }
    fn bounds(&self) -> Vec<f64> {
        vec![self.turning]
    }
    fn barriers(&self, _: f64, x: &[f64]) -> Vec<f64> {
        let far = |(c, _): ([f64; 2], f64)| (x[0] - c[0]).hypot(x[1] - c[1]);
        vec![self.goal.1 - far(self.goal), far(self.tower) - self.tower.1]
    }
    fn filter(&self) -> Filter {
        let disc = |(centre, radius)| DistanceDisc::new(centre, radius, 1.0).expect("valid disc");
        let builder = Filter::builder(Glider(self.speed))
            .barrier("goal", disc(self.goal), within(self.deadline))
            .and_then(|b| b.barrier("tower", Outside(disc(self.tower)), keeping()));
        built(builder, &self.bounds())
    }
    fn deadline(&self) -> f64 {
        self.deadline
    }
}

/// A unicycle that has to be in a disc that goes round and round, no slower and no faster than its bounds of speed.
struct Chase {
    disc: Circling,
    bounds: [f64; 2],
    speeds: [f64; 2],
    deadline: f64,
}

impl Chase {
    fn draw(random: &mut Random) -> (Self, Vec<f64>) {
        let arm = random.between(5.0, 20.0);
        let speed = random.between(1.0, 3.0);
        let disc = Circling {
            centre: [random.between(-10.0, 10.0), random.between(-10.0, 10.0)],
            arm,
            turning: speed / arm,
            radius: random.between(1.5, 4.0),
        };
        let speeds = [0.3 * speed, random.between(2.0, 3.0) * speed];
        let bounds = [random.between(1.5, 4.0), random.between(0.8, 2.0)];
        let world = Self { disc, bounds, speeds, deadline: random.between(10.0, 20.0) };
        (world, vec![random.between(-5.0, 5.0), random.between(-5.0, 5.0), random.between(-3.1, 3.1), speed])
    }
}

impl World for Chase {
    const INPUTS: usize = 2;
    fn rate(&self, x: &[f64], u: &[f64]) -> Vec<f64> {
        vec![x[3] * x[2].cos(), x[3] * x[2].sin(), u[1], u[0]]
    }
    fn bounds(&self) -> Vec<f64> {
        self.bounds.to_vec()
    }
    fn barriers(&self, t: f64, x: &[f64]) -> Vec<f64> {
        let c = self.disc.centre(t);
        let far = (x[0] - c[0]).hypot(x[1] - c[1]);
        vec![self.disc.radius - far, x[3] - self.speeds[0], self.speeds[1] - x[3]]
    }
    fn filter(&self) -> Filter {
        let [slow, fast] = [StateBound::at_least(3, self.speeds[0]), StateBound::at_most(3, self.speeds[1])]
            .map(|bound| bound.expect("a bound"));
        let settings = keeping().margin(0.0);
        let builder = Filter::builder(Unicycle)
            .barrier("disc", self.disc, within(self.deadline))
            .and_then(|b| b.barrier("slow", slow, settings))
            .and_then(|b| b.barrier("fast", fast, settings));
        built(builder, &self.bounds())
    }
    fn deadline(&self) -> f64 {
        self.deadline
    }
}

/// What came of a run.
#[derive(Debug, PartialEq)]
enum Came {
    Refused(Option<Failure>),
    /// Assured to the end of the run.
    Kept,
    /// The last time until which it was assured.
    Expired(f64),
}

/// Runs `world` from `x` for `length` s with the wanted input number `kind`, and asserts what is promised.
fn run<W: World>(world: &W, mut x: Vec<f64>, kind: u64, length: f64, random: &mut Random) -> Came {
    let plans = Plans::every(PERIOD).horizon(HORIZON);
    let mut filter = world.filter().with_plans(plans).expect("a filter that can be assured");
    let (bounds, mut until, mut u) = (world.bounds(), 0.0, vec![0.0; W::INPUTS]);
    let mut drawn = vec![0.0; W::INPUTS];
    let inside: Vec<bool> = world.barriers(0.0, &x).into_iter().map(|h| h >= 0.0).collect();
    let last = if inside.contains(&false) { world.deadline() } else { 0.0 };
    for k in 0..(length / PERIOD) as u32 {
        let t = f64::from(k) * PERIOD;
        if k % 20 == 0 {
            drawn = bounds.iter().map(|b| random.between(-b, *b)).collect();
        }
        let u_ref: Vec<f64> = match kind % 4 {
            0 => vec![0.0; W::INPUTS],
            1 => bounds.clone(),
            2 => bounds.iter().map(|b| -3.0 * b).collect(),
            _ => drawn.clone(),
        };
        let assurance =
            filter.step(t, &x, &u_ref, &mut u).expect("right dimensions").assurance.expect("plans");
        match assurance.status {
            AssuranceStatus::Refused => return Came::Refused(assurance.failure),
            AssuranceStatus::Expired => {
                assert!(t >= until - 1e-9, "ended at {t}, before {until}");
                assert_eq!(assurance.until, None);
                return Came::Expired(until);
            }
            AssuranceStatus::Assured => {}
            _ => panic!("{t}: {assurance:?}"),
        }
        let now = assurance.until.expect("a time");
        assert!(now >= until && now > t + 0.5 * PERIOD, "{t}: from {until} back to {now}");
        if k == 0 {
            assert!(now >= last + HORIZON - PERIOD, "{now}");
        }
        until = now;
        assert!(u.iter().zip(&bounds).all(|(u, b)| u.abs() <= b + 1e-9), "{t}: {u:?}");
        let mut at = x.clone();
        for instant in 1..=INSTANTS {
            at = world.move_by(&at, &u, PERIOD / f64::from(INSTANTS));
            let now = t + PERIOD * f64::from(instant) / f64::from(INSTANTS);
            for (barrier, (h, inside)) in world.barriers(now, &at).into_iter().zip(&inside).enumerate() {
                let due = *inside || now >= world.deadline();
                assert!(!due || h >= -TOLERANCE, "{kind}: barrier {barrier} has h = {h} at {now}");
            }
        }
        x = at;
    }
    Came::Kept
}

/// Draws worlds, and counts what comes of them: those that are refused, kept, and over before the end.
fn draws<W: World>(seeds: u64, draw: impl Fn(&mut Random) -> (W, Vec<f64>)) -> [u32; 3] {
    let mut came = [0; 3];
    for seed in 1..=seeds {
        let random = &mut Random(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed));
        let (world, x) = draw(random);
        let length = world.deadline() + 4.0 * HORIZON;
        let began = std::time::Instant::now();
        let what = run(&world, x, seed, length, random);
        println!("{seed}: {what:?} of {length:.1} s in {:.1} s", began.elapsed().as_secs_f64());
        came[match what {
            Came::Refused(_) => 0,
            Came::Kept => 1,
            Came::Expired(_) => 2,
        }] += 1;
    }
    came
}

fn seeds(few: u64) -> u64 {
    if std::env::var_os("PUNCTUAL_TABLES").is_some() { 100 * few } else { few }
}

#[test]
fn what_cannot_rest_goes_on_within_its_sets() {
    let [refused, kept, over] = draws(seeds(10), Loiter::draw);
    println!("a glider that has to loiter: {refused} refused, {kept} kept, {over} over before the end");
    assert!(10 * kept >= 7 * (refused + kept + over));
}

#[test]
fn a_set_that_goes_round_is_stayed_in() {
    let [refused, kept, over] = draws(seeds(3), Chase::draw);
    println!("a disc that goes round: {refused} refused, {kept} kept, {over} over before the end");
    assert!(10 * kept >= 7 * (refused + kept + over));
}

/// A strip across x whose middle flees at 0.12 t m/s2, ever faster than a vehicle can follow.
#[derive(Clone, Copy)]
struct Fleeing;

impl<const NX: usize> Barrier<NX> for Fleeing {
    fn value<S: Scalar>(&self, t: S, x: &[S; NX]) -> S {
        let off = x[0] - t * t * t * 0.02;
        S::from(4.0) - off * off
    }
}

fn fleeing(horizon: Option<f64>) -> Result<Filter, punctual_core::Error> {
    let builder = Filter::builder(Unicycle).barrier("strip", Fleeing, keeping());
    built(builder, &[1.0, 1.0]).with_plans(Plans::every(PERIOD).horizon(horizon))
}

#[test]
fn what_cannot_be_followed_for_ever_is_promised_until_a_time() {
    let mut filter = fleeing(Some(3.0)).expect("a filter that can be assured");
    let mut other = fleeing(Some(3.0)).expect("a filter that can be assured");
    let (mut x, mut u, mut until, mut ended) = (vec![0.0; 4], [0.0; 2], 0.0, None);
    for k in 0..300 {
        let t = f64::from(k) * PERIOD;
        let assurance =
            filter.step(t, &x, &[0.0; 2], &mut u).expect("right dimensions").assurance.expect("plans");
        assert_eq!(filter.report().barriers[0].guaranteed, assurance.is_assured(), "{t}");
        assert_eq!(filter.plan().map(|plan| plan.until), assurance.until, "{t}");
        // It goes on after a restored state as it would have.
        if k % 50 == 20 {
            let text = serde_json::to_string(filter.state()).expect("JSON");
            let state: FilterState = serde_json::from_str(&text).expect("as written");
            other.restore(&state).expect("a state of its own");
            assert_eq!(other.assurance().expect("plans").until, assurance.until);
        } else if k > 20 {
            let mut again = [0.0; 2];
            other.step(t, &x, &[0.0; 2], &mut again).expect("right dimensions");
            assert_eq!((again, other.assurance().expect("plans")), (u, &assurance), "{t}");
        }
        match (assurance.status, ended) {
            (AssuranceStatus::Assured, None) => until = assurance.until.expect("a time"),
            (AssuranceStatus::Expired, _) => {
                assert!(assurance.failure.is_some() && t >= until - 1e-9);
                ended = Some(t);
            }
            _ => panic!("{t}: {assurance:?}"),
        }
        for instant in 0..INSTANTS {
            let (sin, cos) = x[2].sin_cos();
            let dt = PERIOD / f64::from(INSTANTS);
            let (at, speed) = (t + dt * f64::from(instant), x[3]);
            let off = x[0] - 0.02 * at * at * at;
            assert!(at > until - 1e-9 || off.abs() <= 2.0 + 1e-9, "{at}: {off}");
            let along = speed * dt + u[0] * dt * dt / 2.0;
            (x[0], x[1]) = (x[0] + along * cos, x[1] + along * sin);
            (x[2], x[3]) = (x[2] + u[1] * dt, speed + u[0] * dt);
        }
    }
    // By the bounds alone 1 m/s2 falls behind after 1 / 0.12 s = 8.3 s, and leaves the strip some seconds later.
    println!("promised until {until}");
    assert!(ended.is_some() && (8.0..14.0).contains(&until), "{until}");
}

#[test]
fn sets_that_move_for_ever_need_a_horizon() {
    let refused = |horizon| fleeing(horizon).err().map(|e| e.to_string()).unwrap_or_default();
    assert_eq!(
        refused(None),
        "strip.source: moves with time, so that no plan ends; with a horizon one may end earlier"
    );
    assert_eq!(refused(Some(0.0)), "horizon: is 0, must be finite and > 0");
    assert_eq!(refused(Some(f64::NAN)), "horizon: is NaN, must be finite and > 0");
    assert_eq!(refused(Some(3.0)), "");
}

/// A disc around the origin that shrinks for a moment, and at last moves as little as nothing.
#[derive(Clone, Copy, Debug)]
struct Pulse {
    at: f64,
    width: f64,
    depth: f64,
}

impl<const NX: usize> Barrier<NX> for Pulse {
    fn value<S: Scalar>(&self, t: S, x: &[S; NX]) -> S {
        let off = (t - self.at) / self.width;
        -(x[0] * x[0] + x[1] * x[1]) / 9.0 + 5.0 - (-(off * off)).exp() * self.depth
    }
}

/// At whatever time a set moves, and for however short a while, no plan is said to keep it for ever. Nor is one that ends after
/// that, where it ends. One of depth 0 does not move.
#[test]
fn a_set_that_moves_once_is_not_promised_for_ever() {
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let assured = |pulse: Pulse, end: End| {
        let builder = Filter::builder(PointMass)
            .barrier("goal", DistanceDisc::new([3.0, 0.0], 1.0, 1.0).expect("a disc"), keeping())
            .and_then(|b| b.barrier("gate", pulse, keeping().deadline(None)))
            .and_then(|b| b.window(Begin::AtOnce, end));
        built(builder, &[2.0, 2.0]).with_plans(PERIOD)
    };
    for draw in 0..40 {
        let (at, width) = (10.0_f64.powf(random.between(0.5, 5.0)), 10.0_f64.powf(random.between(-3.0, 1.0)));
        let pulse = Pulse { at, width, depth: 10.0 };
        let refused = assured(pulse, End::Never).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(
            refused.starts_with("gate.source: moves with time, so that no plan ends"),
            "{pulse:?}: {refused}"
        );
        if draw % 8 == 0 {
            let mut u = [0.0; 2];
            let mut ends = assured(pulse, End::At(at + 10.0 * width)).expect("one that ends");
            let assurance = ends
                .step(0.0, &[0.0; 4], &[0.0; 2], &mut u)
                .expect("right dimensions")
                .assurance
                .expect("plans");
            assert!(!assurance.is_assured(), "{pulse:?}: {assurance:?}");
        }
    }
    let mut still =
        assured(Pulse { at: 40.0, width: 0.5, depth: 0.0 }, End::Never).expect("a set that is still");
    let mut u = [0.0; 2];
    let assurance =
        still.step(0.0, &[0.0; 4], &[0.0; 2], &mut u).expect("right dimensions").assurance.expect("plans");
    assert!(assurance.is_assured(), "{assurance:?}");
}
