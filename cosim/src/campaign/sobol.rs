//! Points of the Sobol sequence, each computed from its number alone, for up to [`DIMENSIONS`] dimensions.
//!
//! I. M. Sobol, *On the distribution of points in a cube and the approximate evaluation of integrals*, USSR
//! Comput. Math. Math. Phys. 7 (1967), with the direction numbers of S. Joe and F. Y. Kuo, *Constructing
//! Sobol sequences with better two-dimensional projections*, SIAM J. Sci. Comput. 30 (2008), doi
//! 10.1137/070709359 (file new-joe-kuo-6.21201). It is implemented here because the crates found stop at 2¹⁶
//! points or only give points in order.

/// The greatest number of dimensions.
pub(super) const DIMENSIONS: usize = PRIMITIVE.len() + 1;

/// Bits of a coordinate. There are 2³² points.
const BITS: usize = 32;

/// For each dimension but the first: the inner coefficients `a` of the primitive polynomial, as bits, and the
/// initial numbers `m`, as many as the degree.
const PRIMITIVE: [(u32, &[u32]); 20] = [
    (0, &[1]),
    (1, &[1, 3]),
    (1, &[1, 3, 1]),
    (2, &[1, 1, 1]),
    (1, &[1, 1, 3, 3]),
    (4, &[1, 3, 5, 13]),
    (2, &[1, 1, 5, 5, 17]),
    (4, &[1, 1, 5, 5, 5]),
    (7, &[1, 1, 7, 11, 19]),
    (11, &[1, 1, 5, 1, 1]),
    (13, &[1, 1, 1, 3, 11]),
    (14, &[1, 3, 5, 5, 31]),
    (1, &[1, 3, 3, 9, 7, 49]),
    (13, &[1, 1, 1, 15, 21, 21]),
    (16, &[1, 3, 1, 13, 27, 49]),
    (19, &[1, 1, 1, 15, 7, 5]),
    (22, &[1, 3, 1, 15, 13, 25]),
    (25, &[1, 1, 5, 5, 19, 61]),
    (1, &[1, 3, 7, 11, 23, 15, 103]),
    (4, &[1, 3, 7, 13, 13, 15, 69]),
];

/// The direction numbers of one dimension.
#[derive(Clone, Debug)]
pub(super) struct Sobol([u32; BITS]);

impl Sobol {
    /// The direction numbers of `dimension`, counted from 0; `None` beyond the table.
    pub(super) fn new(dimension: usize) -> Option<Self> {
        let mut v = [0; BITS];
        let Some(row) = dimension.checked_sub(1) else {
            for (i, v) in v.iter_mut().enumerate() {
                *v = 1 << (BITS - 1 - i);
            }
            return Some(Self(v));
        };
        let (a, m) = PRIMITIVE.get(row)?;
        let degree = m.len();
        for i in 0..BITS {
            v[i] = if i < degree {
                m[i] << (BITS - 1 - i)
            } else {
                // v_i = a_1 v_{i−1} ⊕ … ⊕ a_{s−1} v_{i−s+1} ⊕ v_{i−s} ⊕ (v_{i−s} / 2^s).
                (1..degree)
                    .filter(|k| a >> (degree - 1 - k) & 1 == 1)
                    .fold(v[i - degree] ^ (v[i - degree] >> degree), |sum, k| sum ^ v[i - k])
            };
        }
        Some(Self(v))
    }

    /// The coordinate of point `number` in units of 2⁻³²; only the lower 32 bits of the number count. The
    /// order is that of the definition, not of the Gray code: each block of 2^m points that begins at a
    /// multiple of 2^m is the same set.
    pub(super) fn coordinate(&self, number: u64) -> u32 {
        self.0.iter().enumerate().filter(|(i, _)| number >> i & 1 == 1).fold(0, |sum, (_, v)| sum ^ v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first 2¹² points have one coordinate in each interval of length 2⁻¹², in every dimension. The
    /// first two dimensions have one point in each elementary box of that volume (a (0, 2)-sequence in base
    /// 2).
    #[test]
    fn points_are_stratified() {
        const M: usize = 12;
        let all: Vec<Sobol> = (0..DIMENSIONS).map(|d| Sobol::new(d).unwrap()).collect();
        for (d, sobol) in all.iter().enumerate() {
            let mut seen = [false; 1 << M];
            (0..1 << M).for_each(|k| seen[(sobol.coordinate(k) >> (BITS - M)) as usize] = true);
            assert!(seen.iter().all(|s| *s), "dimension {d}");
        }
        for split in 0..=M {
            let part = |sobol: &Sobol, k: u64, bits: usize| {
                if bits == 0 { 0 } else { (sobol.coordinate(k) >> (BITS - bits)) as usize }
            };
            let mut seen = [false; 1 << M];
            for k in 0..1 << M {
                seen[part(&all[0], k, split) << (M - split) | part(&all[1], k, M - split)] = true;
            }
            assert!(seen.iter().all(|s| *s), "boxes of 2^-{split}");
        }
        assert!(Sobol::new(DIMENSIONS).is_none());
    }

    /// Points 5 and 4095 in units of 2^-12, as SciPy 1.17 gives them (unscrambled, with its Gray-code order
    /// undone).
    #[test]
    fn points_are_those_of_others() {
        let expected: [(u64, [u32; DIMENSIONS]); 2] = [
            (
                5,
                [
                    2560, 512, 3584, 2560, 2560, 3584, 512, 512, 512, 1536, 512, 2560, 512, 3584, 2560, 2560,
                    2560, 2560, 512, 1536, 1536,
                ],
            ),
            (
                4095,
                [
                    4095, 273, 11, 3327, 2937, 4057, 1303, 639, 1743, 3751, 3027, 3907, 3841, 2291, 1431,
                    1973, 3961, 765, 3957, 3701, 3731,
                ],
            ),
        ];
        for (number, point) in expected {
            for (d, coordinate) in point.iter().enumerate() {
                let found = Sobol::new(d).unwrap().coordinate(number);
                assert_eq!(found, coordinate << (BITS - 12), "point {number}, dimension {d}");
            }
        }
    }
}
