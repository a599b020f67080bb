//! The point mass compared with an exact convex programme: from how many of the starts that are feasible with
//! held inputs within the bounds a plan is found.
//!
//! The programme has the input of every sample, the motion of a double integrator under held inputs in closed
//! form, and the disc as a cone at the deadline and at instants from there on. It minimises the largest
//! distance of the point mass outside the disc. If that is below 0, the promise is feasible. Between its
//! instants the programme requires nothing, so what it calls infeasible certainly is.

use std::f64::consts::PI;

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SecondOrderConeT, SolverStatus,
    SupportedConeT, ZeroConeT,
};
use punctual_core::barriers::DistanceDisc;
use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder, Sampling};
use punctual_core::plan::Failure;
use punctual_core::plants::PointMass;

use super::cases;
use crate::judge::case::Numbers;
use crate::judge::on_every_core;

/// Radius of the goal, around the origin, in m.
const RADIUS: f64 = 2.0;
/// Instants in a hold at which the programme requires the disc. The chord between two of them leaves it by at
/// most a (δ/4)²/8, some 0.1 mm. To draw a case, one is enough.
const INSTANTS: usize = 4;
/// Initial bracket of the ease, and the number of halvings of its ratio: to 1 %.
const EASE: [f64; 2] = [0.2, 3.0];
const HALVINGS: u32 = 8;
/// Tolerance of the solver in m: a hundred times its tolerance of 1e-8, for distances of some 100 m.
const SOLVED: f64 = 1e-6;

/// A promise to a point mass.
#[derive(Clone, Copy, Debug)]
struct Case {
    /// Position and velocity in m and m/s.
    start: [f64; 4],
    /// T in s.
    deadline: f64,
    /// δ in s.
    period: f64,
    /// Bound on |a_x| and |a_y| in m/s².
    bound: f64,
}

impl Case {
    /// A start outside in four of five cases, with a deadline within a fifth of the least feasible one; from
    /// inside a speed within a fifth of the largest. Three of four cases are feasible, many of them barely.
    fn draw(seed: u64) -> Self {
        let mut numbers = Numbers::new(seed);
        let bound = numbers.scale(0.5, 15.0);
        let inside = numbers.chance(0.2);
        let far = RADIUS * if inside { numbers.within(0.0, 0.95) } else { numbers.scale(1.05, 20.0) };
        let [angle, heading] = [(); 2].map(|()| numbers.within(-PI, PI));
        // From inside, the speed at which it can just stop; from outside, up to the speed at which it
        // overshoots.
        let speed = if inside { 1.0 } else { numbers.within(0.0, 1.2) } * (bound * far.max(RADIUS)).sqrt();
        let start = [far * angle.cos(), far * angle.sin(), speed * heading.cos(), speed * heading.sin()];
        let least = f64::max(to_rest(start[0], start[2], bound), to_rest(start[1], start[3], bound));
        let period = least / numbers.scale(30.0, 100.0);
        let case = Self { start, deadline: least, period, bound };
        // The least feasible ease.
        let [mut low, mut high] = EASE;
        for _ in 0..HALVINGS {
            let middle = f64::sqrt(low * high);
            if case.eased(middle).least_outside(1) < 0.0 { high = middle } else { low = middle }
        }
        let aside = numbers.scale(1e-3, 0.2);
        case.eased(high * if numbers.chance(0.75) { 1.0 + aside } else { 1.0 / (1.0 + aside) })
    }

    /// The same case with `by` times the time; from inside, with `by` times less speed.
    fn eased(self, by: f64) -> Self {
        let [x, y, v, w] = self.start;
        match self.from() > 0.0 {
            true => Self { deadline: by * self.deadline, period: by * self.period, ..self },
            false => Self { start: [x, y, v / by, w / by], ..self },
        }
    }

    /// When the disc is required: immediately if the start is inside.
    fn from(&self) -> f64 {
        if self.start[0].hypot(self.start[1]) <= RADIUS { 0.0 } else { self.deadline }
    }

    /// Why the filter refuses the case; `None` if it accepts.
    fn refused(&self) -> Option<Failure> {
        let goal = DistanceDisc::new([0.0; 2], RADIUS, RADIUS).expect("valid disc");
        let filter = Filter::builder(PointMass)
            .barrier("goal", goal, BarrierSettings::within(self.deadline))
            .and_then(|b| b.bounds(&[-self.bound; 2], &[self.bound; 2]))
            .and_then(|b| b.sampling(Sampling::Measured { first: Some(self.period) }))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(self.period).expect("a filter that can be assured");
        let report = filter.step(0.0, &self.start, &[0.0; 2], &mut [0.0; 2]);
        let assurance = report.expect("right dimensions").assurance.expect("plans");
        assert_eq!(assurance.is_assured(), assurance.failure.is_none());
        assurance.failure
    }

    /// The least possible value of the largest distance outside the disc, in m, at this many instants per
    /// hold; −[`RADIUS`] if it can rest at the centre.
    fn least_outside(&self, instants: usize) -> f64 {
        let Self { start, deadline, period, bound } = *self;
        // From the edge to rest takes √(4R/a) along an axis. Otherwise the initial speed must be lost.
        let after = f64::max(3.0 * (4.0 * RADIUS / bound).sqrt(), start[2].hypot(start[3]) / bound);
        let holds = ((deadline + after) / period).ceil() as usize + 1;
        let mut programme = Programme::default();
        // Six numbers per hold: position, velocity and input; four at the end; and the distance outside.
        let (state, input) = (|k: usize, i: usize| 6 * k + i, |k: usize, i: usize| 6 * k + 4 + i);
        let outside = 6 * holds + 4;
        for i in 0..4 {
            programme.row(&[(state(0, i), 1.0)], start[i]);
        }
        for k in 0..holds {
            for i in 0..2 {
                let [p, v, u] = [state(k, i), state(k, i + 2), input(k, i)];
                let half = period * period / 2.0;
                programme.row(&[(p, 1.0), (v, period), (u, half), (state(k + 1, i), -1.0)], 0.0);
                programme.row(&[(v, 1.0), (u, period), (state(k + 1, i + 2), -1.0)], 0.0);
            }
        }
        for i in 2..4 {
            programme.row(&[(state(holds, i), 1.0)], 0.0);
        }
        programme.close(ZeroConeT);
        for k in 0..holds {
            for u in [input(k, 0), input(k, 1)] {
                programme.row(&[(u, 1.0)], bound);
                programme.row(&[(u, -1.0)], bound);
            }
        }
        programme.close(NonnegativeConeT);
        let from = self.from();
        let mut looked: Vec<f64> = (0..=holds * instants)
            .map(|j| j as f64 * period / instants as f64)
            .filter(|t| *t > from)
            .collect();
        looked.push(from);
        for t in looked {
            let k = ((t / period) as usize).min(holds - 1);
            let dt = t - k as f64 * period;
            programme.row(&[(outside, -1.0)], RADIUS);
            for i in 0..2 {
                let [p, v, u] = [state(k, i), state(k, i + 2), input(k, i)];
                programme.row(&[(p, -1.0), (v, -dt), (u, -dt * dt / 2.0)], 0.0);
            }
            programme.close(SecondOrderConeT);
        }
        programme.least(outside)
    }
}

/// The least time in s to come to rest at 0 from `p` with speed `v`: full input to one side, then to the
/// other.
fn to_rest(p: f64, v: f64, bound: f64) -> f64 {
    let side = (p + v * v.abs() / (2.0 * bound)).signum();
    (side * v + 2.0 * (v * v / 2.0 + side * bound * p).max(0.0).sqrt()) / bound
}

/// Rows b − A z that lie in cones.
#[derive(Default)]
struct Programme {
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
    right: Vec<f64>,
    cones: Vec<SupportedConeT<f64>>,
    closed: usize,
}

impl Programme {
    fn row(&mut self, terms: &[(usize, f64)], right: f64) {
        for (column, value) in terms {
            self.rows.push(self.right.len());
            self.columns.push(*column);
            self.values.push(*value);
        }
        self.right.push(right);
    }

    /// Puts the rows since the last cone into this one.
    fn close(&mut self, cone: fn(usize) -> SupportedConeT<f64>) {
        self.cones.push(cone(self.right.len() - self.closed));
        self.closed = self.right.len();
    }

    /// The minimum of the last variable.
    fn least(self, last: usize) -> f64 {
        let variables = last + 1;
        let a =
            CscMatrix::new_from_triplets(self.right.len(), variables, self.rows, self.columns, self.values);
        let mut price = vec![0.0; variables];
        price[last] = 1.0;
        let none = CscMatrix::zeros((variables, variables));
        let settings = DefaultSettings { verbose: false, max_iter: 200, ..DefaultSettings::default() };
        let mut solver = DefaultSolver::new(&none, &price, &a, &self.right, &self.cones, settings)
            .expect("matrices that fit");
        solver.solve();
        let status = solver.solution.status;
        assert!(matches!(status, SolverStatus::Solved | SolverStatus::AlmostSolved), "{status:?}");
        solver.solution.x[last]
    }
}

/// The programme is right in a case with a known answer: from rest straight along x.
#[test]
fn the_programme_knows_what_is_possible() {
    let (bound, distance) = (2.0, 20.0);
    let at = |deadline: f64| {
        let start = [-distance, 0.0, 0.0, 0.0];
        Case { start, deadline, period: deadline / 100.0, bound }.least_outside(INSTANTS)
    };
    // The edge at 18 m, with a speed that takes 4 m to stop: at best it comes to rest at 22 m.
    let speed = (bound * (distance + RADIUS)).sqrt();
    let least = speed / bound + (speed - (2.0 * bound * 2.0 * RADIUS).sqrt()) / bound;
    let [late, soon] = [at(least * 1.01), at(least * 0.99)];
    // 1 % of some 6 s at some 4 m/s at the edge; half of it, since the far edge is equally far.
    assert!(late < -0.01 && late > -0.3, "{late}");
    assert!(soon > 0.01 && soon < 0.3, "{soon}");
    // With enough time it comes to rest at the centre.
    let rest = at(3.0 * least);
    assert!((rest + RADIUS).abs() < 1e-3, "{rest}");
}

/// Nothing infeasible is accepted, and most of what is feasible is.
#[test]
fn table_of_what_is_possible() {
    /// Fraction of the feasible starts that must be accepted. They are near the limit on purpose; 0.98 is the
    /// goal.
    const ACCEPTED: f64 = 0.85;
    let count = cases(24, 1000);
    let first = 0x5ec0_0000;
    let found = on_every_core(count, |i| {
        let case = Case::draw(first + i);
        (case, case.least_outside(INSTANTS), case.refused())
    });
    // How far inside the best trajectory stays, relative to the radius.
    let bands = [(0.1, f64::INFINITY), (0.01, 0.1), (0.001, 0.01), (0.0, 0.001)];
    println!("| best way inside by, in radii | possible | accepted |\n|---|---:|---:|");
    let (mut possible, mut accepted) = (0, 0);
    for (low, high) in bands {
        let band = |outside: f64| -outside / RADIUS >= low && -outside / RADIUS < high && outside < -SOLVED;
        let all = found.iter().filter(|(_, outside, _)| band(*outside));
        let taken = all.clone().filter(|(.., refused)| refused.is_none());
        let (all, taken) = (all.count(), taken.count());
        println!("| {low} to {high} | {all} | {taken} |");
        (possible, accepted) = (possible + all, accepted + taken);
    }
    let impossible = found.iter().filter(|(_, outside, _)| *outside > SOLVED);
    println!(
        "{count} starts: {possible} possible, {accepted} of them accepted; {} impossible",
        impossible.clone().count()
    );
    for (case, outside, refused) in found.iter().filter(|(_, outside, _)| *outside < -SOLVED) {
        if let Some(failure) = refused {
            println!("refused, possible with {:.6} m: {case:?}: {failure:?}", -outside);
        }
    }
    let wrong: Vec<_> = impossible.filter(|(.., refused)| refused.is_none()).collect();
    assert!(wrong.is_empty(), "accepted and impossible: {wrong:?}");
    assert!(
        4 * possible >= count as usize && possible < count as usize,
        "too easy or too hard to show anything"
    );
    assert!(accepted as f64 >= ACCEPTED * possible as f64, "{accepted} of {possible}");
}
