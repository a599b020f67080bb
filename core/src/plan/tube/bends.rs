//! On what a function depends, and where it is curved: found once, over all numbers, so that the check of a tube asks for no
//! derivative that is known.

use alloc::vec;
use alloc::vec::Vec;

use crate::interval::Interval;
use crate::jet::Tangent;
use crate::lie::Second;
use crate::scalar::Scalar;

/// Largest width of a derivative over all numbers that counts as a constant, as a part of 1 plus its size: round-off.
const CONSTANT: f64 = 1e-12;

/// The derivatives of several numbers by several variables: which are constant, and which second ones are not 0.
#[derive(Clone, Debug, Default)]
pub(super) struct Bends {
    outputs: usize,
    variables: usize,
    /// The derivatives that are constant, by output and variable; anything for the variables in `bent`.
    constant: Vec<Interval>,
    /// The variables by which a derivative is not constant.
    pub(super) bent: Vec<usize>,
    /// The pairs of these whose second derivative is not 0.
    pub(super) pairs: Vec<[usize; 2]>,
}

impl Bends {
    /// `evaluate` writes the numbers for variables with derivatives along two directions, and returns whether it did.
    /// `None` if it did not.
    pub(super) fn of(
        outputs: usize,
        variables: usize,
        mut evaluate: impl FnMut(&[Second], &mut [Second]) -> bool,
    ) -> Option<Self> {
        let (all, mut out) = (vec![Interval::ALL; variables], vec![Second::from(0.0); outputs]);
        let mut found = Self {
            outputs,
            variables,
            constant: vec![Interval::ALL; outputs * variables],
            ..Self::default()
        };
        for variable in 0..variables {
            if !evaluate(&directed(&all, [variable, variable]), &mut out) {
                return None;
            }
            let is_constant = |slope: Interval| {
                size(slope).is_finite() && slope.high - slope.low <= CONSTANT * (1.0 + slope.low.abs())
            };
            let mut is_bent = false;
            for (i, out) in out.iter().enumerate() {
                let slope = out.directional.value;
                is_bent |= !is_constant(slope);
                found.constant[i * variables + variable] = slope;
            }
            if is_bent {
                found.bent.push(variable);
            }
        }
        for (k, &i) in found.bent.iter().enumerate() {
            for &j in &found.bent[k..] {
                evaluate(&directed(&all, [i, j]), &mut out);
                if out.iter().any(|out| out.directional.directional != Interval::from(0.0)) {
                    found.pairs.push([i, j]);
                }
            }
        }
        Some(found)
    }

    /// Writes the first derivatives, by output and variable, for variables within `at`.
    pub(super) fn slopes(
        &self,
        at: &[Interval],
        (variables, out): (&mut Vec<Second>, &mut [Second]),
        mut evaluate: impl FnMut(&[Second], &mut [Second]) -> bool,
        slopes: &mut Vec<Interval>,
    ) {
        slopes.clear();
        slopes.extend_from_slice(&self.constant);
        for pair in self.bent.chunks(2) {
            let (i, j) = (pair[0], pair[pair.len() - 1]);
            direct(at, [i, j], variables);
            evaluate(variables, out);
            for (row, out) in out.iter().enumerate().take(self.outputs) {
                slopes[row * self.variables + i] = out.directional.value;
                slopes[row * self.variables + j] = out.value.directional;
            }
        }
    }

    /// Writes the second derivatives, by pair and output, for variables within `at`.
    pub(super) fn curvatures(
        &self,
        at: &[Interval],
        (variables, out): (&mut Vec<Second>, &mut [Second]),
        mut evaluate: impl FnMut(&[Second], &mut [Second]) -> bool,
        curvatures: &mut Vec<Interval>,
    ) {
        curvatures.clear();
        for pair in &self.pairs {
            direct(at, *pair, variables);
            evaluate(variables, out);
            curvatures.extend(out.iter().take(self.outputs).map(|out| out.directional.directional));
        }
    }
}

/// Variables within `at`, with derivatives along the two `directions`.
fn directed(at: &[Interval], directions: [usize; 2]) -> Vec<Second> {
    let mut variables = Vec::new();
    direct(at, directions, &mut variables);
    variables
}

fn direct(at: &[Interval], [i, j]: [usize; 2], variables: &mut Vec<Second>) {
    let along = |is_along: bool| Interval::from(if is_along { 1.0 } else { 0.0 });
    variables.clear();
    variables.extend(at.iter().enumerate().map(|(k, at)| Second {
        value: Tangent { value: *at, directional: along(k == j) },
        directional: Tangent { value: along(k == i), directional: Interval::from(0.0) },
    }));
}

/// Half the width of an interval, rounded up, around the [middle](Scalar::value).
pub(super) fn radius(interval: Interval) -> f64 {
    let middle = interval.value();
    let half = (interval.high - middle).max(middle - interval.low);
    half + f64::EPSILON * half.abs()
}

/// The largest size of its numbers.
pub(super) fn size(interval: Interval) -> f64 {
    interval.high.abs().max(interval.low.abs())
}
