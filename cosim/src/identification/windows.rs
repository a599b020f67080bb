//! What is left of a recording over windows of one hold up to some seconds, and what errors, rates and gains may contribute.
//!
//! Over the window of holds k to l the linear model of [`super::linear`] leaves R = e_l − P e_k + Σ_s P_s ∫w, with P and P_s products
//! of Jacobians. If measurements are off by at most ε, rates by w and gains by γ, by component, then
//!
//! |R_i| ≤ ε_i + Σ_j |P_ij| ε_j + Σ_j W_ij w_j + Σ_j B_ij γ_j,
//!
//! where W and B sum what a rate and a gain add in each hold. Noise adds the same over every window, a rate more over a longer one:
//! that tells them apart.

use super::linear::Linear;

/// Blocks of a level that one of the next level has, and the longest window of a level in blocks.
const BLOCKS: usize = 8;
/// Levels of windows end with the one whose blocks are this long: in s, and in holds where these are long.
const REACH: (f64, usize) = (1.0, 16);

/// A time over which the model is linear.
#[derive(Clone)]
struct Block {
    first: usize,
    holds: usize,
    time: f64,
    length: f64,
    episode: usize,
    residual: Vec<f64>,
    jacobian: Vec<f64>,
    rates: Vec<f64>,
    gains: Vec<f64>,
    covered: Vec<f64>,
}

/// The condition that one state over one window makes: `coefficients` · sizes ≥ `size`.
#[derive(Clone, Debug)]
pub(super) struct Condition {
    /// How many holds there are.
    pub(super) holds: usize,
    /// When it begins, in s.
    pub(super) time: f64,
    /// The state.
    pub(super) state: usize,
    /// What is left and not covered.
    pub(super) size: f64,
    /// Of errors, rates and gains, by state, state and input.
    pub(super) coefficients: Vec<f64>,
}

/// The windows of a recording, on several levels.
pub(super) struct Windows {
    states: usize,
    inputs: usize,
    levels: Vec<Vec<Block>>,
}

impl Windows {
    /// Those of `linear`. Of it `effects` are what the inputs do by themselves, by hold, input and state; `covered` is the size of what is
    /// explained anyway, by hold and state.
    pub(super) fn new(linear: &Linear, effects: &[f64], covered: &[f64]) -> Self {
        let (n, m) = (linear.states, linear.inputs);
        let of_hold = |(k, hold): (usize, &super::linear::Hold)| {
            // ∫|A(s)| over the hold, by the trapezoidal rule.
            let mut rates: Vec<f64> = hold.jacobian.iter().map(|a| 0.5 * hold.length * a.abs()).collect();
            (0..n).for_each(|i| rates[i * n + i] += 0.5 * hold.length);
            let mut gains = vec![0.0; n * m];
            for j in 0..m {
                for i in 0..n {
                    gains[i * m + j] = effects[(k * m + j) * n + i].abs();
                }
            }
            Block {
                first: k,
                holds: 1,
                time: hold.time,
                length: hold.length,
                episode: hold.episode,
                residual: hold.residual.clone(),
                jacobian: hold.jacobian.clone(),
                rates,
                gains,
                covered: covered[k * n..(k + 1) * n].to_vec(),
            }
        };
        let mut windows = Self {
            states: n,
            inputs: m,
            levels: vec![linear.holds.iter().enumerate().map(of_hold).collect()],
        };
        let all = linear.holds.len();
        while let Some(level) = windows.levels.last() {
            let Some(block) = level.first() else { break };
            let (holds, length) = (block.holds * BLOCKS, block.length * BLOCKS as f64);
            if (length >= REACH.0 && holds >= REACH.1) || holds * 4 > all {
                break;
            }
            let whole = |part: &&[Block]| {
                part.len() == BLOCKS
                    && part[0].episode == part[BLOCKS - 1].episode
                    && part.iter().all(|b| b.holds == block.holds)
            };
            let mut next = Vec::new();
            let mut at = 0;
            // Blocks do not reach over the end of an episode.
            while at < level.len() {
                let part = &level[at..(at + BLOCKS).min(level.len())];
                if whole(&part) {
                    next.push(windows.joined(part));
                    at += BLOCKS;
                } else {
                    at += 1;
                }
            }
            if next.is_empty() {
                break;
            }
            windows.levels.push(next);
        }
        windows
    }

    /// The number of states.
    pub(super) fn states(&self) -> usize {
        self.states
    }

    /// The blocks as one.
    fn joined(&self, part: &[Block]) -> Block {
        let mut whole = part[part.len() - 1].clone();
        let mut product = whole.jacobian.clone();
        for block in part[..part.len() - 1].iter().rev() {
            self.extend(&mut whole, &mut product, block);
        }
        whole.jacobian = product;
        whole
    }

    /// Extends `whole` to begin with `block`; `product` is that of its Jacobians.
    fn extend(&self, whole: &mut Block, product: &mut Vec<f64>, block: &Block) {
        let (n, m) = (self.states, self.inputs);
        for i in 0..n {
            let row = &product[i * n..(i + 1) * n];
            whole.residual[i] += row.iter().zip(&block.residual).map(|(p, r)| p * r).sum::<f64>();
            whole.covered[i] += row.iter().zip(&block.covered).map(|(p, c)| p.abs() * c).sum::<f64>();
            for j in 0..n {
                whole.rates[i * n + j] += (0..n).map(|l| row[l].abs() * block.rates[l * n + j]).sum::<f64>();
            }
            for j in 0..m {
                whole.gains[i * m + j] += (0..n).map(|l| row[l].abs() * block.gains[l * m + j]).sum::<f64>();
            }
        }
        let entry =
            |at: usize| (0..n).map(|l| product[at / n * n + l] * block.jacobian[l * n + at % n]).sum();
        *product = (0..n * n).map(entry).collect();
        whole.first = block.first;
        whole.holds += block.holds;
        whole.length += block.length;
        whole.time = block.time;
    }

    /// Shows every condition to `see`, except those of windows with a hold that is `left_out`.
    pub(super) fn each(&self, left_out: &[bool], mut see: impl FnMut(&Condition)) {
        let n = self.states;
        // How many holds are left out before each.
        let mut before = vec![0; left_out.len() + 1];
        for (k, out) in left_out.iter().enumerate() {
            before[k + 1] = before[k] + usize::from(*out);
        }
        for (depth, level) in self.levels.iter().enumerate() {
            for (end, last) in level.iter().enumerate() {
                let mut whole = last.clone();
                let mut product = last.jacobian.clone();
                for count in 1..=BLOCKS {
                    if count > 1 {
                        let Some(block) = end.checked_sub(count - 1).map(|at| &level[at]) else { break };
                        let is_next =
                            block.episode == whole.episode && block.first + block.holds == whole.first;
                        if !is_next {
                            break;
                        }
                        self.extend(&mut whole, &mut product, block);
                    }
                    // A single block of a higher level is a window of the one below.
                    let is_out = before.get(whole.first + whole.holds).unwrap_or(&0) > &before[whole.first];
                    if is_out || (depth > 0 && count == 1) {
                        continue;
                    }
                    for state in 0..n {
                        let mut coefficients: Vec<f64> =
                            product[state * n..(state + 1) * n].iter().map(|p| p.abs()).collect();
                        coefficients[state] += 1.0;
                        coefficients.extend(&whole.rates[state * n..(state + 1) * n]);
                        coefficients.extend(&whole.gains[state * self.inputs..(state + 1) * self.inputs]);
                        see(&Condition {
                            holds: whole.holds,
                            time: whole.time,
                            state,
                            size: (whole.residual[state].abs() - whole.covered[state]).max(0.0),
                            coefficients,
                        });
                    }
                }
            }
        }
    }
}
