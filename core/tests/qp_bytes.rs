//! The quadratic program on arbitrary bytes: every pattern of 64 bits may become a number.
//! `PUNCTUAL_QP_CASES` is the number of QPs, a few thousand by default. No fuzzing engine is needed: the bytes
//! come from the test's own generator.

#![allow(clippy::print_stdout, reason = "the figures are read from the output")]

use crate::quadratic;

use punctual_core::qp::{Bounds, Enforcement, Outcome, Problem, Row, Workspace};
use punctual_core::{MAX_INPUTS, MAX_ROWS};
use quadratic::random::Random;

/// A finite number from a byte that says how and eight more.
fn number(random: &mut Random) -> f64 {
    let bits = random.bits();
    let value = match random.below(8) {
        0 => f64::from_bits(bits),
        1 => 0.0,
        2 => (bits % 7) as f64 - 3.0,
        3 => f64::from_bits(bits & !(0x7ff << 52) | (random.below(2047) as u64) << 52),
        4 => 2_f64.powi(random.below(60) as i32 - 30),
        _ => (bits >> 11) as f64 / (1_u64 << 50) as f64 - 4.0,
    };
    if value.is_finite() { value.clamp(-1e300, 1e300) } else { 1.0 }
}

#[test]
fn any_bytes_give_a_finite_input_within_bounds() {
    let count = std::env::var("PUNCTUAL_QP_CASES").map_or(2000, |n| n.parse().expect("a number"));
    let mut random = Random::new(64);
    let mut workspace = Workspace::default();
    let mut failed = 0;
    for case in 0..count {
        let m = 1 + random.below(MAX_INPUTS);
        let mut count = 1 + random.below(6);
        if random.below(16) == 0 {
            count = 1 + random.below(MAX_ROWS);
        }
        // Some programs are of moderate numbers only, some repeat their rows.
        let tame = random.below(2) == 0;
        let number = |random: &mut Random| if tame { random.within(8.0).round() } else { number(random) };
        let mut rows = vec![Row::ZERO; count];
        for k in 0..count {
            if k > 0 && random.below(4) == 0 {
                rows[k] = rows[random.below(k)];
                let factor = [1.0, -1.0, 3.0, 0.1][random.below(4)];
                rows[k].normal.iter_mut().for_each(|a| *a *= factor);
                rows[k].floor *= factor;
            } else {
                (0..m).for_each(|i| rows[k].normal[i] = number(&mut random));
                rows[k].floor = number(&mut random);
            }
            if !rows[k].normal.iter().chain([&rows[k].floor]).all(|v| v.is_finite()) {
                rows[k] = Row::ZERO;
            }
        }
        let mut bounds = Bounds::NONE;
        for i in 0..m {
            let (a, b) = (number(&mut random), number(&mut random));
            match random.below(4) {
                0 => {}
                1 => bounds.min[i] = a,
                2 => bounds.max[i] = a,
                _ => (bounds.min[i], bounds.max[i]) = (a.min(b), a.max(b)),
            }
        }
        let u_ref: Vec<f64> = (0..m).map(|_| number(&mut random)).collect();
        let enforcement: Vec<Enforcement> = (0..random.below(count + 1))
            .map(|_| match random.below(3) {
                0 => Enforcement::Soft { penalty: random.within(4.0).abs() + 1e-3 },
                priority => Enforcement::Hard { priority: priority as u32 },
            })
            .collect();
        let weights: Vec<f64> = (0..m).map(|_| 2_f64.powi(random.below(21) as i32 - 10)).collect();
        let p = Problem {
            weights: (random.below(3) == 0).then_some(&weights),
            enforcement: &enforcement,
            ..Problem::new(&rows, &bounds, &u_ref, 1e6)
        };
        let mut u = vec![f64::NAN; m];
        let solution = workspace.solve(&p, &mut u);
        assert!(u.iter().all(|v| v.is_finite()), "{case}: {u:?} {solution:?} {p:?}");
        assert!(bounds.contain(&u), "{case}: {u:?} {solution:?} {p:?}");
        assert!(!tame || solution.outcome != Outcome::Failed, "{case}: {solution:?} {p:?}");
        failed += u64::from(solution.outcome == Outcome::Failed);
        if tame && solution.outcome == Outcome::Optimal {
            let soft = |k: &usize| matches!(enforcement.get(*k), Some(Enforcement::Soft { .. }));
            for k in (0..count).filter(|k| !soft(k)) {
                let size: f64 = u.iter().chain(&u_ref).map(|v| v.abs()).sum::<f64>() + 8.0;
                assert!(rows[k].slack(&u) >= -1e-11 * size, "{case}: row {k} {:e} {p:?}", rows[k].slack(&u));
            }
            let residuals = workspace.residuals(&p, &u);
            let optimal = residuals.stationarity.max(residuals.complementarity) <= 1e-9;
            assert!(optimal && residuals.negativity <= 1e-9, "{case}: {residuals:?} {p:?}");
        }
        // The same again: from a new workspace, and from one whose last answer it was.
        let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        for workspace in [&mut Workspace::default(), &mut workspace] {
            let mut again = vec![0.5; m];
            let other = workspace.solve(&p, &mut again);
            assert_eq!((other.outcome, other.solver), (solution.outcome, solution.solver), "{case}");
            assert_eq!(bits(&again), bits(&u), "{case}");
        }
    }
    println!("{failed} of {count} programs without convergence");
}
