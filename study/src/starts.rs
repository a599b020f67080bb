//! Random initial conditions.

/// The hundred starts of every table, uniform in the box of [`drawn`], in the order of each model's states.
const HUNDRED: &str = include_str!("../../tests/data/starts100.csv");

/// The first `count` of the hundred starts of the tables.
pub fn hundred(count: usize) -> Vec<[f64; 4]> {
    let rows = HUNDRED.lines().skip(1).map(|line| {
        let mut row = [0.0; 4];
        // The file is part of the program, and a test reads all of it.
        for (value, text) in row.iter_mut().zip(line.split(',')) {
            *value = text.parse().unwrap_or(f64::NAN);
        }
        row
    });
    rows.take(count).collect()
}

/// Numbers in [0, 1): the upper 53 bits of each output of SplitMix64 (G. L. Steele, D. Lea and C. H. Flood, *Fast
/// splittable pseudorandom number generators*, OOPSLA 2014) with the state `seed`, over 2⁵³.
pub fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// `count` starts drawn from `seed` by [`uniform`], four numbers each: uniform in
/// [0, 20] × [0, 20] × [−10, 10] × [−10, 10].
pub fn drawn(seed: u64, count: usize) -> Vec<[f64; 4]> {
    let mut uniform = uniform(seed);
    let mut start = || [0.0, 0.0, -10.0, -10.0].map(|low| low + 20.0 * uniform());
    (0..count).map(|_| start()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_starts_are_in_the_box() {
        assert_eq!(hundred(1000).len(), 100);
        for start in hundred(100).into_iter().chain(drawn(7, 100)) {
            let inside = |v: f64, low: f64| (low..=low + 20.0).contains(&v);
            assert!(inside(start[0], 0.0) && inside(start[1], 0.0), "{start:?}");
            assert!(inside(start[2], -10.0) && inside(start[3], -10.0), "{start:?}");
        }
        // The first output of the generator from 0 is published: 0xe220a8397b1dcdaf.
        let first = (0xe220_a839_7b1d_cdaf_u64 >> 11) as f64 / (1_u64 << 53) as f64;
        assert_eq!(drawn(0, 1)[0][0], 20.0 * first);
        assert_ne!(drawn(1, 1), drawn(2, 1));
    }
}
