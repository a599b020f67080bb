//! Attacks on plans beside measured points: clocks, restarts, missing measurements and windows, against points that do their
//! worst. What a flag covers is judged in closed form for every course of the points, and so is the time until which it holds.
//!
//! More cases: `PUNCTUAL_MOVING=100 cargo test --release -p punctual-core --test all -- --nocapture moving_attack::`.

#![allow(clippy::print_stdout, reason = "the figures are wanted")]

use punctual_core::barriers::{DistanceDisc, Outside};
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::*;
use punctual_core::lie;
use punctual_core::plants::{PointMass, Unicycle};

/// Parts of a period at which a run is judged.
const PARTS: u32 = 5;
const BOUNDS: [f64; 2] = [4.0, 1.5];
const SMOOTHING: f64 = 1.0;

struct Draws(u64);

impl Draws {
    fn part(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.part()
    }

    fn is(&mut self, probability: f64) -> bool {
        self.part() < probability
    }

    fn one_of<T: Copy>(&mut self, of: &[T]) -> T {
        of[(self.part() * of.len() as f64) as usize]
    }

    fn direction(&mut self, size: f64) -> [f64; 2] {
        let angle = self.within(0.0, core::f64::consts::TAU);
        [size * angle.cos(), size * angle.sin()]
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Moves {
    Chase,
    Intercept,
    Flee,
    Bang,
    Switch,
    Swerve,
}

const MOVES: [Moves; 6] =
    [Moves::Chase, Moves::Intercept, Moves::Flee, Moves::Bang, Moves::Switch, Moves::Swerve];

#[derive(Clone, Copy, Debug, PartialEq)]
enum Clock {
    Exact,
    /// Measured, with a few percent of jitter.
    Jitter,
    /// Samples now and then before they are due.
    Early,
    /// Other holds, which are announced.
    Announced,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Goal,
    Passed,
    Join,
    Clear,
}

#[derive(Clone, Copy, Debug)]
struct Set {
    kind: Kind,
    /// Of its own, or the point that it follows.
    place: [f64; 2],
    point: usize,
    radius: f64,
    deadline: Option<f64>,
    begin: f64,
    end: Option<f64>,
    soft: bool,
    later: bool,
    motion: Motion,
}

#[derive(Clone, Debug)]
struct Case {
    point_mass: bool,
    t0: f64,
    period: f64,
    x: [f64; 4],
    points: Vec<[f64; 4]>,
    sets: Vec<Set>,
    clock: Clock,
    moves: Moves,
    delay: f64,
    arm_after: f64,
    horizon: Option<f64>,
    uncertain: f64,
    jitter: f64,
    gaps: f64,
    repeats: f64,
    restores: f64,
    rearms: f64,
    asks: u32,
    time: f64,
}

impl Case {
    fn rates(&self) -> [f64; 4] {
        let size = self.uncertain;
        if self.point_mass { [0.0, 0.0, 0.1 * size, 0.1 * size] } else { [0.0, 0.0, 0.02 * size, 0.1 * size] }
    }

    fn errors(&self) -> [f64; 4] {
        [0.02, 0.02, 0.01, 0.02].map(|error| error * self.uncertain)
    }

    fn filter<P: ControlAffine<4, 2> + Send + Sync + 'static>(&self, plant: P) -> Filter {
        let mut builder = Filter::builder(plant).measured(4 * self.points.len());
        let mut plans = Plans::every(self.period).horizon(self.horizon);
        for (i, set) in self.sets.iter().enumerate() {
            let settings = set.deadline.map_or(BarrierSettings::keeping(), BarrierSettings::within);
            let settings = if set.later { settings.infeasible(Infeasible::Earliest) } else { settings };
            let disc = DistanceDisc::new(set.place, set.radius, SMOOTHING).unwrap();
            let (name, first) = (format!("set{i}"), 4 + 4 * set.point);
            let follow = disc.following(4);
            builder = match set.kind {
                Kind::Goal | Kind::Passed => builder.barrier(&name, disc, settings).unwrap(),
                Kind::Join => {
                    let source = lie::following::<_, _, 4, 8, 2>(builder.plant(), follow, 2, first);
                    builder.source(&name, source.unwrap(), settings).unwrap()
                }
                Kind::Clear => {
                    let source = lie::following::<_, _, 4, 8, 2>(builder.plant(), Outside(follow), 2, first);
                    builder.source(&name, source.unwrap(), settings).unwrap()
                }
            };
            if matches!(set.kind, Kind::Join | Kind::Clear) {
                plans = plans.motion(i, set.motion);
            }
            let begin = if set.begin > 0.0 { Begin::At(set.begin) } else { Begin::AtOnce };
            let end = match set.end {
                _ if set.kind == Kind::Passed => End::OnArrival,
                Some(end) => End::At(end),
                None => End::Never,
            };
            builder = builder.window(begin, end).unwrap();
            if set.soft {
                builder = builder.strictness(Strictness::Soft(2.0)).unwrap();
            }
        }
        builder = builder.bounds(&BOUNDS.map(|b| -b), &BOUNDS).unwrap();
        builder = builder.actuation_delay(self.delay).unwrap().arm_after(self.arm_after).unwrap();
        if self.clock == Clock::Exact {
            builder = builder.sampling(Sampling::Period(self.period)).unwrap();
        }
        if self.uncertain > 0.0 {
            plans = plans.uncertain_rates(&self.rates()).jitter(self.jitter);
            if !self.sets.iter().any(|set| set.kind == Kind::Passed) {
                plans = plans.measurement_errors(&self.errors());
            }
        }
        builder.build().unwrap().with_plans(plans).unwrap()
    }

    /// The least h of set `j` in m, `after` s later than the points are at `points`, whatever they do until then.
    fn least(&self, j: usize, x: &[f64; 4], points: &[[f64; 4]], after: f64) -> f64 {
        let set = self.sets[j];
        let apart = |c: [f64; 2]| (x[0] - c[0]).hypot(x[1] - c[1]);
        let level = |d: f64| set.radius.hypot(SMOOTHING) - d.hypot(SMOOTHING);
        if matches!(set.kind, Kind::Goal | Kind::Passed) {
            return level(apart(set.place));
        }
        let [p_x, p_y, v_x, v_y] = points[set.point];
        let away = apart([p_x + v_x * after, p_y + v_y * after]);
        let reach = 0.5 * self.acceleration(set.point) * after * after;
        match set.kind {
            Kind::Join => level(away + reach),
            _ => -level((away - reach).max(0.0)),
        }
    }

    /// Of a point: the least that is declared.
    fn acceleration(&self, point: usize) -> f64 {
        self.declared(point, |motion| motion.acceleration)
    }

    fn declared(&self, point: usize, of: fn(Motion) -> f64) -> f64 {
        let follows = |set: &&Set| set.point == point && matches!(set.kind, Kind::Join | Kind::Clear);
        self.sets.iter().filter(follows).map(|set| of(set.motion)).fold(f64::INFINITY, f64::min)
    }
}

#[derive(Debug)]
struct Outcome {
    accepted: bool,
    /// Least h while guaranteed, and where.
    least: (f64, f64, usize),
    /// The same until the time said, if nothing else was followed.
    later: (f64, f64, usize),
    /// By how much in s a promise ended before the next sample.
    short: f64,
    withdrawn: usize,
    expired: usize,
    samples: usize,
    assured: usize,
    failure: String,
}

fn run<P: ControlAffine<4, 2> + Clone + Send + Sync + 'static>(plant: &P, case: &Case, seed: u64) -> Outcome {
    let (mut draws, mut filter) = (Draws(seed), case.filter(plant.clone()));
    let (mut x, mut points, mut acting) = (case.x, case.points.clone(), [0.0; 2]);
    let mut outcome = Outcome {
        accepted: false,
        least: (f64::INFINITY, 0.0, 0),
        later: (f64::INFINITY, 0.0, 0),
        short: 0.0,
        withdrawn: 0,
        expired: 0,
        samples: 0,
        assured: 0,
        failure: String::new(),
    };
    let velocity = |x: &[f64; 4]| {
        if case.point_mass { [x[2], x[3]] } else { [x[3] * x[2].cos(), x[3] * x[2].sin()] }
    };
    let flow = |x: &mut [f64; 4], u: &[f64; 2], more: &[f64; 4], h: f64| {
        let rate = |x: &[f64; 4]| {
            let rate = plant.derivative(x, u);
            core::array::from_fn::<f64, 4, _>(|i| rate[i] + more[i])
        };
        let moved =
            |x: &[f64; 4], k: &[f64; 4], h: f64| core::array::from_fn::<f64, 4, _>(|i| x[i] + h * k[i]);
        let k1 = rate(x);
        let k2 = rate(&moved(x, &k1, 0.5 * h));
        let k3 = rate(&moved(x, &k2, 0.5 * h));
        let k4 = rate(&moved(x, &k3, h));
        *x = core::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
    };
    let (mut t, mut gap, mut sign, mut last) = (case.t0, 0, 1.0, (0.0, None));
    // When the deadlines count from.
    let mut anchor = None;
    let mut is_fresh = true;
    let mut times = vec![f64::INFINITY; case.sets.len()];
    while t < case.t0 + case.time {
        let announced = case.period * if draws.is(0.3) { draws.within(0.3, 1.6) } else { 1.0 };
        let hold = match case.clock {
            Clock::Exact => case.period,
            Clock::Jitter => case.period * draws.within(0.96, 1.04),
            Clock::Early if draws.is(0.15) => case.period * draws.within(0.05, 0.95),
            Clock::Early => case.period,
            Clock::Announced => announced.max(case.delay),
        };
        let hold = if case.uncertain > 0.0 && case.jitter > 0.0 {
            case.period * draws.within(1.0, 1.0 + case.jitter)
        } else {
            hold
        };
        if case.clock == Clock::Announced {
            filter.expect_hold(Some(hold)).unwrap();
        }
        if outcome.accepted && draws.is(case.restores) {
            let text = serde_json::to_string(filter.state()).unwrap();
            let state: FilterState = serde_json::from_str(&text).unwrap();
            assert_eq!(&state, filter.state());
            let mut other = case.filter(plant.clone());
            other.restore(&state).unwrap();
            if case.clock == Clock::Announced {
                other.expect_hold(Some(hold)).unwrap();
            }
            filter = other;
        }
        if outcome.accepted && draws.is(case.rearms) {
            filter.rearm();
            (anchor, is_fresh) = (None, true);
        }
        if gap == 0 && draws.is(case.gaps) {
            gap = 1 + (draws.part() * 12.0) as u32;
        }
        let (mut u, repeats) = ([0.0; 2], 1 + u32::from(case.delay == 0.0 && draws.is(case.repeats)));
        let (mut guaranteed, mut until) = (Vec::new(), None);
        for _ in 0..repeats {
            let errors =
                if case.sets.iter().any(|set| set.kind == Kind::Passed) { [0.0; 4] } else { case.errors() };
            let mut measured: Vec<f64> = (0..4).map(|i| x[i] + errors[i] * draws.within(-1.0, 1.0)).collect();
            for (p, point) in points.iter().enumerate() {
                let (dx, dy) = (point[0] - x[0], point[1] - x[1]);
                let far = dx.hypot(dy).max(1e-12);
                // It seems farther, or nearer, than it is.
                let (off, faster) = match draws.one_of(&[0, 0, 0, 1, 2]) {
                    0 => ([dx / far, dy / far], [dx / far, dy / far]),
                    1 => ([-dx / far, -dy / far], [-dx / far, -dy / far]),
                    _ => (draws.direction(1.0), draws.direction(1.0)),
                };
                let size = case.declared(p, |motion| motion.position_error) * 0.999_999;
                let speed = case.declared(p, |motion| motion.velocity_error) * 0.999_999;
                let seen = [
                    point[0] + size * off[0],
                    point[1] + size * off[1],
                    point[2] + speed * faster[0],
                    point[3] + speed * faster[1],
                ];
                measured.extend(if gap > 0 { [f64::NAN; 4] } else { seen });
            }
            let u_ref = match case.asks {
                0 => [0.0; 2],
                1 if case.point_mass => [-x[2], -x[3]],
                1 => [-x[3], 0.0],
                2 => [
                    BOUNDS[0] * if draws.is(0.5) { 1.0 } else { -1.0 },
                    BOUNDS[1] * if draws.is(0.9) { 1.0 } else { -1.0 },
                ],
                // At the first point.
                _ => {
                    let to = points.first().map_or([0.0; 2], |p| [p[0] - x[0], p[1] - x[1]]);
                    if case.point_mass {
                        [4.0 * to[0].signum(), 1.5 * to[1].signum()]
                    } else {
                        let turn = (to[1].atan2(to[0]) - x[2]).sin();
                        [4.0, 1.5 * turn.signum()]
                    }
                }
            };
            if draws.is(0.05) {
                let mut other = u;
                filter.peek(t, &measured, &u_ref, &mut other).unwrap();
            }
            let report = filter.step(t, &measured, &u_ref, &mut u).unwrap();
            let assurance = report.assurance.unwrap();
            outcome.samples += 1;
            if report.status != Status::NotArmed && gap == 0 && anchor.is_none() {
                anchor = Some(t);
            }
            if is_fresh && anchor.is_some() {
                is_fresh = false;
                outcome.accepted |= assurance.is_assured();
            }
            guaranteed = report.barriers.iter().map(|b| b.guaranteed).collect();
            // Without a measurement the report has no time.
            if gap == 0 {
                times = report.barriers.iter().map(|b| t + b.time_left).collect();
            }
            until = assurance.until;
            outcome.assured += usize::from(assurance.is_assured());
            if !assurance.is_assured() && anchor.is_some() {
                let why = assurance.failure.map(|failure| failure.to_string()).unwrap_or_default();
                if !outcome.accepted {
                    outcome.failure = why;
                    return outcome;
                }
                match assurance.status {
                    AssuranceStatus::Expired | AssuranceStatus::Refused => outcome.expired += 1,
                    _ => {
                        outcome.withdrawn += 1;
                        if outcome.failure.is_empty() {
                            outcome.failure =
                                format!("at {:.3} s {:?}: {why}", t - case.t0, assurance.status);
                        }
                    }
                }
            }
            let drives = (until.unwrap_or(0.0), Some(assurance.driver));
            if (drives.0 - last.0).abs() > case.period * 1.5 || drives.1 != last.1 {
                sign = -sign;
            }
            last = drives;
        }
        gap = u32::saturating_sub(gap, 1);
        let anchored = anchor.unwrap_or(t);
        let judged = |j: usize, now: f64, is_guaranteed: bool| {
            let set = case.sets[j];
            let begins = anchored + set.begin + if set.begin > 0.0 { case.arm_after } else { 0.0 };
            is_guaranteed
                && set.kind != Kind::Passed
                && now >= begins + 1e-9
                && set.end.is_none_or(|end| now < anchored + end - 1e-6)
                && (set.deadline.is_none() || now >= times[j] + case.delay)
        };
        // What the plan alone keeps, until it says.
        if let (Some(until), Some(plan)) = (until, filter.plan())
            && case.uncertain == 0.0
        {
            let mut z = x;
            let mut at = t;
            let step = case.period / 2.0;
            let begins = t + case.delay;
            let end = until.min(t + 9.0);
            while at < end {
                // An input changes at the end of a step.
                let ends = plan.inputs.iter().map(|(end, _)| *end).chain([begins]);
                let to = ends.filter(|end| *end > at + 1e-9).fold((at + step).min(end), f64::min);
                let u = if 0.5 * (at + to) < begins {
                    acting
                } else {
                    let middle = 0.5 * (at + to);
                    let input = plan.inputs.iter().find(|(end, _)| *end > middle).or(plan.inputs.last());
                    input.map_or([0.0; 2], |(_, u)| [u[0], u[1]])
                };
                flow(&mut z, &u, &[0.0; 4], to - at);
                at = to;
                for (j, is_guaranteed) in guaranteed.iter().enumerate() {
                    if judged(j, at, *is_guaranteed) {
                        let h = case.least(j, &z, &points, at - t);
                        if h < outcome.later.0 {
                            outcome.later = (h, t - case.t0, j);
                        }
                    }
                }
            }
        }
        // A promise that stands reaches the next sample.
        let next = t + filter.last_hold().unwrap_or(0.0) - 1e-9 - 1e-15 * t.abs();
        let is_asked = guaranteed.contains(&true);
        if let Some(until) = until.filter(|until| *until < next && is_asked) {
            outcome.short = outcome.short.max(next - until);
        }
        // The points' next moves, with the report known.
        let v = velocity(&x);
        let pushes: Vec<[f64; 2]> = points
            .iter()
            .enumerate()
            .map(|(p, point)| {
                let a = case.acceleration(p);
                let joins = case.sets.iter().any(|set| set.kind == Kind::Join && set.point == p);
                let to = [x[0] - point[0], x[1] - point[1]];
                let ahead = [to[0] + v[0] - point[2], to[1] + v[1] - point[3]];
                let scaled = |d: [f64; 2], by: f64| {
                    let far = d[0].hypot(d[1]).max(1e-9);
                    [by * d[0] / far, by * d[1] / far]
                };
                let worse = if joins { -a } else { a };
                match case.moves {
                    Moves::Chase => scaled(to, worse),
                    Moves::Intercept => scaled(ahead, worse),
                    Moves::Flee => scaled(to, -worse),
                    Moves::Bang => scaled(to, if draws.is(0.5) { a } else { -a }),
                    Moves::Switch => scaled(ahead, sign * worse),
                    Moves::Swerve => scaled([-to[1], to[0]], if (t * 0.7).sin() > 0.0 { a } else { -a }),
                }
            })
            .collect();
        let before = core::mem::replace(&mut acting, u);
        let covered = t + filter.last_hold().unwrap_or(hold) * (1.0 + case.jitter) + 1e-9;
        let side: [f64; 4] = core::array::from_fn(|_| draws.within(-1.0, 1.0).signum());
        let more: [f64; 4] = core::array::from_fn(|i| case.rates()[i] * side[i]);
        let start = points.clone();
        let mut at = 0.0;
        let mut ends: Vec<f64> = (1..=PARTS).map(|part| hold * f64::from(part) / f64::from(PARTS)).collect();
        if case.delay > 0.0 && case.delay < hold {
            ends.push(case.delay);
            ends.sort_by(f64::total_cmp);
        }
        for to in ends {
            let u = if 0.5 * (at + to) < case.delay { &before } else { &u };
            flow(&mut x, u, &more, to - at);
            at = to;
            for (point, (start, push)) in points.iter_mut().zip(start.iter().zip(&pushes)) {
                for i in 0..2 {
                    point[i] = start[i] + at * start[2 + i] + 0.5 * at * at * push[i];
                    point[2 + i] = start[2 + i] + at * push[i];
                }
            }
            for (j, is_guaranteed) in guaranteed.iter().enumerate() {
                if judged(j, t + at, *is_guaranteed) && t + at <= covered {
                    let h = case.least(j, &x, &points, 0.0).min(case.least(j, &x, &start, at));
                    if h < outcome.least.0 {
                        outcome.least = (h, t - case.t0, j);
                    }
                }
            }
        }
        t += hold;
    }
    outcome
}

fn draw(draws: &mut Draws, aimed: bool) -> Case {
    let point_mass = draws.is(0.5);
    let period = draws.one_of(&[0.02, 0.05, 0.1, 0.1, 0.2, 0.3]);
    let uncertain = if draws.is(if aimed { 0.8 } else { 0.35 }) { draws.one_of(&[0.3, 1.0]) } else { 0.0 };
    let jitter = if uncertain > 0.0 && draws.is(0.3) { 0.5 } else { 0.0 };
    let clock = draws.one_of(&[Clock::Exact, Clock::Exact, Clock::Jitter, Clock::Early, Clock::Announced]);
    let clock = if jitter > 0.0 { Clock::Early } else { clock };
    let count = draws.one_of(&[1, 1, 2, 2, 3]);
    let points: Vec<[f64; 4]> = (0..count)
        .map(|_| {
            let far = if aimed { draws.within(2.5, 5.0) } else { draws.within(2.5, 9.0) };
            let (at, off) = (draws.direction(far), draws.direction(0.4));
            let speed = draws.within(0.0, 1.6) / far;
            [at[0], at[1], -speed * at[0] + off[0], -speed * at[1] + off[1]]
        })
        .collect();
    let exact = draws.is(0.4);
    let motion = |draws: &mut Draws, accelerations: &[f64]| Motion {
        acceleration: draws.one_of(accelerations),
        position_error: if exact { 0.0 } else { draws.one_of(&[0.0, 0.05, 0.15]) },
        velocity_error: if exact { 0.0 } else { draws.one_of(&[0.0, 0.03, 0.1]) },
    };
    let set = Set {
        kind: Kind::Clear,
        place: [0.0; 2],
        point: 0,
        radius: 1.2,
        deadline: None,
        begin: 0.0,
        end: None,
        soft: false,
        later: false,
        motion: Motion::default(),
    };
    let mut sets = Vec::new();
    let goal = draws.within(5.0, 9.0);
    match draws.one_of(&[0, 1, 2, 3, 4]) {
        0 => sets.push(Set {
            kind: Kind::Goal,
            place: draws.direction(goal),
            radius: 2.0,
            deadline: Some(draws.within(2.5, 6.0)),
            later: draws.is(0.3),
            ..set
        }),
        1 => sets.push(Set {
            kind: Kind::Passed,
            place: draws.direction(goal),
            radius: 2.0,
            deadline: Some(draws.within(5.0, 9.0)),
            ..set
        }),
        2 => {
            let motion = Motion { velocity_error: 0.0, ..motion(draws, &[0.0, 0.02, 0.05]) };
            sets.push(Set {
                kind: Kind::Join,
                radius: 3.0,
                deadline: Some(draws.within(2.0, 4.0)),
                later: draws.is(0.3),
                motion,
                ..set
            });
        }
        _ => {}
    }
    for point in 0..count {
        let motion = motion(draws, if aimed { &[0.3, 0.6] } else { &[0.0, 0.1, 0.3, 0.6] });
        let begin = if draws.is(0.1) { draws.within(0.5, 2.0) } else { 0.0 };
        let end = if draws.is(0.15) { Some(draws.within(2.5, 5.0)) } else { None };
        let later = draws.is(0.1);
        sets.push(Set { point, motion, begin, end, soft: later, ..set });
    }
    if draws.is(0.1) {
        let motion = motion(draws, &[0.1, 0.3]);
        sets.push(Set { radius: 0.8, motion, ..set });
    }
    let delay = if draws.is(0.25) && clock != Clock::Early && clock != Clock::Jitter { period } else { 0.0 };
    let (asks, moves) = (draws.one_of(&[0, 1, 2, 3, 3]), draws.one_of(&MOVES));
    let (heading, speed) = (draws.within(-3.0, 3.0), draws.within(0.0, 2.0));
    let x = match point_mass {
        true => [0.0, 0.0, speed * heading.cos(), speed * heading.sin()],
        false => [0.0, 0.0, heading, speed],
    };
    Case {
        point_mass,
        t0: draws.one_of(&[0.0, 0.0, -7.3, 1e6]),
        period,
        x,
        points,
        sets,
        clock,
        moves,
        delay,
        arm_after: if draws.is(0.1) { 0.4 } else { 0.0 },
        horizon: if draws.is(if aimed { 0.6 } else { 0.2 }) { Some(draws.within(0.8, 2.0)) } else { None },
        uncertain,
        jitter,
        gaps: if draws.is(0.3) { 0.04 } else { 0.0 },
        repeats: if draws.is(0.2) { 0.1 } else { 0.0 },
        restores: if draws.is(0.2) { 0.05 } else { 0.0 },
        rearms: if draws.is(0.1) { 0.03 } else { 0.0 },
        asks,
        time: 6.0,
    }
}

/// Below this a run is broken: more than the integrators differ.
const ROUND_OFF: f64 = -1e-7;

#[test]
fn what_is_guaranteed_is_kept_whatever_points_and_clocks_do() {
    let number = |name: &str, default: u64| std::env::var(name).map_or(default, |text| text.parse().unwrap());
    let (cases, first) = (number("PUNCTUAL_MOVING", 4), number("PUNCTUAL_FIRST", 0));
    let (mut broken, mut accepted, mut samples, mut assured) = (Vec::new(), 0, 0, 0);
    let (mut withdrawn, mut expired) = (0, 0);
    for k in first..first + cases {
        let mut draws = Draws(k.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0xabcdef);
        let _ = (draws.part(), draws.part());
        // Every third with points that crowd in until no plan reaches farther.
        let case = draw(&mut draws, k % 3 == 2);
        let begun = std::time::Instant::now();
        let outcome = match case.point_mass {
            true => run(&PointMass, &case, k),
            false => run(&Unicycle, &case, k),
        };
        let took = begun.elapsed().as_secs_f64();
        accepted += usize::from(outcome.accepted);
        withdrawn += usize::from(outcome.withdrawn > 0);
        expired += usize::from(outcome.expired > 0);
        (samples, assured) = (samples + outcome.samples, assured + outcome.assured);
        let is_plain = case.clock == Clock::Exact && case.gaps == 0.0 && case.rearms == 0.0;
        if outcome.least.0 < ROUND_OFF || outcome.later.0 < ROUND_OFF || outcome.short > 0.0 {
            println!("BROKEN {k}: {outcome:?} {case:?}");
            broken.push(k);
        } else if is_plain && outcome.withdrawn > 0 {
            println!("WITHDRAWN {k}: {outcome:?} {case:?}");
        }
        if took > 20.0 {
            println!("SLOW {k}: {took:.1} s for {} samples, {case:?}", outcome.samples);
        }
    }
    println!(
        "{cases} cases, {accepted} accepted, {samples} samples, {assured} assured, {withdrawn} withdrawn, {expired} expired"
    );
    assert!(broken.is_empty(), "{broken:?}");
}

/// A point mass that has to be 10 m ahead in time, and a point that stands in the way.
fn blocked() -> Filter {
    let clear = Outside(DistanceDisc::new([0.0; 2], 1.2, SMOOTHING).unwrap().following(4));
    let goal = DistanceDisc::new([10.0, 0.0], 1.0, SMOOTHING).unwrap();
    let builder = Filter::builder(PointMass).barrier("goal", goal, BarrierSettings::within(5.0)).unwrap();
    let builder = builder.following::<_, 8>("clear", clear, BarrierSettings::keeping()).unwrap();
    let builder = builder.bounds(&BOUNDS.map(|b| -b), &BOUNDS).unwrap();
    let builder = builder.sampling(Sampling::Period(0.1)).unwrap();
    builder.build().unwrap().with_plans(Plans::every(0.1).motion(1, Motion::default())).unwrap()
}

#[test]
fn the_earliest_deadline_accounts_for_points() {
    let filter = blocked();
    let (planning, x) = (filter.planning().unwrap(), [0.0, 0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 0.0]);
    let (factor, plan) = planning.earliest_deadline(0.0, &x, 10.0).unwrap();
    let apart = |x: &[f64]| (x[0] - 5.0).hypot(x[1]);
    let nearest =
        planning.trajectory(&plan, 0.0, &x, 0.01).iter().map(|(_, x, _)| apart(x)).fold(9.0, f64::min);
    assert!(nearest >= 1.2, "{nearest}");
    let (appraised, _) = planning.appraise(0.0, &x, 10.0).earliest.unwrap();
    assert_eq!(factor, appraised);
}

#[test]
fn a_memory_without_its_measurements_is_refused() {
    let mut filter = blocked();
    let mut u = [0.0; 2];
    let x = [0.0, 0.0, 0.0, 0.0, 5.0, 3.0, 0.0, 0.0];
    assert!(filter.step(0.0, &x, &[0.0; 2], &mut u).unwrap().is_assured());
    let state = serde_json::to_value(filter.state()).unwrap();
    let restored = |state: &serde_json::Value| {
        blocked().restore(&serde_json::from_value(state.clone()).unwrap()).map_err(|error| error.to_string())
    };
    assert_eq!(restored(&state), Ok(()));
    let message = "courses: are not those of the barriers, or not finite";
    let whole = &state["plan"]["courses"];
    let one = whole[1].clone();
    for courses in [serde_json::json!([]), serde_json::json!([null, null]), serde_json::json!([one, one])] {
        let mut state = state.clone();
        state["plan"]["courses"] = courses;
        assert_eq!(restored(&state), Err(message.into()));
    }
}

#[test]
fn a_memory_whose_law_was_forgotten_is_restored() {
    let filter = || {
        let goal = DistanceDisc::new([8.0, 0.0], 2.0, SMOOTHING).unwrap();
        let builder = Filter::builder(PointMass).barrier("goal", goal, BarrierSettings::within(6.0)).unwrap();
        let builder = builder.bounds(&BOUNDS.map(|b| -b), &BOUNDS).unwrap();
        let plans = Plans::every(0.1).uncertain_rates(&[0.0, 0.0, 0.05, 0.05]);
        builder.build().unwrap().with_plans(plans).unwrap()
    };
    let (mut lost, mut u, x) = (filter(), [0.0; 2], [0.0; 4]);
    assert!(lost.step(0.0, &x, &[0.0; 2], &mut u).unwrap().is_assured());
    // Too late, and elsewhere.
    assert!(!lost.step(0.25, &[0.0, 0.5, 0.0, 0.0], &[0.0; 2], &mut u).unwrap().is_assured());
    let state: FilterState = serde_json::from_str(&serde_json::to_string(lost.state()).unwrap()).unwrap();
    assert_eq!(filter().restore(&state).map_err(|error| error.to_string()), Ok(()));
}
