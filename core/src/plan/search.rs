//! Reference trajectories by sequential convex programming.
//!
//! The plant is predicted under a guess, and linearised along it, as are the sets. A quadratic program moves the inputs:
//!
//! ```math
//! \begin{align}
//! \min\ & \frac{1}{N} \sum_k \left(\frac{u_k}{w}\right)^2 + \rho \sum_j s_j \\
//! & \delta x_{k+1} = A_k \delta x_k + B_k \delta u_k, & h_j + \nabla h_j \delta x_k + s_j &\ge \mu_j,
//! & |\dot x_N| &\le s
//! \end{align}
//! ```
//!
//! with u within its bounds and a trust region, and the convex part of the curvature of the sets at the last multipliers. A
//! step is kept if the true merit falls. The solver is clarabel: sparse, interior point.

use alloc::vec;
use alloc::vec::Vec;

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus, ZeroConeT};
use nalgebra::DMatrix;

use super::Requirement;
use super::law::Gain;
use super::model::{Linear, Model, slopes};
use super::settings::SearchSettings;
use crate::scalar::all_finite;

/// A search: the start, the grid and the requirements on it.
#[derive(Clone)]
pub(super) struct Search<'a> {
    pub(super) model: Model<'a>,
    pub(super) requirements: Vec<Requirement<'a>>,
    /// Factor on every margin: larger than in the check.
    pub(super) strictness: f64,
    /// The beginning of every hold in s, and the end of the last.
    pub(super) times: &'a [f64],
    pub(super) x: &'a [f64],
    /// The size of each input that has no bounds.
    pub(super) size: f64,
    /// Whether the plant has to be at an equilibrium at the end.
    pub(super) at_equilibrium: bool,
    /// Whether its programs are solved without refinement: faster, and to fewer digits.
    pub(super) quick: bool,
    /// The size of each requirement, if not 0; otherwise the largest |h| along the trajectory is used.
    pub(super) sizes: Vec<f64>,
}

/// Inputs on the grid, with one more for the equilibrium at the end, and the trajectory to which they lead.
#[derive(Clone, Default)]
pub(super) struct Trajectory {
    pub(super) inputs: Vec<Vec<f64>>,
    pub(super) states: Vec<Vec<f64>>,
    /// h − margin at the nodes at which requirements are in force: requirement, node, value.
    values: Vec<(usize, usize, f64)>,
    /// Largest |h| of each requirement along the trajectory.
    sizes: Vec<f64>,
    /// ẋ at the end.
    rate: Vec<f64>,
    /// Largest rate of each state along the trajectory.
    rates: Vec<f64>,
    pub(super) merit: f64,
    /// The largest violation, as a part of its size.
    pub(super) violation: f64,
}

/// The best trajectory from a guess so far, and where its next step begins.
pub(super) struct Descent {
    pub(super) best: Trajectory,
    /// The trust region of each input, in parts of half the width of its bounds.
    trust: Vec<f64>,
    /// The price of each row: initially that of its slack if it is violated, later its multiplier.
    prices: Vec<f64>,
    /// The linear models near the best trajectory, one for every hold, once they are needed.
    linear: Option<Vec<Linear>>,
    /// Whether it continues regardless of its progress.
    pub(super) is_wanted: bool,
}

/// The answer of a quadratic program.
struct Answer {
    inputs: Vec<Vec<f64>>,
    /// Where the linear model expects them to lead.
    states: Vec<Vec<f64>>,
    /// The multiplier of each row.
    prices: Vec<f64>,
    /// The merit that the linear model expects.
    merit: f64,
}

impl Search<'_> {
    /// Asks for more margin of `barrier`, which falls short by `slack` < 0 between the nodes of `near`. If the search has
    /// time for such an exact answer, it adds at most half of the remaining depth there, and from then on the size of the
    /// requirement is its size while it is in force.
    pub(super) fn tighten(&mut self, barrier: usize, slack: f64, near: &Trajectory) {
        let SearchSettings { tighter, least_size, .. } = *self.settings();
        let of_barrier = self.requirements.iter_mut().enumerate().filter(|(_, r)| r.barrier == barrier);
        for (i, requirement) in of_barrier {
            let margin = self.strictness * requirement.margin;
            let mut more = -tighter * slack;
            if !self.quick {
                let values = near.values.iter().filter(|(of, ..)| *of == i).map(|(.., value)| *value);
                more = more.min(0.5 * values.clone().fold(0.0, f64::max));
                let h = values.map(|value| (value + margin).abs());
                self.sizes[i] = h.fold(least_size * near.sizes[i], f64::max);
            }
            requirement.margin += more / self.strictness;
        }
    }

    /// Asks for more margin of everything that `near` falls short of between its nodes, where `given` is the search before
    /// anything was asked for. Returns by how much all of it falls short: 0 if nothing does.
    pub(super) fn tighten_between(&mut self, given: &Self, near: &Trajectory) -> f64 {
        let SearchSettings { tighter, between, .. } = *self.settings();
        let mut least = vec![0.0_f64; self.requirements.len()];
        for (k, u) in near.inputs[..near.inputs.len() - 1].iter().enumerate() {
            let (mut x, part) = (near.states[k].clone(), self.hold(k) / f64::from(between));
            for step in 1..between {
                self.model.flow(&mut x, u, part);
                let t = self.times[k] + f64::from(step) * part;
                for (least, r) in least.iter_mut().zip(&given.requirements) {
                    if r.from < t && t <= r.until {
                        *least = least.min(r.model.value(t, &x) - r.margin);
                    }
                }
            }
        }
        for (requirement, least) in self.requirements.iter_mut().zip(&least) {
            requirement.margin -= tighter * least / self.strictness;
        }
        -least.iter().sum::<f64>()
    }

    /// The length of hold `k` in s.
    fn hold(&self, k: usize) -> f64 {
        self.times[k + 1] - self.times[k]
    }

    fn width(&self, i: usize) -> f64 {
        self.model.reach(i, self.size).max(f64::MIN_POSITIVE)
    }

    fn settings(&self) -> &SearchSettings {
        self.model.settings
    }

    /// Whether it has more inputs than one vehicle in the plane.
    pub(super) fn is_of_many(&self) -> bool {
        self.model.inputs() > self.settings().at_once
    }

    /// The descent that begins with the trajectory under `inputs`, of which the last is for the equilibrium.
    pub(super) fn descent(&self, inputs: Vec<Vec<f64>>) -> Descent {
        let (best, SearchSettings { penalty, trust, .. }) = (self.run(inputs), *self.settings());
        let price = |&(.., value): &(usize, usize, f64)| if value < 0.0 { penalty } else { 0.0 };
        let prices = best.values.iter().map(price).collect();
        let trust = vec![trust; best.inputs[0].len()];
        Descent { best, trust, prices, linear: None, is_wanted: false }
    }

    /// Begins `descent` again where it is, with the margins of this search. Of many vehicles what has a price keeps it, and with
    /// it the curvature that kept the last answers in its set.
    pub(super) fn again(&self, descent: &mut Descent) {
        let mut next = self.descent(descent.best.inputs.clone());
        if self.is_of_many() {
            next.prices.iter_mut().zip(&descent.prices).for_each(|(new, old)| *new = new.max(*old));
        }
        *descent = Descent { is_wanted: descent.is_wanted, ..next };
    }

    /// Predicts the trajectory under `inputs`, of which the last is for the equilibrium.
    pub(super) fn run(&self, inputs: Vec<Vec<f64>>) -> Trajectory {
        self.steer(inputs, None)
    }

    /// Predicts the trajectory under `inputs`, with the feedback `along` states if there is one. The inputs of the result
    /// are those after feedback.
    fn steer(&self, mut inputs: Vec<Vec<f64>>, along: Option<(&[Vec<f64>], &[Gain])>) -> Trajectory {
        let (holds, nx) = (inputs.len() - 1, self.x.len());
        let mut states = vec![self.x.to_vec()];
        let mut rates = vec![0.0_f64; nx];
        for (k, u) in inputs[..holds].iter_mut().enumerate() {
            let (from, hold) = (&states[k], self.hold(k));
            let mut x = from.clone();
            if let Some((expected, gains)) = along {
                gains[k].feedback(&u.clone(), |i| x[i] - expected[k][i], u);
                self.model.clamp(u);
            }
            self.model.flow(&mut x, u, hold);
            for (rate, (x, from)) in rates.iter_mut().zip(x.iter().zip(from)) {
                *rate = rate.max((x - from).abs() / hold);
            }
            states.push(x);
        }
        let rate = self.model.rate(&states[holds], &inputs[holds], self.hold(holds - 1)).as_slice().to_vec();
        // A state that hardly moves is measured by a part of the fastest rate.
        let fastest = rates.iter().fold(1e-3, |m: f64, r| m.max(*r));
        rates.iter_mut().for_each(|r| *r = r.max(0.05 * fastest));
        let (mut values, mut sizes) = (Vec::new(), self.sizes.clone());
        for (i, requirement) in self.requirements.iter().enumerate() {
            for (k, x) in states.iter().enumerate() {
                let t = self.times[k];
                let h = requirement.model.value(t, x);
                if self.sizes[i] == 0.0 {
                    sizes[i] = sizes[i].max(h.abs());
                }
                // A deadline between two nodes is required at the one before.
                let next = self
                    .times
                    .get(k + 1)
                    .map_or(f64::INFINITY, |next| next - self.settings().on_node * (next - t));
                let before = if k > 0 { self.times[k - 1] } else { t };
                let until = requirement.until + self.settings().on_node * (t - before);
                if k > 0 && requirement.from < next && t <= until {
                    values.push((i, k, h - self.strictness * requirement.margin));
                }
            }
        }
        let mut trajectory =
            Trajectory { inputs, states, values, sizes, rate, rates, merit: 0.0, violation: 0.0 };
        self.appraise(&mut trajectory);
        trajectory
    }

    fn appraise(&self, of: &mut Trajectory) {
        let SearchSettings { penalty, end_rate, .. } = *self.settings();
        let share = 1.0 / of.inputs.len() as f64;
        let effort: f64 = of
            .inputs
            .iter()
            .flat_map(|u| {
                u.iter().enumerate().map(|(i, u)| {
                    let part = u / self.width(i);
                    part * part * share
                })
            })
            .sum();
        let mut violation = 0.0;
        let mut most = 0.0_f64;
        let missing = of.values.iter().map(|&(i, _, value)| -value / of.sizes[i].max(f64::MIN_POSITIVE));
        let moving = of.rate.iter().zip(&of.rates).map(|(r, scale)| r.abs() / scale - end_rate);
        for part in missing.chain(moving.filter(|_| self.at_equilibrium)) {
            violation += part.max(0.0);
            most = most.max(part);
        }
        (of.merit, of.violation) = (effort + penalty * violation, most);
        if !(of.merit.is_finite() && of.states.iter().all(|x| all_finite(x))) {
            (of.merit, of.violation) = (f64::INFINITY, f64::INFINITY);
        }
    }

    /// Improves the best trajectory of `descent` by at most `iterations` quadratic programs.
    pub(super) fn improve(&self, descent: &mut Descent, iterations: u32) {
        let SearchSettings { least_trust, as_expected, learned, fading, penalty, .. } = *self.settings();
        for _ in 0..iterations {
            let Descent { best, trust, prices, linear, .. } = descent;
            if !best.merit.is_finite() || trust.iter().all(|t| *t < least_trust) {
                break;
            }
            let along = linear.get_or_insert_with(|| self.linear(best));
            let Some(answer) = self.program(best, along, prices, trust) else {
                trust.iter_mut().for_each(|t| *t *= 0.3);
                continue;
            };
            let expected = best.merit - answer.merit;
            let mut next = self.run(answer.inputs.clone());
            // Feedback may lead a plant where open-loop inputs do not: an unstable plant forgets no deviation.
            if best.merit - next.merit <= as_expected * expected
                && let Some(gains) = Gain::along(&self.model, &answer.states, &answer.inputs, along)
            {
                let led = self.steer(answer.inputs, Some((&answer.states, &gains)));
                // NaN is no better.
                if led.merit < next.merit {
                    next = led;
                }
            }
            let gain = best.merit - next.merit;
            if gain <= 0.0 && self.is_of_many() && self.learn(prices, best, &next) {
                continue;
            }
            if gain > as_expected * expected {
                trust.iter_mut().for_each(|t| *t = (2.0 * *t).min(2.0));
            } else if gain < 0.3 * expected {
                self.shrink(trust, best, &next, if gain > 0.0 { 0.5 } else { 0.3 });
            }
            if gain > 0.0 {
                let settled = next.violation <= 0.0 && gain <= 1e-2 * best.merit;
                let faded = |(new, old): (&f64, &f64)| new.max(fading * old.min(learned * penalty));
                *prices = match self.is_of_many() {
                    true => answer.prices.iter().zip(prices.iter()).map(faded).collect(),
                    false => answer.prices,
                };
                (*best, *linear) = (next, None);
                if settled {
                    // Nothing is left to gain.
                    trust.fill(0.0);
                }
            }
        }
    }

    /// Gives a price to what `next` breaks and `best` did not, though the linear model expected neither: so the next program
    /// knows how it curves. Returns whether there is any that had none.
    fn learn(&self, prices: &mut [f64], best: &Trajectory, next: &Trajectory) -> bool {
        let least = self.settings().learned * self.settings().penalty;
        let mut learned = false;
        for (price, (before, after)) in prices.iter_mut().zip(best.values.iter().zip(&next.values)) {
            if before.2 >= 0.0 && after.2 < 0.0 && *price < least {
                (*price, learned) = (least, true);
            }
        }
        learned
    }

    /// The linear models near `at`, one for every hold.
    fn linear(&self, at: &Trajectory) -> Vec<Linear> {
        let holds = at.inputs.len() - 1;
        (0..holds).map(|k| self.model.linear(&at.states[k], &at.inputs[k], self.hold(k))).collect()
    }

    /// The gains of a feedback along the best trajectory of `descent`, if there are any.
    pub(super) fn gains(&self, descent: &mut Descent) -> Option<Vec<Gain>> {
        let Descent { best, linear, .. } = descent;
        let linear = linear.get_or_insert_with(|| self.linear(best));
        Gain::along(&self.model, &best.states, &best.inputs, linear)
    }

    /// Shrinks the trust region of those inputs whose change from `from` to `to` curves the trajectory: an input that turns
    /// a vehicle does, one that accelerates it does not. If none does, shrinks all.
    fn shrink(&self, trust: &mut [f64], from: &Trajectory, to: &Trajectory, by: f64) {
        let end = |input: usize, part: f64| {
            let mut x = self.x.to_vec();
            for k in 0..from.inputs.len() - 1 {
                let mut u = from.inputs[k].clone();
                u[input] += part * (to.inputs[k][input] - u[input]);
                self.model.flow(&mut x, &u, self.hold(k));
            }
            x
        };
        let bends = |input: usize| {
            let (half, full) = (end(input, 0.5), end(input, 1.0));
            let unchanged = &from.states[from.states.len() - 1];
            let ends = unchanged.iter().zip(&half).zip(&full).zip(&from.rates);
            let (bent, moved) = ends.fold((0.0_f64, 0.0_f64), |(bent, moved), (((a, b), c), rate)| {
                (bent.max((a - 2.0 * b + c).abs() / rate), moved.max((c - a).abs() / rate))
            });
            bent > self.settings().bent * moved
        };
        let bent: Vec<bool> = (0..trust.len()).map(bends).collect();
        let none = !bent.contains(&true);
        for (trust, bent) in trust.iter_mut().zip(bent) {
            if bent || none {
                *trust *= by;
            }
        }
    }

    /// The answer of the quadratic program around `at`. Rows that are far from their edge are added if the answer would
    /// break them.
    fn program(&self, at: &Trajectory, linear: &[Linear], prices: &[f64], trust: &[f64]) -> Option<Answer> {
        let (nx, SearchSettings { near, priced, penalty, .. }) = (self.model.states(), *self.settings());
        let slopes_of = |&(i, k, _): &(usize, usize, f64)| {
            let mut gradient = vec![0.0; nx];
            slopes(self.requirements[i].model, self.times[k], &at.states[k], &mut gradient);
            gradient
        };
        let gradients: Vec<Vec<f64>> = at.values.iter().map(slopes_of).collect();
        let is_near = |(&(i, _, value), &price): (&(usize, usize, f64), &f64)| {
            value <= near * at.sizes[i] || price > priced * penalty
        };
        let mut rows: Vec<bool> = at.values.iter().zip(prices).map(is_near).collect();
        loop {
            let answer = self.program_of(&rows, &gradients, at, linear, prices, trust)?;
            let mut breaks = false;
            for ((row, &(_, k, value)), gradient) in rows.iter_mut().zip(&at.values).zip(&gradients) {
                let moved = answer.states[k].iter().zip(&at.states[k]).zip(gradient);
                if !*row && value + moved.map(|((to, from), slope)| slope * (to - from)).sum::<f64>() < 0.0 {
                    (*row, breaks) = (true, true);
                }
            }
            if !breaks {
                return Some(answer);
            }
        }
    }

    /// The answer of that program with some of its `rows`, whose gradients are `gradients`.
    fn program_of(
        &self,
        rows: &[bool],
        gradients: &[Vec<f64>],
        at: &Trajectory,
        linear: &[Linear],
        prices: &[f64],
        trust: &[f64],
    ) -> Option<Answer> {
        let SearchSettings { penalty, priced, iterations, gaps, feasible, .. } = *self.settings();
        let (nx, nu) = (self.model.states(), self.model.inputs());
        let holds = at.inputs.len() - 1;
        let kept: Vec<usize> = (0..rows.len()).filter(|&row| rows[row]).collect();
        // Variables: δu_0 … δu_N, δx_1 … δx_N, slacks of the rows, slacks of the equilibrium.
        let input = |k: usize, i: usize| k * nu + i;
        let state = |k: usize, i: usize| (holds + 1) * nu + (k - 1) * nx + i;
        let first_slack = (holds + 1) * nu + holds * nx;
        let first_equilibrium = first_slack + kept.len();
        let variables = first_equilibrium + nx;
        let (mut is, mut js, mut vs, mut b) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut entry = |i: usize, j: usize, v: f64| {
            if v != 0.0 {
                is.push(i);
                js.push(j);
                vs.push(v);
            }
        };
        // The linear model, as equations.
        for (k, Linear { a, b: by }) in linear.iter().enumerate() {
            for i in 0..nx {
                entry(b.len(), state(k + 1, i), 1.0);
                for j in 0..nx {
                    if k > 0 {
                        entry(b.len(), state(k, j), -a[(i, j)]);
                    }
                }
                for j in 0..nu {
                    entry(b.len(), input(k, j), -by[(i, j)]);
                }
                b.push(0.0);
            }
        }
        let equations = b.len();
        // The sets at the nodes.
        for (slack, &row) in kept.iter().enumerate() {
            let (i, k, value) = at.values[row];
            let size = at.sizes[i].max(f64::MIN_POSITIVE);
            for j in 0..nx {
                entry(b.len(), state(k, j), -gradients[row][j] / size);
            }
            entry(b.len(), first_slack + slack, -1.0);
            b.push(value / size);
        }
        // The equilibrium at the end, if required.
        let hold = self.hold(holds - 1);
        let Linear { a, b: by } = self.model.linear(&at.states[holds], &at.inputs[holds], hold);
        let a = (a - DMatrix::identity(nx, nx)) / hold;
        let by = by / hold;
        for i in 0..if self.at_equilibrium { nx } else { 0 } {
            for sign in [1.0, -1.0] {
                let scale = sign / at.rates[i];
                for j in 0..nx {
                    entry(b.len(), state(holds, j), scale * a[(i, j)]);
                }
                for j in 0..nu {
                    entry(b.len(), input(holds, j), scale * by[(i, j)]);
                }
                entry(b.len(), first_equilibrium + i, -1.0);
                b.push(-scale * at.rate[i]);
            }
        }
        // Slacks, bounds and the trust region.
        for slack in first_slack..variables {
            entry(b.len(), slack, -1.0);
            b.push(0.0);
        }
        for (k, u) in at.inputs.iter().enumerate() {
            for (i, &u) in u.iter().enumerate() {
                let room = trust[i] * self.width(i);
                entry(b.len(), input(k, i), 1.0);
                b.push((self.model.bounds.max[i] - u).min(room));
                entry(b.len(), input(k, i), -1.0);
                b.push((u - self.model.bounds.min[i]).min(room));
            }
        }
        // ½ zᵀPz + qᵀz: effort and slacks.
        let mut q = vec![0.0; variables];
        let mut diagonal = vec![0.0; variables];
        let share = 2.0 / (holds + 1) as f64;
        for (k, u) in at.inputs.iter().enumerate() {
            for (i, u) in u.iter().enumerate() {
                let price = share / (self.width(i) * self.width(i));
                diagonal[input(k, i)] = price;
                q[input(k, i)] = price * u;
            }
        }
        q[first_slack..].fill(penalty);
        // The curvature of the sets, where it is convex in the program.
        let mut indices: Vec<usize> = (0..variables).collect();
        let mut columns = indices.clone();
        for (&(i, k, _), &price) in at.values.iter().zip(prices) {
            if price > priced * penalty {
                let weight = price / at.sizes[i].max(f64::MIN_POSITIVE);
                let bent = self.curvature(i, k, &at.states[k]) * weight;
                for r in 0..nx {
                    for c in r..nx {
                        if bent[(r, c)] != 0.0 {
                            indices.push(state(k, r));
                            columns.push(state(k, c));
                            diagonal.push(bent[(r, c)]);
                        }
                    }
                }
            }
        }
        let p = CscMatrix::new_from_triplets(variables, variables, indices, columns, diagonal);
        let constraints = CscMatrix::new_from_triplets(b.len(), variables, is, js, vs);
        let cones = [ZeroConeT(equations), NonnegativeConeT(b.len() - equations)];
        let settings = DefaultSettings {
            verbose: false,
            max_iter: iterations,
            iterative_refinement_enable: !(self.quick || self.is_of_many()),
            tol_gap_abs: gaps[usize::from(self.quick || self.is_of_many())],
            tol_gap_rel: gaps[usize::from(self.quick || self.is_of_many())],
            tol_feas: feasible,
            ..DefaultSettings::default()
        };
        let mut solver = DefaultSolver::new(&p, &q, &constraints, &b, &cones, settings).ok()?;
        solver.solve();
        let solution = &solver.solution;
        let solved = matches!(solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved);
        if !solved || !solution.x.iter().all(|v| v.is_finite()) {
            return None;
        }
        let mut inputs = at.inputs.clone();
        let mut merit = penalty * solution.x[first_slack..].iter().map(|s| s.max(0.0)).sum::<f64>();
        for (k, u) in inputs.iter_mut().enumerate() {
            for (i, u) in u.iter_mut().enumerate() {
                *u += solution.x[input(k, i)];
                let part = *u / self.width(i);
                merit += 0.5 * share * part * part;
            }
            self.model.clamp(u);
        }
        let mut states = at.states.clone();
        for (k, x) in states.iter_mut().enumerate().skip(1) {
            x.iter_mut().enumerate().for_each(|(i, x)| *x += solution.x[state(k, i)]);
        }
        let mut prices = vec![0.0; rows.len()];
        kept.iter().zip(&solution.z[equations..]).for_each(|(&row, price)| prices[row] = *price);
        Some(Answer { inputs, states, prices, merit })
    }

    /// The convex part of −∂²h/∂x², of requirement `i` at node `k`, by differences: only of the states that h reads.
    fn curvature(&self, i: usize, k: usize, x: &[f64]) -> DMatrix<f64> {
        let (nx, model) = (x.len(), self.requirements[i].model);
        let read: Vec<usize> = (0..nx).filter(|j| model.reads(*j)).collect();
        let (mut moved, mut ends) = (x.to_vec(), [vec![0.0; nx], vec![0.0; nx]]);
        let mut bent = DMatrix::zeros(read.len(), read.len());
        for (c, &j) in read.iter().enumerate() {
            let size = if self.quick { 1e-3 } else { 1e-4 } * (1.0 + x[j].abs());
            for (end, sign) in ends.iter_mut().zip([size, -size]) {
                moved[j] = x[j] + sign;
                slopes(model, self.times[k], &moved, end);
            }
            moved[j] = x[j];
            for (r, &of) in read.iter().enumerate() {
                bent[(r, c)] = (ends[1][of] - ends[0][of]) / (2.0 * size);
            }
        }
        let mut convex = DMatrix::zeros(nx, nx);
        if read.is_empty() {
            return convex;
        }
        let symmetric = (&bent + bent.transpose()) * 0.5;
        let parts = symmetric.symmetric_eigen();
        let most = parts.eigenvalues.amax();
        let kept = parts.eigenvalues.map(|v| if v > 1e-4 * most { v } else { 0.0 });
        let of_read = &parts.eigenvectors * DMatrix::from_diagonal(&kept) * parts.eigenvectors.transpose();
        for (c, &j) in read.iter().enumerate() {
            for (r, &of) in read.iter().enumerate() {
                convex[(of, j)] = of_read[(r, c)];
            }
        }
        convex
    }
}
