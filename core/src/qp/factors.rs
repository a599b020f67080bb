//! The orthogonal factorisation N = Q R of the active normals: Q has orthonormal columns, R is upper
//! triangular.
//!
//! A column is appended by Gram-Schmidt, done twice: that keeps Q orthonormal to round-off for every
//! column that is not counted as dependent. One is removed by plane rotations of R's rows and Q's
//! columns. Only the first `len` columns mean anything, so restarting costs nothing. Arrays have N
//! components, of which those from `dim` on are 0.

use crate::elementary::{self, dot};

/// A normal whose part outside the span of the active ones is below this part of it depends on them.
const DEPENDENT: f64 = 1e-14;

#[derive(Clone, Copy)]
pub(super) struct Factors<const N: usize> {
    dim: usize,
    len: usize,
    /// The columns of Q.
    basis: [[f64; N]; N],
    /// The columns of R, each down to its diagonal.
    upper: [[f64; N]; N],
    /// One over the diagonal of R.
    inverse: [f64; N],
}

/// A normal against the active ones: a = Q d + z.
#[derive(Clone, Copy)]
pub(super) struct Projection<const N: usize> {
    /// d.
    pub(super) inside: [f64; N],
    /// z, orthogonal to the active normals; zero where a depends on them.
    pub(super) outside: [f64; N],
    /// ‖z‖².
    pub(super) square: f64,
}

impl<const N: usize> Factors<N> {
    pub(super) const EMPTY: Self =
        Self { dim: 0, len: 0, basis: [[0.0; N]; N], upper: [[0.0; N]; N], inverse: [0.0; N] };

    /// Removes all columns; new ones have `dim` components.
    pub(super) fn clear(&mut self, dim: usize) {
        (self.dim, self.len) = (dim, 0);
    }

    /// Splits `normal`, of length `norm`, into its parts inside and outside the span.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn project(&self, normal: &[f64; N], norm: f64) -> Projection<N> {
        let mut p = Projection { inside: [0.0; N], outside: *normal, square: norm * norm };
        if self.len == 0 {
            return p;
        }
        if self.len < self.dim {
            for pass in 0..2 {
                for (column, d) in self.basis[..self.len].iter().zip(&mut p.inside) {
                    let part = dot(column, &p.outside);
                    *d += part;
                    for (z, q) in p.outside.iter_mut().zip(column) {
                        *z -= part * q;
                    }
                }
                p.square = dot(&p.outside, &p.outside);
                // Nothing was cancelled: the second pass would change round-off only.
                if pass == 0 && p.square > 0.5 * norm * norm {
                    break;
                }
            }
            if p.square > (DEPENDENT * norm) * (DEPENDENT * norm) {
                return p;
            }
        } else {
            for (column, d) in self.basis[..self.len].iter().zip(&mut p.inside) {
                *d = dot(column, normal);
            }
        }
        p.outside = [0.0; N];
        p.square = 0.0;
        p
    }

    /// Appends the normal whose projection is `p`; its `square` is not 0.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn append(&mut self, p: &Projection<N>) {
        let k = self.len;
        let length = elementary::sqrt(p.square);
        self.upper[k][..k].copy_from_slice(&p.inside[..k]);
        self.upper[k][k] = length;
        let inverse = 1.0 / length;
        self.inverse[k] = inverse;
        for (q, z) in self.basis[k].iter_mut().zip(&p.outside) {
            *q = z * inverse;
        }
        self.len = k + 1;
    }

    /// Removes column `l`.
    pub(super) fn remove(&mut self, l: usize) {
        self.len -= 1;
        for k in l..self.len {
            self.upper[k] = self.upper[k + 1];
            // The rotation of rows k and k + 1 that makes R(k + 1, k) vanish.
            let (a, b) = (self.upper[k][k], self.upper[k][k + 1]);
            let length = elementary::hypot(a, b);
            let (c, s) = (a / length, b / length);
            self.upper[k][k] = length;
            self.inverse[k] = 1.0 / length;
            for j in k + 1..self.len {
                let column = &mut self.upper[j + 1];
                let (x, y) = (column[k], column[k + 1]);
                (column[k], column[k + 1]) = (c * x + s * y, c * y - s * x);
            }
            for i in 0..N {
                let (x, y) = (self.basis[k][i], self.basis[k + 1][i]);
                (self.basis[k][i], self.basis[k + 1][i]) = (c * x + s * y, c * y - s * x);
            }
        }
    }

    /// Solves R r = d in place.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn solve(&self, d: &mut [f64; N]) {
        for k in (0..self.len).rev() {
            d[k] *= self.inverse[k];
            for i in 0..k {
                d[i] -= self.upper[k][i] * d[k];
            }
        }
    }

    /// Solves Rᵀ y = c in place.
    pub(super) fn solve_transposed(&self, c: &mut [f64; N]) {
        for k in 0..self.len {
            c[k] = (c[k] - dot(&self.upper[k][..k], &c[..k])) * self.inverse[k];
        }
    }

    /// Component `i` of Q y.
    pub(super) fn component(&self, i: usize, y: &[f64; N]) -> f64 {
        self.basis[..self.len].iter().zip(y).map(|(q, y)| q[i] * y).sum()
    }
}
