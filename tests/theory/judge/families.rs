//! Random closed loops, each from its own seed.

use std::f64::consts::PI;

use super::case::{Case, Numbers, Reference, Set, Steps};
use super::model::{Plant, Shape};

/// The kinds of cases drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Family {
    /// This many integrators and a line.
    Chain(usize),
    /// A goal in the plane, at rest or moving, and up to this many obstacles.
    PointMass(usize),
    Unicycle(usize),
    Bicycle(usize),
    Cart,
    Pendulum,
    Cruise,
    /// A wall that moves as a sine of time.
    Wave,
    /// A disc to avoid, without a goal; for a point mass, a unicycle or a bicycle.
    KeepOut,
    /// The unicycle of the hundred starts at 50 ms.
    Fifty,
}

impl Family {
    pub(crate) const ALL: [Self; 20] = [
        Self::Chain(1),
        Self::Chain(2),
        Self::Chain(3),
        Self::Chain(4),
        Self::Chain(5),
        Self::Chain(6),
        Self::Chain(7),
        Self::Chain(8),
        Self::PointMass(0),
        Self::Unicycle(0),
        Self::Bicycle(0),
        Self::PointMass(5),
        Self::Unicycle(5),
        Self::Bicycle(5),
        Self::Cart,
        Self::Pendulum,
        Self::Cruise,
        Self::Wave,
        Self::KeepOut,
        Self::Fifty,
    ];

    /// The case for a seed.
    pub(crate) fn draw(self, seed: u64) -> Case {
        let mut numbers = Numbers::new(seed);
        let numbers = &mut numbers;
        let case = match self {
            Self::Chain(n) => chain(n, numbers),
            Self::PointMass(most) => vehicle(Plant::PointMass, most, numbers),
            Self::Unicycle(most) => vehicle(Plant::Unicycle, most, numbers),
            Self::Bicycle(most) => {
                let l_r = numbers.scale(0.5, 20.0);
                vehicle(Plant::Bicycle { l_r }, most, numbers)
            }
            Self::Cart => cart(numbers),
            Self::Pendulum => pendulum(numbers),
            Self::Cruise => cruise(numbers),
            Self::Wave => wave(numbers),
            Self::KeepOut => keep_out(numbers),
            Self::Fifty => return fifty(seed, numbers),
        };
        Case { seed: seed ^ 0x5eed, ..case }
    }
}

/// The most samples until a deadline of [`assured`], since a step with a backup plan takes a thousand times
/// as long.
const MOST_SAMPLES: f64 = 200.0;

/// The case for a seed and a filter with a backup plan: a plant with a goal and obstacles, bounded inputs,
/// nothing moving, and any of five ways to choose u_ref.
pub(crate) fn assured(seed: u64) -> Case {
    let mut numbers = Numbers::new(seed);
    let numbers = &mut numbers;
    let mut case = loop {
        let case = match numbers.below(10) {
            0..3 => vehicle(Plant::PointMass, numbers.below(5), numbers),
            3..6 => vehicle(Plant::Unicycle, numbers.below(5), numbers),
            6..9 => {
                let l_r = numbers.scale(0.5, 20.0);
                vehicle(Plant::Bicycle { l_r }, numbers.below(5), numbers)
            }
            _ => match numbers.below(3) {
                0 => chain(1 + numbers.below(4), numbers),
                1 => cart(numbers),
                _ => pendulum(numbers),
            },
        };
        let moves = |set: &Set| matches!(set.shape, Shape::Disc { velocity, .. } if velocity != [0.0; 2]);
        let samples = case.sets[0].deadline / case.step;
        if case.bounds[0].is_finite() && samples <= MOST_SAMPLES && !case.sets.iter().any(moves) {
            break case;
        }
    };
    let deadline = case.sets[0].deadline;
    let size = case.bounds.map(|bound| bound * numbers.scale(0.1, 3.0));
    let held = deadline / numbers.scale(3.0, 100.0);
    case.reference = match numbers.below(5) {
        0 => Reference::Zero,
        1 => Reference::Damping(numbers.scale(0.1, 10.0) / deadline),
        2 => Reference::Hostile(size[0]),
        3 => Reference::Random { size, held },
        _ => Reference::BangBang { size, held },
    };
    Case { horizon: 1.5 * deadline, seed: seed ^ 0x5eed, ..case }
}

/// Completes a case with what all families share: rates, margin, sampling, bounds and reference. They match
/// the deadline, the size of h and the inputs of a run of that size.
fn common(plant: Plant, mut sets: Vec<Set>, start: &[f64], typical: [f64; 2], numbers: &mut Numbers) -> Case {
    let deadline = sets[0].deadline;
    let mut step = deadline / numbers.scale(10.0, 1000.0);
    // The deadline lies on the grid.
    if numbers.chance(0.5) {
        step = deadline / (deadline / step).round();
    }
    for set in &mut sets {
        let rate = |numbers: &mut Numbers| numbers.scale(2.0, 40.0) / deadline;
        set.rate = numbers.chance(0.5).then(|| rate(numbers));
        set.stay_rate = numbers.chance(0.5).then(|| rate(numbers));
    }
    let bounds = match numbers.below(4) {
        0 => [numbers.scale(0.3, 2.0); 2],
        1 => [numbers.scale(3.0, 20.0); 2],
        _ => [f64::INFINITY; 2],
    };
    let size = typical.map(|u| u * numbers.scale(0.1, 2.0));
    let reference = match numbers.below(4) {
        0 => Reference::Zero,
        1 => Reference::Damping(numbers.scale(0.1, 10.0) / deadline),
        2 => Reference::Outwards(size[0]),
        _ => Reference::Random { size, held: deadline / numbers.scale(3.0, 100.0) },
    };
    let steps = [Steps::Regular, Steps::Jittered, Steps::Scattered, Steps::Missed, Steps::Tiny];
    let start_time = if numbers.chance(0.5) { 0.0 } else { numbers.within(0.0, 100.0) };
    let steps = steps[numbers.below(5)];
    let case = Case::plain(plant, sets[0].clone(), start, step);
    let announced = numbers.chance(0.5);
    let bounds = [0, 1].map(|i| bounds[i] * typical[i]);
    Case { sets, bounds, reference, steps, start_time, announced, ..case }
}

/// A margin of 0 in half of the cases, else up to 5 % of `size`.
fn margin(size: f64, numbers: &mut Numbers) -> f64 {
    if numbers.chance(0.5) { 0.0 } else { numbers.within(0.0, 0.05) * size }
}

/// States of similar size in units of the deadline, outside in two of three cases.
fn along_line(n: usize, numbers: &mut Numbers) -> (f64, f64, f64, Vec<f64>) {
    let (size, deadline) = (numbers.scale(0.1, 100.0), numbers.scale(0.3, 30.0));
    let inside = numbers.chance(1.0 / 3.0);
    let mut unit = 1.0;
    let mut start = Vec::new();
    for j in 0..n {
        start.push(numbers.within(-1.0, 1.0) * size * unit);
        unit *= (j + 1) as f64 / deadline;
    }
    start[0] = if inside { start[0].abs() } else { -start[0].abs() };
    (size, deadline, unit * size * n as f64, start)
}

fn chain(n: usize, numbers: &mut Numbers) -> Case {
    let (size, deadline, unit, mut start) = along_line(n, numbers);
    let (sign, at) = (if numbers.chance(0.5) { 1.0 } else { -1.0 }, numbers.within(-2.0, 2.0) * size);
    start.iter_mut().for_each(|v| *v *= sign);
    start[0] += at;
    let set = Set { margin: margin(size, numbers), ..Set::within(Shape::Line { sign, at }, deadline) };
    common(Plant::Chain(n), vec![set], &start, [unit; 2], numbers)
}

fn disc(at: [f64; 2], radius: f64, outside: bool, numbers: &mut Numbers) -> Shape {
    let smoothing = numbers
        .chance(0.75)
        .then(|| radius * if numbers.chance(0.5) { 1.0 } else { numbers.scale(0.1, 2.0) });
    Shape::Disc { start: at, velocity: [0.0; 2], radius, smoothing, outside }
}

/// A goal up to 100 radii away, and obstacles in between and beside, none of which contains the start.
fn vehicle(plant: Plant, most: usize, numbers: &mut Numbers) -> Case {
    let (radius, deadline) = (numbers.scale(0.2, 5.0), numbers.scale(0.5, 30.0));
    let inside = numbers.chance(0.2);
    let far = radius * if inside { numbers.within(0.0, 0.9) } else { numbers.scale(1.2, 100.0) };
    let angle = numbers.within(-PI, PI);
    let corner = [numbers.within(-20.0, 20.0), numbers.within(-20.0, 20.0)];
    let goal = [corner[0] + far * angle.cos(), corner[1] + far * angle.sin()];
    let mut shape = disc(goal, radius, false, numbers);
    let velocity = [0, 1].map(|_| numbers.within(-1.0, 1.0) * far / deadline);
    if let (Shape::Disc { velocity: v, .. }, true) = (&mut shape, numbers.chance(0.3)) {
        *v = velocity;
    }
    let size = far.max(radius);
    let unit = size / deadline / deadline;
    let mut sets = vec![Set { margin: margin(radius, numbers), ..Set::within(shape, deadline) }];
    for _ in 0..if most > 0 { 1 + numbers.below(most) } else { 0 } {
        let (along, radius) = (numbers.within(-0.2, 1.2), size * numbers.scale(0.02, 0.2));
        let aside = numbers.within(-0.5, 0.5) * size;
        let at = [0, 1].map(|i| corner[i] + along * (goal[i] - corner[i]));
        let at = [at[0] - aside * angle.sin(), at[1] + aside * angle.cos()];
        if (at[0] - corner[0]).hypot(at[1] - corner[1]) > 1.2 * radius {
            let shape = disc(at, radius, true, numbers);
            sets.push(Set { margin: margin(radius, numbers), ..Set::keeping(shape, deadline) });
        }
    }
    let speed = size / deadline * numbers.within(-3.0, 3.0);
    let heading = numbers.within(-PI, PI);
    let (motion, typical) = match plant {
        Plant::PointMass => ([speed * heading.cos(), speed * heading.sin()], [8.0 * unit; 2]),
        Plant::Unicycle => ([heading, speed], [8.0 * unit, 10.0 / deadline]),
        _ => ([heading, speed], [8.0 * unit, 1.0]),
    };
    let case = common(plant, sets, &[corner[0], corner[1], motion[0], motion[1]], typical, numbers);
    // A moving goal is at its given position at time 0.
    let mut case = case;
    for set in &mut case.sets {
        if let Shape::Disc { start, velocity, .. } = &mut set.shape {
            *start = [0, 1].map(|i| start[i] - velocity[i] * case.start_time);
        }
    }
    case
}

fn cart(numbers: &mut Numbers) -> Case {
    let (size, deadline, unit, start) = along_line(2, numbers);
    let drag = [numbers.within(0.0, 2.0) / deadline, numbers.within(0.0, 1.0) / size];
    let mut sets = vec![Set {
        margin: margin(size, numbers),
        ..Set::within(Shape::Line { sign: 1.0, at: 0.0 }, deadline)
    }];
    if numbers.chance(0.3) {
        let limit = start[1].max(0.0) + size / deadline * numbers.within(1.0, 10.0);
        sets.push(Set::keeping(Shape::Slow { limit }, deadline));
    }
    common(Plant::Cart { drag }, sets, &start, [2.0 * unit; 2], numbers)
}

fn pendulum(numbers: &mut Numbers) -> Case {
    let (limit, deadline) = (numbers.within(0.1, 1.5), numbers.scale(0.3, 10.0));
    let start = [
        limit * if numbers.chance(0.5) { numbers.within(-0.95, 0.95) } else { numbers.within(-3.0, 3.0) },
        limit / deadline * numbers.within(-2.0, 2.0),
    ];
    let plant = Plant::Pendulum { pull: numbers.within(-10.0, 10.0), drag: numbers.within(0.0, 1.0) };
    let sets = if numbers.chance(0.3) {
        vec![Set { margin: margin(limit * limit, numbers), ..Set::within(Shape::Within { limit }, deadline) }]
    } else {
        let margin = margin(limit, numbers);
        let line =
            |sign: f64| Set { margin, ..Set::within(Shape::Line { sign, at: -sign * limit }, deadline) };
        vec![line(1.0), line(-1.0)]
    };
    let typical = 10.0 + 10.0 * limit / deadline / deadline;
    common(plant, sets, &start, [typical; 2], numbers)
}

fn cruise(numbers: &mut Numbers) -> Case {
    let (lead, deadline) = (numbers.within(5.0, 30.0), numbers.scale(1.0, 30.0));
    let start = [numbers.within(0.0, 100.0), lead * numbers.within(0.5, 1.8)];
    let plant = Plant::Cruise { lead, drag: numbers.within(0.0, 0.1) };
    let shape = if numbers.chance(0.5) {
        Shape::Headway { time: numbers.within(0.5, 2.5) }
    } else {
        Shape::Line { sign: 1.0, at: numbers.within(2.0, 40.0) }
    };
    let set = Set { margin: margin(10.0, numbers), ..Set::within(shape, deadline) };
    let typical = 3.0 + 50.0 / deadline / deadline.min(10.0);
    common(plant, vec![set], &start, [typical; 2], numbers)
}

fn wave(numbers: &mut Numbers) -> Case {
    let n = 1 + numbers.below(2);
    let (size, deadline, unit, start) = along_line(n, numbers);
    let shape = Shape::Wave { size: size * numbers.within(0.05, 1.0), rate: 1.0 };
    let set = Set { margin: margin(size, numbers), ..Set::within(shape, deadline) };
    let mut case = common(Plant::Written(n), vec![set], &start, [3.0 * unit; 2], numbers);
    // From a thousandth of a radian per step to several revolutions, one of which can look like rest.
    let angle = if numbers.chance(0.1) { 2.0 * PI } else { numbers.scale(1e-3, 20.0) };
    if let Shape::Wave { rate, .. } = &mut case.sets[0].shape {
        *rate = angle / case.step;
    }
    case
}

/// A start outside, with a velocity that may lead into the disc.
fn keep_out(numbers: &mut Numbers) -> Case {
    let (radius, deadline) = (numbers.scale(0.2, 5.0), 5.0);
    let far = radius * numbers.scale(1.02, 10.0);
    let angle = numbers.within(-PI, PI);
    let shape = disc([far * angle.cos(), far * angle.sin()], radius, true, numbers);
    let set = Set { margin: margin(radius, numbers), ..Set::keeping(shape, deadline) };
    let speed = far * numbers.within(0.0, 3.0);
    let heading = angle + numbers.within(-0.5, 0.5);
    let unit = [8.0 * far, 3.0];
    let (plant, motion) = match numbers.below(3) {
        0 => (Plant::PointMass, [speed * heading.cos(), speed * heading.sin()]),
        1 => (Plant::Unicycle, [heading, speed]),
        _ => (Plant::Bicycle { l_r: numbers.scale(0.5, 20.0) }, [heading, speed]),
    };
    let case = common(plant, vec![set], &[0.0, 0.0, motion[0], motion[1]], unit, numbers);
    Case { start_time: 0.0, ..case }
}

fn fifty(seed: u64, numbers: &mut Numbers) -> Case {
    let start = [0.0, 0.0, -10.0, -10.0].map(|low| numbers.within(low, low + 20.0));
    let goal = [45.0, 45.0];
    let shape =
        Shape::Disc { start: goal, velocity: [0.0; 2], radius: 2.0, smoothing: Some(2.0), outside: false };
    let set = Set { rate: Some(5.0), stay_rate: Some(5.0), margin: 0.02, ..Set::within(shape, 5.0) };
    let case = Case::plain(Plant::Unicycle, set, &start, 0.05);
    Case { reference: Reference::Damping(1.0), seed, ..case }
}
