//! The change of the solution of a QP: one linear system.
//!
//! Where the active constraints aᵀu = b stay active, the conditions of optimality stay equations. Let everything they
//! are made of move along a direction, and let ϑ' be the change of the multipliers. Then
//!
//! ```text
//! N u' − Aᵀ ϑ' = c,   A u' = d,                                                            (7)
//! ```
//!
//! with the Hessian N of the Lagrangian, the change c of its gradient and the change d of the constraints, both at a
//! fixed u (`docs/theory.md#input-sensitivity`).

use nalgebra::{SMatrix, SVector};

use crate::MAX_INPUTS;
use crate::elementary::{self, dot};

/// The least sine of the angle between a normal and those before it.
const INDEPENDENT: f64 = 1e-7;

const SIZE: usize = 2 * MAX_INPUTS;

/// The equations (7), for one direction.
pub(crate) struct Equations {
    inputs: usize,
    rows: usize,
    /// The normals of these, made orthogonal one after the other, of length 1.
    held: [[f64; MAX_INPUTS]; MAX_INPUTS],
    matrix: SMatrix<f64, SIZE, SIZE>,
    right: SVector<f64, SIZE>,
}

impl Equations {
    /// The equations for the gradient u − r, where r moves along `direction`: N is the identity, and nothing is active.
    pub(crate) fn new(direction: &[f64]) -> Self {
        let mut right = SVector::<f64, SIZE>::zeros();
        right.as_mut_slice()[..direction.len()].copy_from_slice(direction);
        // Unused rows and columns stay those of the identity.
        let held = [[0.0; MAX_INPUTS]; MAX_INPUTS];
        Self { inputs: direction.len(), rows: 0, held, matrix: SMatrix::identity(), right }
    }

    /// Adds a part −ϑ a(u) of the gradient: `change` is the derivative of ϑ a at a fixed u, `curvature[i][j]` that
    /// of its component i by u_j.
    pub(crate) fn pull(&mut self, change: &[f64], curvature: &[[f64; MAX_INPUTS]; MAX_INPUTS]) {
        for i in 0..self.inputs {
            self.right[i] += change[i];
            for j in 0..self.inputs {
                self.matrix[(i, j)] -= curvature[i][j];
            }
        }
    }

    /// Adds an active constraint: u' along `normal` is `change`. One whose normal those before it make up is left out, and so
    /// is one of which there are more than inputs.
    pub(crate) fn hold(&mut self, normal: &[f64; MAX_INPUTS], change: f64) {
        let norm = elementary::sqrt(dot(normal, normal));
        let mut rest = normal.map(|component| component / norm);
        for held in &self.held[..self.rows] {
            let along = dot(held, &rest);
            rest.iter_mut().zip(held).for_each(|(rest, held)| *rest -= along * held);
        }
        let left = elementary::sqrt(dot(&rest, &rest));
        // NaN makes up nothing.
        if self.rows == self.inputs || left.is_nan() || left < INDEPENDENT {
            return;
        }
        self.held[self.rows] = rest.map(|component| component / left);
        let row = MAX_INPUTS + self.rows;
        for j in 0..self.inputs {
            let component = normal[j] / norm;
            self.matrix[(row, j)] = component;
            self.matrix[(j, row)] = -component;
        }
        self.matrix[(row, row)] = 0.0;
        self.right[row] = change / norm;
        self.rows += 1;
    }

    /// Writes u'; false where the equations do not determine it.
    #[must_use]
    pub(crate) fn solve(mut self, out: &mut [f64]) -> bool {
        let solved = self.matrix.lu().solve_mut(&mut self.right);
        out.copy_from_slice(&self.right.as_slice()[..self.inputs]);
        solved && self.right.iter().all(|v| v.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn normal(of: &[f64]) -> [f64; MAX_INPUTS] {
        let mut normal = [0.0; MAX_INPUTS];
        normal[..of.len()].copy_from_slice(of);
        normal
    }

    /// The nearest point of a line that turns, and of a circle that grows, in closed form.
    #[test]
    fn nearest_points_move_as_geometry_says() {
        // On (cos φ, sin φ)ᵀu = 1 from r = 0: u = (cos φ, sin φ), λ = 1; φ moves by 1 at φ = 0.
        let mut turning = Equations::new(&[0.0, 0.0]);
        turning.pull(&[0.0, 1.0], &[[0.0; MAX_INPUTS]; MAX_INPUTS]);
        turning.hold(&normal(&[1.0, 0.0]), 0.0);
        let mut u = [0.0; 2];
        assert!(turning.solve(&mut u));
        assert_eq!(u, [0.0, 1.0]);
        // On ½‖u‖² = ½ from r = (3, 0), which moves by (0, 1): u = r/‖r‖ moves by (0, ⅓). λ = −2.
        let mut circle = Equations::new(&[0.0, 1.0]);
        let mut curvature = [[0.0; MAX_INPUTS]; MAX_INPUTS];
        (curvature[0][0], curvature[1][1]) = (-2.0, -2.0);
        circle.pull(&[0.0, 0.0], &curvature);
        circle.hold(&normal(&[1.0, 0.0]), 0.0);
        assert!(circle.solve(&mut u));
        assert!((u[0]).abs() < 1e-15 && (u[1] - 1.0 / 3.0).abs() < 1e-15, "{u:?}");
    }

    #[test]
    fn dependent_constraints_are_left_out() {
        let mut equations = Equations::new(&[0.0, 1.0]);
        equations.hold(&normal(&[3.0, 3.0]), 6.0);
        equations.hold(&normal(&[2.0, 2.0]), 1.0);
        equations.hold(&normal(&[0.0; 2]), 1.0);
        let mut u = [0.0; 2];
        assert!(equations.solve(&mut u));
        // The point of u_1 + u_2 = 2 that is nearest to (0, 1).
        assert!((u[0] - 0.5).abs() < 1e-15 && (u[1] - 1.5).abs() < 1e-15, "{u:?}");
        let mut more = Equations::new(&[0.0]);
        more.hold(&normal(&[1.0]), 2.0);
        more.hold(&normal(&[1.0]), 3.0);
        let mut u = [0.0];
        assert!(more.solve(&mut u));
        assert_eq!(u, [2.0], "the first one");
    }
}
