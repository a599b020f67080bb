//! Tubes: where an uncertain plant can be along a plan, under a law that holds it there (docs/theory.md#robust-plan).
//!
//! The reference is z(t), under inputs v held for a sample. The law is u = v + K (x̂ − z) at the samples, where the measured
//! x̂ differs from x by at most the declared errors. Deviations e = x − z and δ = K (x̂ − z) obey
//!
//! ```math
//! \dot e = f(z + e) + g(z + e)(v + \delta) - f(z) - g(z) v + w
//! = M e + N \delta + \sum_{i \le j} H_{ij} q_{ij} + w, \tag{1}
//! ```
//!
//! with the first derivatives M and N in the middle of a piece of z, the second derivatives H somewhere on it, and with d the
//! deviation of z from that middle,
//!
//! ```math
//! q_{ii} = d_i e_i + \frac{1}{2} e_i^2, \qquad q_{ij} = d_i e_j + d_j e_i + e_i e_j. \tag{2}
//! ```
//!
//! The deviations are enclosed by a zonotope. Each pair (i, j) contributes a generator along the vector H_ij, so that what a
//! vehicle loses by its heading points across its heading. What is left is a box: the declared rates, the width of H, the
//! residual of z and round-off. First (1) is bounded on a guess of all deviations on the piece, which is verified (Picard and
//! Lindelöf).
//!
//! An input that is followed late by a time constant adds rows of its own: what arrives is v + δ + λ, and λ, which jumps by
//! −(Δv + Δδ) at every sample, dies away meanwhile. So only changes of the input are late, the law's among them, and the
//! zonotope knows from which deviations these come. The answer to errors of measurement is apart: what arrives of it is a
//! mean of earlier answers, so that it counts as it is, anew at every instant. The same rows serve where samples come late:
//! until the next sample all of λ may be there, and afterwards nothing.
//!
//! | module | owns |
//! |---|---|
//! | here | the tube, moved on by a piece |
//! | `bends` | on what a function depends, and where it is curved |
//! | `falls` | by how much h may be lower in the tube than along the reference |
//! | `faults` | defects that tests plant |
//! | `tracking` | the law: reference, gains and radii, by sample |
//! | `zonotope` | sets |
//!
//! Source: M. Althoff, O. Stursberg and M. Buss, "Reachability analysis of nonlinear systems with uncertain parameters using
//! conservative linearization", CDC (2008); the generators by pairs are ours.

mod bends;
mod falls;
pub(super) mod faults;
mod tracking;
mod zonotope;

#[cfg(test)]
mod tests;

use alloc::collections::VecDeque;
use alloc::vec;
use alloc::vec::Vec;

use super::expansion::{self, at};
use super::{Failure, Requirement};
use crate::MAX_INPUTS;
use crate::elementary;
use crate::interval::Interval;
use crate::lie::{Expansion, ExpansionOver, Predict, Second};
use crate::qp::Bounds;
use crate::scalar::{Scalar, all_finite};
use bends::{Bends, radius, size};
use faults::{Fault, is_planted};
pub use tracking::Tracking;
pub(super) use tracking::gains;
use zonotope::Zonotope;

/// Largest number of generators. With fewer a tube is wider, since boxes are; with more a check takes longer.
const GENERATORS: usize = 100;
/// The same if inputs are followed late: what is late depends on the states, which a box forgets.
const LATE_GENERATORS: usize = 200;
/// Number of guesses of the deviations on a piece. The second is enough where a piece is short against the plant's motion.
const GUESSES: u32 = 8;
/// Number of bounds of the error of a prediction on a piece, each from the one before.
const REFINED: u32 = 3;
/// Part by which a guess exceeds what followed from the one before.
const WIDER: f64 = 0.02;
/// The factor by which the first guess of what is asked late exceeds what follows from the beginning.
const AHEAD: f64 = 1.2;
/// The least size of a deviation: far below what any promise resolves, and above round-off.
const LEAST: f64 = 1e-12;
/// Round-off of a hundred operations on numbers up to a size, as a part of it.
const ROUND_OFF: f64 = 1e-13;

/// What is not known of a plant and of its measurements: all that a robust plan accounts for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Uncertainty {
    /// What may be added to the rate of each state, at all times, in its unit per s.
    pub(crate) rates: Vec<f64>,
    /// How far each state may be from its measured value, in its unit.
    pub(crate) errors: Vec<f64>,
    /// Which part of each input arrives, from the least to the largest.
    pub(crate) gains: Vec<[f64; 2]>,
    /// The time constant in s with which each input is followed, from the least to the largest.
    pub(crate) lags: Vec<[f64; 2]>,
    /// By how much of a period a sample may come after it was expected. If 0, samples come as expected; otherwise also at any
    /// time before.
    pub(crate) jitter: f64,
    /// How far each state may be from where the plan begins, beside its error of measurement, and by how much each input may
    /// differ from that of the law, at all times.
    pub(crate) start: Vec<f64>,
    pub(crate) freedom: Vec<f64>,
}

impl Uncertainty {
    /// Nothing, for a plant with so many states and inputs.
    pub(crate) fn nothing([states, inputs]: [usize; 2]) -> Self {
        Self {
            rates: vec![0.0; states],
            errors: vec![0.0; states],
            gains: vec![[1.0; 2]; inputs],
            lags: vec![[0.0; 2]; inputs],
            jitter: 0.0,
            start: vec![0.0; states],
            freedom: vec![0.0; inputs],
        }
    }

    /// Whether the plant is the model and measured exactly, and a plan is for one state.
    pub(crate) fn is_nothing(&self) -> bool {
        let sizes = self.rates.iter().chain(&self.errors).chain(&self.start).chain(&self.freedom);
        sizes.into_iter().all(|size| *size == 0.0)
            && self.gains.iter().all(|gain| *gain == [1.0; 2])
            && !self.lags()
            && self.jitter == 0.0
    }
}

impl Uncertainty {
    /// Whether an input is followed late.
    pub(crate) fn lags(&self) -> bool {
        self.lags.iter().any(|[_, longest]| *longest > 0.0)
    }

    /// What remains of a difference of input `i` from what is asked of it after `dt` s, as a part of it: the least and the
    /// largest. It may be asked for anew at any time in the first `held` s.
    pub(crate) fn remains(&self, i: usize, dt: f64, held: f64) -> [f64; 2] {
        let remains = |lag: f64, dt: f64| match lag > 0.0 {
            true => elementary::exp(-dt / lag),
            false => f64::from(dt <= 0.0 && held > 0.0),
        };
        [remains(self.lags[i][0], dt), remains(self.lags[i][1], dt - held)]
    }

    /// The mean of that over `dt` s.
    fn remains_on_average(&self, i: usize, dt: f64, held: f64) -> [f64; 2] {
        // It rises with the lag.
        let integral =
            |lag: f64, dt: f64| if lag > 0.0 { lag * (1.0 - elementary::exp(-dt / lag)) } else { 0.0 };
        [integral(self.lags[i][0], dt) / dt, (held + integral(self.lags[i][1], dt - held)) / dt]
    }
}

/// What a plan lacks: the part of every input that the law needs, and what each requirement loses, where one is not met.
#[derive(Clone, Debug, Default)]
pub(super) struct Lacks {
    /// The largest share of the law of each input, in its unit.
    pub(super) feedback: [f64; MAX_INPUTS],
    /// By how much the input of the law is out of its bounds.
    pub(super) reserve: [f64; MAX_INPUTS],
    /// The largest loss of h of each requirement where it is not met, and the most that it lacks, in its unit.
    pub(super) falls: Vec<f64>,
    pub(super) missing: Vec<f64>,
    /// When in s it first lacks it.
    pub(super) since: Vec<f64>,
    /// The first requirement, or input, that is not met.
    pub(super) failure: Option<Failure>,
}

/// The deviations of the plant from a reference, at the end of its last piece.
pub(super) struct Tube<'a> {
    of: &'a Uncertainty,
    bounds: &'a Bounds,
    /// How long in s after its sample an input begins to act, and how far the state that is predicted for then may be from
    /// the true one; by how much in s an input after the first may come late, and how much of that is left of this hold.
    delay: f64,
    latest: f64,
    held: f64,
    unseen: Vec<f64>,
    next_unseen: Vec<f64>,
    /// The pieces over which a state is predicted until the end of the last piece.
    predicted: VecDeque<Predicted>,
    /// Number of states, and of inputs.
    dims: [usize; 2],
    /// Deviations of the states; if inputs are late, of what arrives from what is asked; and of the inputs asked while
    /// they are held.
    set: Zonotope,
    /// The number of rows of the second kind, 0 or one for each input, and the last inputs asked of the reference.
    late: usize,
    last: Vec<f64>,
    /// The largest sizes of these rows, if inputs come late.
    lates: Vec<f64>,
    /// What is left of them from earlier holds.
    lefts: Vec<f64>,
    /// The gain of this hold, if inputs come late; empty for 0.
    gain: Vec<f64>,
    /// If inputs come late: by how much the answer of this hold, and of the two before, may differ from that to the state at
    /// its beginning; and of all of them, as it arrives.
    differs: [[f64; MAX_INPUTS]; 3],
    arrives: [f64; MAX_INPUTS],
    /// The largest share of each input so far that answers an error of measurement, if inputs are followed late. What arrives
    /// of it then is a mean of earlier ones, and no larger.
    noise: Vec<f64>,
    /// The same at the beginning of the last piece.
    before: Zonotope,
    /// The largest deviation on the last piece, and how far one moves there.
    reach: Vec<f64>,
    moved: Vec<f64>,
    /// The largest deviation of every state in this hold.
    widest: Vec<f64>,
    /// How far a deviation may be on the last piece from the line between its beginning and its end.
    bulge: Vec<f64>,
    /// Whether everything is recorded in `lacks` that is not met. Otherwise the first of it ends the check.
    pub(super) records: bool,
    pub(super) lacks: Lacks,
    plant: Bends,
    barriers: Vec<Option<Bends>>,
    rooms: Rooms,
}

/// Memory of an evaluation.
#[derive(Default)]
struct Rooms {
    variables: Vec<Second>,
    rates: Vec<Second>,
    at: Vec<Interval>,
    slopes: Vec<Interval>,
    curvatures: Vec<Interval>,
    scores: Vec<(f64, usize)>,
    parts: Vec<f64>,
}

/// A piece of the reference: the expansions of its states and their enclosures, its length in s, and the input held.
#[derive(Clone, Copy)]
pub(super) struct Piece<'a> {
    pub(super) path: &'a [Expansion],
    pub(super) over: &'a [ExpansionOver],
    pub(super) dt: f64,
    pub(super) u: &'a [f64],
}

impl<'a> Tube<'a> {
    /// The tube that begins within the errors of measurement around the reference, for inputs that act `delay` s after their
    /// sample, and samples that are expected every `period` s. `None` if the plant has no derivatives on enclosures.
    pub(super) fn around(
        plant: &dyn Predict,
        (of, [delay, period]): (&'a Uncertainty, [f64; 2]),
        bounds: &'a Bounds,
        dims: [usize; 2],
        requirements: &[Requirement<'_>],
    ) -> Option<Self> {
        let [n, m] = dims;
        let bends = Bends::of(n, n + m, |variables, out| {
            let (x, u) = variables.split_at(n);
            plant.second_rates(x, u, out)
        })?;
        let value = |requirement: &Requirement<'_>| {
            Bends::of(1, n, |x, out| match requirement.model.second_value(Interval::ALL, x) {
                Some(h) => {
                    out[0] = h;
                    true
                }
                None => false,
            })
        };
        let late = if of.lags() || of.jitter > 0.0 { m } else { 0 };
        let latest = if of.jitter > 0.0 { (1.0 + of.jitter) * period } else { 0.0 };
        let mut tube = Self {
            of,
            bounds,
            delay,
            latest,
            held: 0.0,
            unseen: of.errors.clone(),
            next_unseen: of.errors.clone(),
            predicted: VecDeque::new(),
            dims,
            set: Zonotope::point(n + late + m),
            before: Zonotope::point(n + late + m),
            late,
            last: vec![0.0; m],
            lates: vec![0.0; m],
            lefts: vec![0.0; m],
            gain: Vec::new(),
            differs: [[0.0; MAX_INPUTS]; 3],
            arrives: [0.0; MAX_INPUTS],
            noise: vec![0.0; m],
            reach: vec![0.0; n + late + m],
            moved: vec![0.0; n],
            widest: vec![0.0; n],
            bulge: vec![0.0; n],
            records: false,
            lacks: Lacks {
                falls: vec![0.0; requirements.len()],
                missing: vec![0.0; requirements.len()],
                since: vec![f64::INFINITY; requirements.len()],
                ..Lacks::default()
            },
            plant: bends,
            barriers: requirements.iter().map(value).collect(),
            rooms: Rooms::default(),
        };
        tube.next_unseen = tube.errors();
        for (i, (error, start)) in tube.next_unseen.iter().zip(&of.start).enumerate() {
            tube.set.push_along(i, error + start);
        }
        tube.set.reach(&mut tube.reach);
        Some(tube)
    }

    /// How far each state may be from its measured value.
    fn errors(&self) -> Vec<f64> {
        let mut errors = self.of.errors.clone();
        errors.iter_mut().take(usize::from(is_planted(Fault::Error))).for_each(|error| *error = 0.0);
        errors
    }

    /// The same tube if each input that arrives is within `acting` when it begins.
    pub(super) fn acted_on(mut self, acting: &[[f64; 2]]) -> Self {
        let n = self.dims[0];
        for (i, [low, high]) in acting.iter().enumerate() {
            self.last[i] = 0.5 * (low + high);
            if self.late > 0 {
                self.set.push_along(n + i, 0.5 * (high - low) * (1.0 + ROUND_OFF));
            }
        }
        self
    }

    /// The largest deviation of every measured state from the reference at the end of the last piece.
    pub(super) fn radii(&mut self) -> Vec<f64> {
        self.set.reach(&mut self.reach);
        self.reach.iter().zip(&self.next_unseen).map(|(reach, unseen)| reach + unseen).collect()
    }

    /// The same at any time of the last hold.
    pub(super) fn widest(&self) -> Vec<f64> {
        self.widest.iter().zip(&self.next_unseen).map(|(reach, unseen)| reach + unseen).collect()
    }

    /// Begins a hold of `v` from the reference state `z`, with the feedback `gain` (by input and state) of a measurement
    /// there; without one the input is `v` alone.
    ///
    /// # Errors
    ///
    /// An input that leaves its bounds.
    pub(super) fn hold(&mut self, v: &[f64], z: &[f64], gain: Option<&[f64]>) -> Result<(), Failure> {
        let ([n, m], kept) = (self.dims, self.dims[0] + self.late);
        if self.latest > 0.0 && self.delay > 0.0 {
            // An answer may be to a state that is predicted for a time of this hold.
            let is_more = |(now, before): (&f64, &f64)| now > before;
            if !self.gain.is_empty() && self.next_unseen.iter().zip(&self.unseen).any(is_more) {
                self.lack(Failure::Spreads)?;
            }
            self.next_unseen.iter_mut().for_each(|unseen| *unseen *= AHEAD);
        }
        self.unseen.copy_from_slice(&self.next_unseen);
        self.next_unseen = self.errors();
        self.set.reach(&mut self.reach);
        let sizes: Vec<f64> = self.reach[..kept].iter().map(|reach| reach.max(LEAST)).collect();
        // What arrives does not jump, what is asked does, and a share of the law follows from the states. So a box around some
        // generators has to keep these and what is late from now on.
        let share = |i: usize, j: usize| gain.map_or(0.0, |gain| gain[i * n + j]);
        let late = self.late;
        let mut along = vec![0.0; kept + m];
        for i in 0..late {
            // The jump of what is asked.
            (0..n).for_each(|j| along[j] = share(i, j));
            along[kept + i] = -1.0;
            let jump = v[i] - self.last[i] + zonotope::dot(&along, &self.set.centre);
            let spread = self.set.half_width(&along, &mut self.rooms.parts);
            // The input of a measurement here comes in time.
            let is_in_time = gain.is_none() && self.of.lags[i][1] == 0.0;
            let size = (self.reach[n + i] + jump.abs() + spread) * (1.0 + ROUND_OFF);
            self.lefts[i] = self.reach[n + i];
            self.lates[i] = if is_in_time { 0.0 } else { size };
            along[kept + i] = 0.0;
        }
        self.widest.fill(0.0);
        self.held = if gain.is_some() { self.latest } else { 0.0 };
        self.differs.rotate_right(1);
        self.differs[0] = [0.0; MAX_INPUTS];
        self.gain.clear();
        self.gain.extend_from_slice(gain.filter(|_| self.latest > 0.0).unwrap_or_default());
        if late > 0 {
            self.set.map(|i, j| match (i.checked_sub(n), i.checked_sub(kept)) {
                (Some(input), None) if j < n => -share(input, j),
                (Some(input), None) if j == kept + input => 1.0,
                _ => f64::from(i == j),
            });
        }
        let generators = if self.of.lags() { LATE_GENERATORS } else { GENERATORS };
        self.set.reduce(generators, kept, &sizes, &mut self.rooms.scores);
        self.set.map(|i, j| match i.checked_sub(kept) {
            Some(input) if j < n => share(input, j),
            Some(_) => 0.0,
            None => f64::from(i == j),
        });
        if self.late > 0 {
            for (i, v) in v.iter().enumerate() {
                self.set.centre[n + i] -= v - self.last[i];
            }
        }
        self.last.copy_from_slice(v);
        let Some(gain) = gain else { return Ok(()) };
        for j in 0..n {
            // The law itself rounds too.
            self.unseen[j] += 8.0 * f64::EPSILON * (z[j].abs() + sizes[j]);
        }
        let mut noises = vec![0.0; m];
        if self.late > 0 {
            for ((noise, largest), gain) in noises.iter_mut().zip(&mut self.noise).zip(gain.chunks_exact(n)) {
                *noise = gain.iter().zip(&self.unseen).map(|(gain, error)| gain.abs() * error).sum();
                *largest = largest.max(*noise);
            }
        } else {
            for j in 0..n {
                let unseen = if is_planted(Fault::Noise) { 0.0 } else { self.unseen[j] };
                let asked = (0..m).map(|i| gain[i * n + j] * unseen);
                self.set.push((0..n).map(|_| 0.0).chain(asked));
            }
        }
        self.set.reach(&mut self.reach);
        self.is_bounded(v, &noises)
    }

    /// Checks that the inputs of the law, `others` more than the zonotope says, are within their bounds.
    fn is_bounded(&mut self, v: &[f64], others: &[f64]) -> Result<(), Failure> {
        let kept = self.dims[0] + self.late;
        for (i, (v, other)) in v.iter().zip(others).enumerate() {
            let share = (self.reach[kept + i] + other) * (1.0 + ROUND_OFF) * faults::part();
            self.lacks.feedback[i] = self.lacks.feedback[i].max(share);
            let over = (v + share - self.bounds.max[i]).max(self.bounds.min[i] - v + share);
            // NaN is not within bounds.
            if over > 0.0 || over.is_nan() {
                self.lacks.reserve[i] = self.lacks.reserve[i].max(over);
                self.lack(Failure::NoReserve { input: i, missing: over })?;
            }
        }
        Ok(())
    }

    /// Records a failure, or ends the check with it.
    fn lack(&mut self, failure: Failure) -> Result<(), Failure> {
        self.lacks.failure.get_or_insert(failure);
        if self.records { Ok(()) } else { Err(failure) }
    }

    /// Records that requirement `i` is not met, or ends the check with it.
    pub(super) fn lack_of(&mut self, i: usize, fall: f64, failure: Failure) -> Result<(), Failure> {
        self.lacks.falls[i] = self.lacks.falls[i].max(fall);
        if let Failure::Broken { time, slack, .. } = failure {
            self.lacks.missing[i] = self.lacks.missing[i].max(-slack);
            self.lacks.since[i] = self.lacks.since[i].min(time);
        }
        self.lack(failure)
    }

    /// Moves the tube along `piece`, of which `residual` says how far the state may be from the reference at its end.
    ///
    /// # Errors
    ///
    /// No bound is found; an input that leaves its bounds.
    pub(super) fn advance(
        &mut self,
        model: &dyn Predict,
        piece: Piece<'_>,
        residual: impl Fn(usize) -> f64,
    ) -> Result<(), Failure> {
        let Piece { path, over, dt, u } = piece;
        let ([n, m], kept) = (self.dims, self.dims[0] + self.late);
        let Self { of, set, before, late, noise, reach, moved, bulge, plant, rooms, gain, latest, .. } = self;
        let Rooms { variables, rates, at: here, slopes, curvatures, .. } = rooms;
        before.clone_from(set);
        rates.resize(n, Second::from(0.0));
        let evaluate = |variables: &[Second], out: &mut [Second]| {
            let (x, u) = variables.split_at(n);
            model.second_rates(x, u, out)
        };
        set.reach(reach);
        let held = self.held.min(dt);
        self.held -= held;
        if *latest == 0.0 && *late > 0 {
            self.lates.copy_from_slice(&reach[n..kept]);
        }
        let (lates, lefts) = (&mut self.lates, &self.lefts);
        // The first derivatives in the middle, and how far the reference is from there.
        here.clear();
        here.extend(path.iter().map(|c| Interval::from(at(c, 0.5 * dt))));
        here.extend(u.iter().map(|u| Interval::from(*u)));
        plant.slopes(here, (variables, rates), evaluate, slopes);
        let away: Vec<f64> = (0..n + m)
            .map(|i| match over.get(i) {
                Some(over) => (over[0].high - here[i].low).max(here[i].low - over[0].low),
                None => 0.0,
            })
            .collect();
        // In the mean it is nearer.
        let in_the_mean: Vec<f64> = (0..n + m)
            .map(|i| match path.get(i) {
                Some(path) => {
                    let far = (expansion::mean(path, dt) - here[i].value()).abs();
                    far * (1.0 + ROUND_OFF) + ROUND_OFF * size(over[i][0])
                }
                None => 0.0,
            })
            .collect();
        let slope = |i: usize, j: usize| slopes[i * (n + m) + j];
        // What arrives of an input differs from v by `part` of its deviation asked and of `mean` times its late one, by `fixed`,
        // and by at most `spread`; of its late deviation at most `changes` is not in the mean. Altogether by at most `most`.
        let arrives = |i: usize, differs: f64| {
            let [least, largest] = of.gains[i];
            let (part, mut half) = (0.5 * (least + largest), 0.5 * (largest - least) * (1.0 + 1e-15));
            if is_planted(Fault::Gain) && i == 0 {
                half = 0.0;
            }
            let (mean, around) = middle(of.remains_on_average(i, dt, held));
            let free = if is_planted(Fault::Freedom) { 0.0 } else { of.freedom[i] };
            let (late, apart) = (lates[i], noise[i] + differs + free);
            let (asked, fixed) = (reach[kept + i] + apart, (part - 1.0) * u[i]);
            let gained = half * (u[i].abs() + asked + late);
            // What follows late changes before it is asked anew, and so does what is left of earlier holds.
            let left = if of.lags[i][1] > 0.0 { late } else { lefts[i] };
            Arrives {
                apart: gained + part * (apart + left),
                part,
                mean,
                fixed,
                spread: gained + part * (around * late + apart),
                changes: part * late,
                most: (part * (asked + late) + fixed.abs() + gained) * (1.0 + ROUND_OFF),
            }
        };
        let linear =
            |i: usize, most: &[f64]| (0..n + m).map(|j| slope(i, j).value().abs() * most[j]).sum::<f64>();
        let recent = |i: usize| self.differs.iter().map(|differs| differs[i]).fold(self.arrives[i], f64::max);
        let mut differs: Vec<f64> = (0..m).map(recent).collect();
        let mut arriving: Vec<Arrives> = (0..m).map(|i| arrives(i, differs[i])).collect();
        // By how much an answer to a later state may differ from that to the state at the beginning of the hold: its rate there,
        // of which the zonotope knows how much the states and inputs cancel, and what changes that rate.
        let turns: Vec<f64> = (gain.chunks_exact(n))
            .map(|gain| {
                let along = |j: usize| (0..n).map(|l| gain[l] * slope(l, j).value()).sum::<f64>();
                let mut direction = vec![0.0; kept + m];
                (0..n).for_each(|j| direction[j] = along(j));
                for (j, input) in arriving.iter().enumerate() {
                    let by = along(n + j) * input.part;
                    direction[kept + j] = by;
                    // Until the next sample what was asked before acts.
                    direction[n..kept].iter_mut().skip(j).take(1).for_each(|late| *late = by);
                }
                let fixed: f64 =
                    arriving.iter().enumerate().map(|(j, input)| along(n + j) * input.fixed).sum();
                (fixed + zonotope::dot(&direction, &set.centre)).abs()
                    + set.half_width(&direction, &mut rooms.parts)
            })
            .collect();
        let answer = |i: usize, others: &[f64], moved: &[f64], arriving: &[Arrives]| {
            let Some(turn) = turns.get(i) else { return 0.0 };
            let changes = |j: usize| {
                let turned: f64 = (0..n).map(|l| slope(j, l).value().abs() * moved[l]).sum();
                let inputs: f64 = (arriving.iter().enumerate())
                    .map(|(q, input)| slope(j, n + q).value().abs() * input.apart)
                    .sum();
                gain[i * n + j].abs() * (turned + others[j] + inputs)
            };
            *latest * (turn + (0..n).map(changes).sum::<f64>()) * (1.0 + ROUND_OFF)
        };
        for i in 0..turns.len() {
            differs[i] = differs[i].max(AHEAD * answer(i, &of.rates, &vec![0.0; n], &arriving));
            arriving[i] = arrives(i, differs[i]);
        }
        // Bounds on the deviations while the piece lasts: guessed, and verified.
        let begin: Vec<f64> =
            (0..n + m).map(|i| if i < n { reach[i] } else { arriving[i - n].most }).collect();
        let mut most: Vec<f64> = begin.clone();
        for i in 0..n {
            most[i] = (begin[i] + dt * (linear(i, &begin) + of.rates[i])) * (1.0 + WIDER) + LEAST;
        }
        let mut others = vec![0.0; n];
        let mut is_found = false;
        for _ in 0..GUESSES {
            for i in 0..n + m {
                let around = if i < n { over[i][0] } else { here[i] };
                here[i] = Interval::new(
                    around.value() - radius(around) - most[i],
                    around.value() + radius(around) + most[i],
                );
            }
            plant.curvatures(here, (variables, rates), evaluate, curvatures);
            if is_planted(Fault::Remainder) {
                curvatures.fill(Interval::from(0.0));
            }
            for i in n..n + m {
                here[i] = Interval::from(u[i - n]);
            }
            for (i, others) in others.iter_mut().enumerate() {
                let wide: f64 = (0..n + m).map(|j| radius(slope(i, j)) * most[j]).sum();
                let bent: f64 = (plant.pairs.iter().zip(curvatures.chunks_exact(n)))
                    .map(|(pair, along)| {
                        let [fixed, spread] = product(*pair, &away, &most);
                        size(along[i]) * (fixed + spread)
                    })
                    .sum();
                *others = (wide + bent + of.rates[i] + residual(i) / dt) * (1.0 + ROUND_OFF);
            }
            let mut next = most.clone();
            is_found = true;
            for i in 0..n {
                moved[i] = dt * (linear(i, &most) + others[i]) * (1.0 + ROUND_OFF);
                let wanted = begin[i] + moved[i];
                is_found &= wanted <= most[i];
                next[i] = wanted * (1.0 + WIDER) + LEAST;
            }
            for (i, differs) in differs.iter_mut().enumerate().take(gain.len() / n) {
                let wanted = answer(i, &others, moved, &arriving);
                if wanted > *differs || wanted.is_nan() {
                    is_found = false;
                    *differs = wanted * AHEAD + LEAST;
                    arriving[i] = arrives(i, *differs);
                    next[n + i] = arriving[i].most;
                }
            }
            if is_found || !all_finite(&next) {
                break;
            }
            most = next;
        }
        if !is_found {
            return Err(Failure::Spreads);
        }
        let arrives = arriving;
        // The linear part over the piece: e^(M dt), and its integral times N.
        let drift: Vec<f64> = (0..n * n).map(|k| slope(k / n, k % n).value() * dt).collect();
        let [flow, integral] = exponential(&drift, n);
        let driven: Vec<f64> = (0..n * m)
            .map(|k| {
                let (i, j) = (k / m, k % m);
                let along: f64 = (0..n).map(|l| integral[i * n + l] * slope(l, n + j).value()).sum();
                along * dt * arrives[j].part
            })
            .collect();
        // What it leaves out: of all powers of M beyond, where |M| dt · most ≤ κ · most.
        let times = |x: &[f64]| -> Vec<f64> {
            drift.chunks_exact(n).map(|row| row.iter().zip(x).map(|(a, x)| a.abs() * x).sum()).collect()
        };
        let besides: Vec<f64> = (0..n)
            .map(|i| {
                let gains: f64 = (arrives.iter().enumerate())
                    .map(|(j, arrives)| slope(i, n + j).value().abs() * (arrives.spread + arrives.changes))
                    .sum();
                dt * (others[i] + gains)
            })
            .collect();
        // Constant inputs bend no line. A rate that is bounded takes one aside by half its length at most.
        for ((bulge, bent), besides) in bulge.iter_mut().zip(times(moved)).zip(&besides) {
            *bulge = (bent / 8.0 + besides / 2.0) * (1.0 + ROUND_OFF);
        }
        let kappa = times(&most[..n]).iter().zip(&most).map(|(moved, most)| moved / most).fold(0.0, f64::max);
        let first = times(&besides);
        let second = times(&first);
        let power = |k: i32| elementary::powi(kappa, k);
        // What is late counts half as much again in its middle as in the bound on the deviations.
        let more = if *late > 0 { 1.5 } else { 1.0 };
        let beyond = more * elementary::exp(kappa) * (power(5) / 120.0 + power(4) / 120.0 + power(3) / 24.0)
            + ROUND_OFF;
        let side = |i: usize| {
            let wide: f64 = (0..n + m).map(|j| radius(slope(i, j)) * most[j]).sum();
            let bent: f64 = (plant.pairs.iter().zip(curvatures.chunks_exact(n)))
                .map(|(pair, along)| {
                    let [fixed, spread] = product(*pair, &away, &most);
                    radius(along[i]) * (fixed + spread)
                })
                .sum();
            let spread = dt * (of.rates[i] + wide + bent) + residual(i);
            (spread + first[i] / 2.0 + second[i] / 6.0) * (1.0 + ROUND_OFF) + beyond * most[i]
        };
        let sides: Vec<f64> = (0..n).map(side).collect();
        // The centre moves by what is not symmetric besides.
        let shift = |i: usize| {
            let bent: f64 = (plant.pairs.iter().zip(curvatures.chunks_exact(n)))
                .map(|(pair, along)| along[i].value() * product(*pair, &away, &most)[0])
                .sum();
            let fixed: f64 = (0..m).map(|j| slope(i, n + j).value() * arrives[j].fixed).sum();
            bent + fixed
        };
        let shifts: Vec<f64> = (0..n).map(shift).collect();
        set.map(|i, j| match (i < n, j.checked_sub(n), j.checked_sub(kept)) {
            (true, None, _) => flow[i * n + j],
            (true, _, Some(input)) => driven[i * m + input],
            (true, Some(input), None) => driven[i * m + input] * arrives[input].mean,
            (false, Some(input), None) if i == j => middle(of.remains(input, dt, held)).0,
            _ => f64::from(i == j),
        });
        for (i, row) in integral.chunks_exact(n).enumerate() {
            set.centre[i] += zonotope::dot(row, &shifts) * dt;
        }
        for (pair, along) in plant.pairs.iter().zip(curvatures.chunks_exact(n)) {
            // A deviation is its value in the middle of the piece, and half of how far it moves.
            let changing = |of: usize| if of < n { 0.5 * moved[of] } else { most[of] };
            let first = |a: usize, b: usize| in_the_mean[a] * most[b] + away[a] * changing(b);
            let [a, b] = *pair;
            let spread = match a == b {
                true => first(a, a) + 0.25 * most[a] * most[a],
                false => first(a, b) + first(b, a) + most[a] * most[b],
            };
            set.push(along.iter().map(|along| along.value() * spread * dt));
        }
        for (j, Arrives { spread, .. }) in
            arrives.iter().enumerate().filter(|(_, arrives)| arrives.spread > 0.0)
        {
            set.push((0..n).map(|i| slope(i, n + j).value() * spread * dt));
        }
        for i in 0..*late {
            let remains = of.remains(i, dt, held);
            set.push_along(n + i, (middle(remains).1 * lates[i]) * (1.0 + ROUND_OFF));
        }
        for (i, side) in sides.iter().enumerate() {
            set.push_along(i, *side);
        }
        reach[..n].copy_from_slice(&most[..n]);
        self.widest.iter_mut().zip(&most).for_each(|(widest, most)| *widest = widest.max(*most));
        let answers: Vec<f64> = (0..m).map(|i| answer(i, &others, moved, &arrives)).collect();
        if self.delay > 0.0 {
            self.predict(model, piece, &most, residual);
        }
        if self.latest > 0.0 {
            self.note(u, &answers, (dt, held))?;
        }
        if all_finite(&sides) && all_finite(&self.set.centre) { Ok(()) } else { Err(Failure::Spreads) }
    }

    /// Remembers by how much `answers` of the last piece, which lasted `dt` s, may differ, and checks the inputs `u` again.
    fn note(&mut self, u: &[f64], answers: &[f64], (dt, held): (f64, f64)) -> Result<(), Failure> {
        for (i, answer) in answers.iter().enumerate() {
            let remains = self.of.remains(i, dt, held)[1];
            self.lates[i] *= remains;
            let [now, ..] = &mut self.differs;
            now[i] = now[i].max(answer * (1.0 + ROUND_OFF));
            // What arrives of them later is a mean of earlier ones.
            self.arrives[i] = now[i].max(self.arrives[i] * remains);
        }
        let others: Vec<f64> =
            self.noise.iter().zip(self.differs[0]).map(|(noise, now)| noise + now).collect();
        self.is_bounded(u, &others)
    }

    /// Bounds how far the state predicted over the delay until the end of `piece`, on which deviations are up to `most`, may be
    /// from the true one, piece by piece from the error of its measurement on.
    fn predict(
        &mut self,
        model: &dyn Predict,
        piece: Piece<'_>,
        most: &[f64],
        residual: impl Fn(usize) -> f64,
    ) {
        let ([n, m], kept) = (self.dims, self.dims[0] + self.late);
        let mut begin = self.errors();
        let Self {
            of,
            delay,
            latest,
            next_unseen,
            predicted,
            plant,
            rooms,
            lates,
            noise,
            reach,
            differs,
            ..
        } = self;
        // From the measurement until this piece.
        let dt = piece.dt.min(*delay);
        // A late sample may be predicted for any time of it.
        let (mut first, mut left) = (predicted.len(), if *latest > 0.0 { *delay } else { *delay - dt });
        while first > 0 && left > 0.0 {
            first -= 1;
            left -= predicted[first].dt;
        }
        predicted.drain(..first);
        for (k, before) in predicted.iter().enumerate() {
            begin = before.after(&begin, if k == 0 { before.dt + left.min(0.0) } else { before.dt });
        }
        let Rooms { variables, rates, at: here, slopes, .. } = rooms;
        let evaluate = |variables: &[Second], out: &mut [Second]| {
            let (x, u) = variables.split_at(n);
            model.second_rates(x, u, out)
        };
        // The prediction knows what was asked, not what arrived of it.
        let lost = |j: usize| {
            let [least, largest] = of.gains[j];
            let (late, apart) =
                (lates[j], noise[j] + differs.iter().map(|differs| differs[j]).fold(0.0, f64::max));
            let unknown = if of.lags[j][1] > 0.0 { 2.0 * apart + late } else { 0.0 };
            largest.max(1.0) * unknown
                + (1.0 - least).abs().max((largest - 1.0).abs())
                    * (piece.u[j].abs() + reach[kept + j] + apart + late)
        };
        // The prediction itself is resolved as a reference is.
        let mut own = Predicted {
            dt: piece.dt,
            slopes: vec![0.0; n * n],
            fixed: vec![0.0; n],
            residual: (0..n).map(residual).collect(),
            most: (0..n).map(|i| 2.0 * begin[i] + 2.0 * dt * of.rates[i] + LEAST).collect(),
        };
        for _ in 0..GUESSES {
            here.clear();
            here.extend((0..n + m).map(|i| match i < n {
                true => {
                    let wide = most[i] + own.most[i];
                    Interval::new(piece.over[i][0].low - wide, piece.over[i][0].high + wide)
                }
                false => Interval::new(
                    piece.u[i - n] - most[i] - lost(i - n),
                    piece.u[i - n] + most[i] + lost(i - n),
                ),
            }));
            plant.slopes(here, (variables, rates), evaluate, slopes);
            for i in 0..n {
                let slope = |j: usize| size(slopes[i * (n + m) + j]);
                (0..n).for_each(|j| own.slopes[i * n + j] = slope(j));
                own.fixed[i] = of.rates[i] + (0..m).map(|j| slope(n + j) * lost(j)).sum::<f64>();
            }
            let wanted = own.bound(&begin, &own.most, dt);
            if wanted.iter().zip(&own.most).all(|(wanted, most)| wanted <= most) {
                for (unseen, end) in next_unseen.iter_mut().zip(own.after(&begin, dt)) {
                    *unseen = if *latest > 0.0 { unseen.max(end) } else { end };
                }
                predicted.push_back(own);
                return;
            }
            own.most = wanted.iter().map(|wanted| AHEAD * wanted + LEAST).collect();
        }
        next_unseen.fill(f64::INFINITY);
    }
}

/// A piece over which a state is predicted. Its error, which begins with ε, obeys ε′ ≥ ε + dt (|M| ε′ + w + |N| (γ − 1) u)
/// wherever the predicted and the true state are.
struct Predicted {
    dt: f64,
    /// |M|, by rows, and what does not depend on the error; what the prediction itself leaves out.
    slopes: Vec<f64>,
    fixed: Vec<f64>,
    residual: Vec<f64>,
    /// The largest error for which these hold: that of a prediction from the earliest measurement.
    most: Vec<f64>,
}

impl Predicted {
    /// The error after the last `dt` s of the piece, if it is `begin` before and `most` at most.
    fn bound(&self, begin: &[f64], most: &[f64], dt: f64) -> Vec<f64> {
        let rows = self.slopes.chunks_exact(most.len());
        let after = rows.zip(&self.fixed).zip(begin.iter().zip(&self.residual));
        after
            .map(|((row, fixed), (begin, residual))| {
                (begin + residual + dt * (zonotope::dot(row, most) + fixed)) * (1.0 + ROUND_OFF)
            })
            .collect()
    }

    /// The same, if it is `begin` before: at most that of an earlier measurement.
    fn after(&self, begin: &[f64], dt: f64) -> Vec<f64> {
        (0..REFINED).fold(self.most.clone(), |most, _| self.bound(begin, &most, dt))
    }
}

/// How an input arrives on a piece ([`Tube::advance`]).
struct Arrives {
    part: f64,
    mean: f64,
    fixed: f64,
    spread: f64,
    changes: f64,
    most: f64,
    apart: f64,
}

/// The middle of two numbers, and half of what lies between them, rounded up.
fn middle([low, high]: [f64; 2]) -> (f64, f64) {
    (0.5 * (low + high), 0.5 * (high - low) * (1.0 + ROUND_OFF) + f64::EPSILON * high)
}

/// (2) on deviations up to `most`, for a reference up to `away` from where the derivatives are taken: its middle, and its
/// distance from there.
fn product([i, j]: [usize; 2], away: &[f64], most: &[f64]) -> [f64; 2] {
    match i == j {
        true => [0.25 * most[i] * most[i], away[i] * most[i] + 0.25 * most[i] * most[i]],
        false => [0.0, away[i] * most[j] + away[j] * most[i] + most[i] * most[j]],
    }
}

/// The series of e^A and of its mean (e^A − 1)/A to the fourth and third power, for a matrix with `n` rows.
fn exponential(a: &[f64], n: usize) -> [Vec<f64>; 2] {
    let identity: Vec<f64> = (0..n * n).map(|k| if k / n == k % n { 1.0 } else { 0.0 }).collect();
    let (mut power, mut flow, mut integral) = (identity.clone(), identity.clone(), identity);
    for k in 1..=4_u32 {
        // A^k / k!.
        let mut next = vec![0.0; n * n];
        for i in 0..n {
            for l in (0..n).filter(|l| power[i * n + l] != 0.0) {
                for j in 0..n {
                    next[i * n + j] += power[i * n + l] * a[l * n + j] / f64::from(k);
                }
            }
        }
        power = next;
        for (i, power) in power.iter().enumerate() {
            flow[i] += power;
            if k < 4 {
                integral[i] += power / f64::from(k + 1);
            }
        }
    }
    [flow, integral]
}
