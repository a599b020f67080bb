//! Backup plans for plants given by expressions: what is accepted is kept whatever u_ref is, as judged by a
//! separate integrator.

#![expect(clippy::print_stdout, reason = "the figures of the search")]

use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder, Sampling};
use punctual_core::lie::RelativeDegree;
use punctual_models::Model;

/// Random numbers that are the same on every machine.
struct Random(u64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// ẋ at x and u.
type Rate<'a> = dyn Fn(&[f64], &[f64]) -> Vec<f64> + 'a;

/// A plant in two forms: as expressions, and as code for the judge.
struct Case<'a> {
    period: f64,
    deadline: f64,
    /// Number of states.
    states: usize,
    model: Model,
    /// h, its relative degree, and whether it has the deadline.
    barriers: &'a [(&'a str, usize, bool)],
    bounds: &'a [[f64; 2]],
    rate: &'a Rate<'a>,
    /// The same h.
    h: &'a dyn Fn(&[f64]) -> Vec<f64>,
}

impl Case<'_> {
    fn filter(&self) -> Filter {
        let [min, max] = [0, 1].map(|side| self.bounds.iter().map(|b| b[side]).collect::<Vec<f64>>());
        let mut builder = Filter::from_sources(self.states, self.bounds.len());
        for (k, (expression, n, is_goal)) in self.barriers.iter().enumerate() {
            let settings =
                if *is_goal { BarrierSettings::within(self.deadline) } else { BarrierSettings::keeping() };
            let source = self.model.barrier(expression).and_then(|b| b.source(*n)).expect("a barrier");
            builder = builder.source(&k.to_string(), source, settings).expect("valid settings");
        }
        let filter = builder
            .bounds(&min, &max)
            .and_then(|b| b.sampling(Sampling::Period(self.period)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        filter.with_plans(self.period).expect("a filter that can be assured")
    }

    fn move_by(&self, x: &mut [f64], u: &[f64], dt: f64) {
        let at = |k: &[f64], s: f64| x.iter().zip(k).map(|(x, k)| x + s * k).collect::<Vec<f64>>();
        let a = (self.rate)(x, u);
        let b = (self.rate)(&at(&a, dt / 2.0), u);
        let c = (self.rate)(&at(&b, dt / 2.0), u);
        let d = (self.rate)(&at(&c, dt), u);
        for i in 0..x.len() {
            x[i] += dt / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
        }
    }

    /// Whether a plan is found from `x`. If so, asserts that the promises are kept until `more` s after the
    /// deadline, with the input `wanted`.
    fn is_kept(&self, x: &[f64], more: f64, mut wanted: impl FnMut(f64, &[f64]) -> Vec<f64>) -> bool {
        const PARTS: u32 = 20;
        let (mut filter, mut x, mut u) = (self.filter(), x.to_vec(), vec![0.0; self.bounds.len()]);
        for k in 0..((self.deadline + more) / self.period) as u32 {
            let t = f64::from(k) * self.period;
            let assurance = filter
                .step(t, &x, &wanted(t, &x), &mut u)
                .expect("right dimensions")
                .assurance
                .expect("plans");
            if k == 0 && !assurance.is_assured() {
                return false;
            }
            assert!(assurance.is_assured(), "{t}: {assurance:?}");
            assert!(u.iter().zip(self.bounds).all(|(u, b)| (b[0]..=b[1]).contains(u)), "{t}: {u:?}");
            for part in 1..=PARTS {
                self.move_by(&mut x, &u, self.period / f64::from(PARTS));
                let t = t + self.period * f64::from(part) / f64::from(PARTS);
                for (h, (name, _, is_goal)) in (self.h)(&x).iter().zip(self.barriers) {
                    assert!(*h >= 0.0 || (*is_goal && t < self.deadline), "{t}: {name} = {h} at {x:?}");
                }
            }
        }
        true
    }
}

const LENGTH: f64 = 0.5;
const GRAVITY: f64 = 9.81;

/// A cart of 1 kg with an upright pole of `mass`, states x, theta, v, omega; within 0.2 m of `target` by the
/// `deadline`.
fn cart_pole<R>([mass, deadline, target, force]: [f64; 4], judge: impl FnOnce(&Case<'_>) -> R) -> R {
    let acc = "(f + m * sin(theta) * (l * omega^2 - g * cos(theta))) / (1 + m * sin(theta)^2)";
    let alpha = format!("(g * sin(theta) - cos(theta) * {acc}) / l");
    let parameters = [("m", mass), ("l", LENGTH), ("g", GRAVITY), ("d", target)];
    let model = Model::new(&["x", "theta", "v", "omega"], &["f"], &parameters, &["v", "omega", acc, &alpha])
        .expect("a model");
    judge(&Case {
        period: 0.02,
        deadline,
        states: 4,
        model,
        barriers: &[("0.2^2 - (x - d)^2", 2, true), ("theta + 0.5", 2, false), ("0.5 - theta", 2, false)],
        bounds: &[[-force, force]],
        rate: &|x, u| {
            // The exact equations of motion, solved for the accelerations; the pole's mass is a point at its
            // end.
            let (sin, cos) = x[1].sin_cos();
            let [[a, b], [c, d]] = [[1.0 + mass, mass * LENGTH * cos], [cos, LENGTH]];
            let [p, q] = [u[0] + mass * LENGTH * x[3] * x[3] * sin, GRAVITY * sin];
            let det = a * d - b * c;
            vec![x[2], x[3], (p * d - b * q) / det, (a * q - c * p) / det]
        },
        h: &|x| vec![0.2 - (x[0] - target).abs(), x[1] + 0.5, 0.5 - x[1]],
    })
}

#[test]
fn a_cart_with_a_pole_gets_there_in_time_and_the_pole_stays_up() {
    cart_pole([0.2, 3.0, 2.0, 40.0], |case| {
        for push in [0.0, 60.0, -60.0] {
            assert!(case.is_kept(&[0.0; 4], 2.0, |_, _| vec![push]), "{push} N: refused");
        }
    });
}

/// Starts around the equilibrium, with all kinds of pushes; also other poles, deadlines, targets and bounds.
#[test]
fn a_cart_with_a_pole_is_promised_only_what_is_kept() {
    let starts = if std::env::var_os("PUNCTUAL_TABLES").is_some() { 100 } else { 3 };
    for around in [false, true] {
        let mut accepted = 0;
        for seed in 1..=starts {
            let random = &mut Random(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed));
            let mut draw = |low: f64, high: f64| random.between(low, high);
            let numbers = match around {
                false => [0.2, 3.0, 2.0, 40.0],
                true => [draw(0.1, 0.3), draw(2.0, 5.0), draw(1.0, 3.0), draw(20.0, 60.0)],
            };
            let x = [draw(-0.3, 0.3), draw(-0.1, 0.1), draw(-0.2, 0.2), draw(-0.2, 0.2)];
            let force = numbers[3];
            let is_kept = cart_pole(numbers, |case| {
                case.is_kept(&x, 2.0, |t, x| {
                    vec![match seed % 5 {
                        0 => random.between(-force, force),
                        1 => 2.0 * force,
                        2 => -2.0 * force,
                        3 => {
                            if t % 1.0 < 0.5 {
                                force
                            } else {
                                -force
                            }
                        }
                        // Tries to make the pole fall.
                        _ => -force * x[1].signum(),
                    }]
                })
            });
            accepted += u64::from(is_kept);
        }
        println!("cart and pole, others {around}: {accepted} of {starts} accepted and kept");
        assert!(100 * accepted >= 95 * starts, "{accepted} of {starts} accepted");
    }
}

/// A quadrotor in a vertical plane with thrust and torque as inputs: 1 kg, 0.05 kg m². It must be within 0.3
/// m of a target by the `deadline`, above 0.5 m, below 6 m, and tilted by at most 1 rad. The thrust enters
/// the second derivative of the distance, the torque the fourth.
fn quadrotor<R>([x, z, deadline, thrust]: [f64; 4], judge: impl FnOnce(&Case<'_>) -> R) -> R {
    const INERTIA: f64 = 0.05;
    let states = ["x", "z", "theta", "v", "w", "omega"];
    let derivatives = ["v", "w", "omega", "f * sin(theta)", "f * cos(theta) - g", "tau / i"];
    let parameters = [("g", GRAVITY), ("i", INERTIA), ("a", x), ("b", z)];
    let model = Model::new(&states, &["f", "tau"], &parameters, &derivatives).expect("a model");
    let goal = "0.3 - sqrt((x - a)^2 + (z - b)^2 + 1e-4)";
    let free = [[f64::NEG_INFINITY, f64::INFINITY]; 6];
    let driven = model.barrier(goal).expect("a barrier").driven_degree(&free);
    assert_eq!(driven, RelativeDegree::Mixed(vec![Some(2), Some(4)]));
    judge(&Case {
        period: 0.02,
        deadline,
        states: 6,
        model,
        barriers: &[(goal, 2, true), ("z - 0.5", 2, false), ("6 - z", 2, false), ("1 - theta^2", 2, false)],
        bounds: &[[0.0, thrust], [-2.0, 2.0]],
        rate: &|x, u| {
            let (sin, cos) = x[2].sin_cos();
            vec![x[3], x[4], x[5], u[0] * sin, u[0] * cos - GRAVITY, u[1] / INERTIA]
        },
        h: &|at| {
            let distance = ((at[0] - x).powi(2) + (at[1] - z).powi(2) + 1e-4).sqrt();
            vec![0.3 - distance, at[1] - 0.5, 6.0 - at[1], 1.0 - at[2] * at[2]]
        },
    })
}

#[test]
fn a_quadrotor_with_thrust_and_torque_is_promised_only_what_is_kept() {
    let starts = if std::env::var_os("PUNCTUAL_TABLES").is_some() { 100 } else { 5 };
    let mut accepted = 0;
    for seed in 1..=starts {
        let random = &mut Random(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed));
        let mut draw = |low: f64, high: f64| random.between(low, high);
        let numbers = [draw(-5.0, 5.0), draw(1.0, 5.0), draw(2.5, 6.0), draw(15.0, 30.0)];
        let x = [0.0, draw(1.0, 5.0), draw(-0.3, 0.3), draw(-0.5, 0.5), draw(-0.5, 0.5), draw(-0.3, 0.3)];
        let is_kept = quadrotor(numbers, |case| {
            case.is_kept(&x, 2.0, |_, x| match seed % 5 {
                0 => vec![random.between(0.0, 30.0), random.between(-2.0, 2.0)],
                // No input: it falls.
                1 => vec![0.0, 0.0],
                2 => vec![40.0, 4.0],
                // Tries to turn it over.
                3 => vec![numbers[3], 2.0 * x[2].signum()],
                _ => vec![GRAVITY, 0.0],
            })
        });
        accepted += u64::from(is_kept);
    }
    println!("quadrotor: {accepted} of {starts} accepted and kept");
    assert!(100 * accepted >= 80 * starts, "{accepted} of {starts} accepted");
}

/// The two-link arm of `examples/models/arm-filter.toml`.
#[test]
fn an_arm_comes_within_its_limits() {
    const P: [f64; 3] = [3.2, 0.9, 1.1];
    let (first, second) =
        ("(tau_1 + p_3 * sin(q_2) * (2 * w_1 * w_2 + w_2^2))", "(tau_2 - p_3 * sin(q_2) * w_1^2)");
    let det = "(p_1 * p_2 - (p_3 * cos(q_2))^2)";
    let w_1 = format!("(p_2 * {first} - (p_2 + p_3 * cos(q_2)) * {second}) / {det}");
    let w_2 =
        format!("((p_1 + p_2 + 2 * p_3 * cos(q_2)) * {second} - (p_2 + p_3 * cos(q_2)) * {first}) / {det}");
    let parameters = [("p_1", P[0]), ("p_2", P[1]), ("p_3", P[2])];
    let states = ["q_1", "q_2", "w_1", "w_2"];
    let model = Model::new(&states, &["tau_1", "tau_2"], &parameters, &["w_1", "w_2", &w_1, &w_2]);
    let case = Case {
        period: 0.01,
        deadline: 2.0,
        states: 4,
        model: model.expect("a model"),
        barriers: &[("1.5 - q_1", 2, false), ("2.0 - q_2", 2, true)],
        bounds: &[[-40.0, 40.0], [-25.0, 25.0]],
        rate: &|x, u| {
            let (sin, cos) = x[1].sin_cos();
            let [[a, b], [c, d]] =
                [[P[0] + P[1] + 2.0 * P[2] * cos, P[1] + P[2] * cos], [P[1] + P[2] * cos, P[1]]];
            let p = u[0] + P[2] * sin * (2.0 * x[2] * x[3] + x[3] * x[3]);
            let q = u[1] - P[2] * sin * x[2] * x[2];
            let det = a * d - b * c;
            vec![x[2], x[3], (p * d - b * q) / det, (a * q - c * p) / det]
        },
        h: &|x| vec![1.5 - x[0], 2.0 - x[1]],
    };
    for push in [[0.0, 0.0], [40.0, 25.0], [-40.0, 25.0]] {
        assert!(case.is_kept(&[0.5, 2.6, 1.0, 0.0], 1.0, |_, _| push.to_vec()), "{push:?} N m: refused");
    }
}

/// The quadrotor of `examples/models/quadrotor-filter.toml`, with bounds.
#[test]
fn a_quadrotor_in_a_plane_gets_there_below_the_ceiling() {
    let states = ["x", "z", "theta", "v_x", "v_z", "omega", "thrust", "thrust_rate"];
    let derivatives = [
        "v_x",
        "v_z",
        "omega",
        "thrust * sin(theta)",
        "thrust * cos(theta) - 9.81",
        "alpha",
        "thrust_rate",
        "thrust_acc",
    ];
    let model = Model::new(&states, &["thrust_acc", "alpha"], &[], &derivatives);
    let case = Case {
        period: 0.02,
        deadline: 4.0,
        states: states.len(),
        model: model.expect("a model"),
        barriers: &[("z - 3", 4, true), ("x - 4", 4, true), ("5 - z", 4, false), ("6 - x", 4, false)],
        bounds: &[[-300.0, 300.0], [-30.0, 30.0]],
        rate: &|x, u| {
            let [a, b] = [x[6] * x[2].sin(), x[6] * x[2].cos() - GRAVITY];
            vec![x[3], x[4], x[5], a, b, u[1], x[7], u[0]]
        },
        h: &|x| vec![x[1] - 3.0, x[0] - 4.0, 5.0 - x[1], 6.0 - x[0]],
    };
    let start = [0.0, 0.0, -0.2, 0.0, 0.0, 0.0, GRAVITY, 0.0];
    for push in [[0.0, 0.0], [100.0, 10.0], [-100.0, -10.0]] {
        assert!(case.is_kept(&start, 0.5, |_, _| push.to_vec()), "{push:?}: refused");
    }
}

/// A point on a line with a wind on a stretch of its path that is shorter than the distance of a hold. Some
/// winds take more speed than the point has.
#[test]
fn a_wind_on_a_short_stretch_is_seen_wherever_it_blows() {
    let mut outcomes = [0; 2];
    for seed in 1..=16_u64 {
        let random = &mut Random(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed));
        let width = random.between(0.3, 2.0);
        let (at, force) = (random.between(30.0, 170.0), random.between(1.0, 60.0) / width);
        let parameters = [("at", at), ("w", width), ("force", force)];
        let wind = "a - force * exp(-((p - at) / w)^2)";
        let case = Case {
            period: 0.1,
            deadline: random.between(14.0, 20.0),
            states: 2,
            model: Model::new(&["p", "v"], &["a"], &parameters, &["v", wind]).expect("a model"),
            barriers: &[("p - 180", 2, true)],
            bounds: &[[-0.5, 0.5]],
            rate: &|x, u| vec![x[1], u[0] - force * (-((x[0] - at) / width).powi(2)).exp()],
            h: &|x| vec![x[0] - 180.0 + 1e-6],
        };
        let speed = random.between(8.0, 16.0);
        let wanted = |_, x: &[f64]| vec![[0.0, 0.5, -x[1]][seed as usize % 3]];
        outcomes[usize::from(case.is_kept(&[0.0, speed], 1.0, wanted))] += 1;
    }
    assert!(outcomes.iter().all(|n| *n > 0), "{outcomes:?}");
}

/// A point on a line that reverses, against drags with a kink at zero speed. No bound is known beyond the
/// first rate there, but the search still ends.
#[test]
fn a_drag_with_a_kink_is_passed() {
    type Drag = fn(f64) -> f64;
    let drags: [(&str, Drag); 4] = [
        ("0.1 * v * abs(v)", |v| 0.1 * v * v.abs()),
        ("0.5 * abs(v)", |v| 0.5 * v.abs()),
        ("max(v, 0.2)", |v| v.max(0.2)),
        ("tanh(40 * v)", |v| (40.0 * v).tanh()),
    ];
    for (seed, (name, drag)) in (1..).zip(drags) {
        let random = &mut Random(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed));
        let case = Case {
            period: 0.05,
            deadline: random.between(8.0, 10.0),
            states: 2,
            model: Model::new(&["p", "v"], &["a"], &[], &["v", &format!("a - {name}")]).expect("a model"),
            barriers: &[("p - 4", 2, true), ("6 - p", 2, false)],
            bounds: &[[-4.0, 4.0]],
            rate: &|x, u| vec![x[1], u[0] - drag(x[1])],
            h: &|x| vec![x[0] - 4.0 + 1e-6, 6.0 - x[0]],
        };
        for push in [0.0, 4.0, -4.0] {
            let start = [random.between(-2.0, 2.0), random.between(-3.0, -1.0)];
            assert!(case.is_kept(&start, 1.0, |_, _| vec![push]), "{name}, {push}: refused");
        }
    }
}

/// An angle that jumps across the negative half of the axis, like the bearing of a point.
#[test]
fn the_jump_of_an_angle_is_seen() {
    let mut accepted = 0;
    for speed in [0.2, 0.3, 0.45, 0.7] {
        let case = Case {
            period: 0.2,
            deadline: 0.0,
            states: 4,
            model: Model::new(&["x", "y", "vx", "vy"], &["p", "q"], &[], &["vx", "vy", "p", "q"])
                .expect("a model"),
            barriers: &[("2 + atan2(y, x)", 2, false)],
            bounds: &[[-1.0, 1.0], [-1.0, 1.0]],
            rate: &|x, u| vec![x[2], x[3], u[0], u[1]],
            h: &|x| vec![2.0 + x[1].atan2(x[0])],
        };
        for push in [0.0, -1.0] {
            let is_kept = case.is_kept(&[-3.0, 0.3, 0.0, -speed], 6.0, |_, _| vec![0.0, push]);
            accepted += u32::from(is_kept);
        }
    }
    assert!(accepted > 0);
}
