//! The pictures: the paper's two figures beside ours, and the effects of step and deadline.

use punctual_core::elementary;
use punctual_cosim::error::Error;
use punctual_pictures::plot::{Chart, Curve, Disc, Mark, Scaling, Style};
use rayon::prelude::*;

use super::baseline::Baseline;
use super::cases::{self, CENTRE, DEADLINE, Nominal, RADIUS, STEP, Setup, Vehicle};
use super::table::{Cell, Table};
use super::trial::{self, Outcome};
use super::{Figure, Options, always};

/// Points of a curve.
const POINTS: usize = 800;
/// Bounds on |u_1| and |u_2| in the pictures of inputs.
const BOUNDS: [f64; 2] = [8.0, 3.0];

/// The baseline in the pictures, with gains and exponent of [`Baseline::defaults`].
const EXISTING: Baseline = Baseline::FiniteTime([1.0, 1.0], 0.5);

/// The same baseline with the parameters that [`super::search`] finds for all three vehicles in the
/// recommended setting.
const SEARCHED: Baseline = Baseline::FiniteTime([4.0, 4.0], 0.5);

/// A recorded loop.
struct Trace {
    outcome: Outcome,
    t: Vec<f64>,
    x: Vec<[f64; 4]>,
    u: Vec<[f64; 2]>,
    h: Vec<f64>,
    bound: Vec<f64>,
    period: f64,
}

impl Trace {
    fn new(vehicle: Vehicle, baseline: Baseline, setup: &Setup, x0: [f64; 4]) -> Result<Self, Error> {
        let (mut t, mut x, mut u, mut h, mut bound) = (vec![], vec![], vec![], vec![], vec![]);
        let outcome = trial::observed(vehicle, baseline, setup, x0, |s| {
            t.push(s.t);
            x.push(s.x);
            u.push(s.u);
            h.push(s.report.barriers[0].h);
            bound.push(s.report.barriers[0].profile);
        })?;
        Ok(Self { outcome, t, x, u, h, bound, period: setup.step })
    }

    /// The sample of the arrival.
    fn arrival(&self) -> Option<usize> {
        let at = self.outcome.arrival?;
        self.t.iter().position(|t| *t > at - self.period / 2.0)
    }

    /// The part up to its arrival, if it arrives.
    fn cut_at_arrival(mut self) -> Self {
        if let Some(k) = self.arrival() {
            self.t.truncate(k + 1);
            self.x.truncate(k + 1);
            self.u.truncate(k + 1);
            self.h.truncate(k + 1);
            self.bound.truncate(k + 1);
        }
        self
    }

    fn depth(&self) -> Vec<f64> {
        self.x.iter().map(|x| RADIUS - elementary::hypot(x[0] - CENTRE[0], x[1] - CENTRE[1])).collect()
    }

    fn path(&self, label: &str, colour: usize, style: Style) -> Curve {
        let point = |k: usize| [self.x[k][0], self.x[k][1]];
        Curve {
            label: label.into(),
            x: self.x.iter().map(|x| x[0]).collect(),
            y: self.x.iter().map(|x| x[1]).collect(),
            style,
            colour,
            dots: false,
            ends: [Some(point(0)), self.arrival().map(point)],
        }
        .thinned(POINTS)
    }

    fn over_time(&self, values: Vec<f64>, label: &str, colour: usize, style: Style) -> Curve {
        Curve { label: label.into(), x: self.t.clone(), y: values, style, colour, ..Curve::default() }
            .thinned(POINTS)
    }
}

fn deadline(at: f64) -> Vec<Mark> {
    vec![Mark { label: format!("deadline {at} s"), at }]
}

fn zero() -> Vec<Mark> {
    vec![Mark { label: String::new(), at: 0.0 }]
}

/// All pictures, and the table of the fits to them.
///
/// # Errors
///
/// None in practice, since all parameters are constants.
pub fn all(options: &Options) -> Result<(Vec<Figure>, Table), Error> {
    let mut figures = Vec::new();
    for vehicle in Vehicle::ALL {
        figures.push(trajectories(vehicle)?);
        figures.push(depths(vehicle)?);
        figures.push(profile(vehicle)?);
        figures.extend(inputs(vehicle)?);
    }
    figures.push(phase_portrait()?);
    let (steps, table) = steps(options)?;
    figures.extend(steps);
    figures.push(deadlines()?);
    figures.extend(always::figures()?);
    Ok((figures, table))
}

/// The paper's figure of trajectories: T = 5, its starts.
fn trajectories(vehicle: Vehicle) -> Result<Figure, Error> {
    const T: f64 = 5.0;
    let x0 = match vehicle {
        Vehicle::PointMass => [0.0, 0.0, -10.0, 0.0],
        Vehicle::Unicycle | Vehicle::Bicycle => [0.0, 0.0, 0.0, -20.0],
    };
    let trace = |baseline, setup: Setup| Trace::new(vehicle, baseline, &setup, x0);
    let paper = trace(Baseline::RepeatedRoot, Setup::paper(T, STEP))?.cut_at_arrival();
    let existing = trace(EXISTING, Setup::paper(T, STEP))?;
    let searched = trace(SEARCHED, Setup::advised(T, STEP))?;
    let ours = trace(Baseline::Profile, Setup::advised(T, STEP))?;
    let path = |trace: &Trace, name: &str, colour, style| {
        let late = match trace.outcome.arrival {
            Some(t) => format!("arrives at {t:.3} s"),
            None => "never arrives".to_owned(),
        };
        trace.path(&format!("{name}, {late}"), colour, style)
    };
    let chart = Chart {
        title: format!("{}: into the disc within {T} s", vehicle.title()),
        // A trajectory that does not arrive would shrink everything else to a point.
        x: Scaling::linear("x_p (m)").over(-40.0, 70.0),
        y: Scaling::linear("y_p (m)").over(-15.0, 60.0),
        equal: true,
        curves: vec![
            path(&ours, Baseline::Profile.title(), 0, Style::Solid),
            path(&paper, Baseline::RepeatedRoot.title(), 1, Style::Dashed),
            path(&existing, "finite-time HOCBF, p = 1, 1, q = 0.5", 3, Style::Dashed),
            path(&searched, "finite-time HOCBF, p = 4, 4, q = 0.5, distance, damping", 4, Style::Dashed),
        ],
        discs: vec![Disc { label: "safe set".into(), centre: CENTRE, radius: RADIUS, obstacle: false }],
        ..Chart::default()
    };
    Ok(Figure {
        key: format!("trajectories-{}", vehicle.key()),
        caption: format!(
            "One run each from {x0:?}, as in the paper's figure, T = {T} s, step {STEP} s, RK4; the paper's to its arrival, the others to {} s.",
            2.0 * T
        ),
        chart,
    })
}

/// The paper's figure over time: T = 10, start (0, 0, −10, 0).
fn depths(vehicle: Vehicle) -> Result<Figure, Error> {
    let x0 = [0.0, 0.0, -10.0, 0.0];
    let trace = |baseline, setup: Setup| Trace::new(vehicle, baseline, &setup, x0);
    let paper = trace(Baseline::RepeatedRoot, Setup::paper(DEADLINE, STEP))?;
    let existing = trace(EXISTING, Setup::paper(DEADLINE, STEP))?;
    let ours = trace(Baseline::Profile, Setup::advised(DEADLINE, STEP))?;
    let line = |trace: &Trace, label, colour, style| trace.over_time(trace.depth(), label, colour, style);
    let chart = Chart {
        title: format!("{}: how deep inside the disc", vehicle.title()),
        x: Scaling::linear("time (s)"),
        y: Scaling::linear("R − d (m)").over(-90.0, 5.0),
        curves: vec![
            line(&ours, Baseline::Profile.title(), 0, Style::Solid),
            line(&paper, Baseline::RepeatedRoot.title(), 1, Style::Dashed),
            line(&existing, "finite-time HOCBF, p = 1, 1, q = 0.5", 3, Style::Dashed),
        ],
        verticals: deadline(DEADLINE),
        horizontals: zero(),
        ..Chart::default()
    };
    Ok(Figure {
        key: format!("depth-{}", vehicle.key()),
        caption: format!(
            "One run each from {x0:?}, as in the paper's figure, T = {DEADLINE} s, step {STEP} s, RK4, to {} s. Above 0 is safe.",
            2.0 * DEADLINE
        ),
        chart,
    })
}

/// h and its promised lower bound.
fn profile(vehicle: Vehicle) -> Result<Figure, Error> {
    let x0 = [0.0, 0.0, -10.0, 0.0];
    let trace = Trace::new(vehicle, Baseline::Profile, &Setup::advised(DEADLINE, STEP), x0)?;
    let chart = Chart {
        title: format!("{}: h and its promised bound", vehicle.title()),
        x: Scaling::linear("time (s)"),
        y: Scaling::linear("h (m)"),
        curves: vec![
            trace.over_time(trace.h.clone(), "h", 0, Style::Solid),
            trace.over_time(trace.bound.clone(), "profile r + μ", 1, Style::Dashed),
        ],
        verticals: deadline(DEADLINE),
        horizontals: zero(),
        ..Chart::default()
    };
    Ok(Figure {
        key: format!("profile-{}", vehicle.key()),
        caption: format!(
            "Our method from {x0:?}, T = {DEADLINE} s, step {STEP} s: h stays above the profile, and above 0 from the deadline on."
        ),
        chart,
    })
}

/// Inputs against their bounds, one picture per unit.
fn inputs(vehicle: Vehicle) -> Result<Vec<Figure>, Error> {
    let x0 = [0.0, 0.0, -10.0, 0.0];
    let bounds = match vehicle {
        Vehicle::PointMass => [BOUNDS[0]; 2],
        Vehicle::Unicycle | Vehicle::Bicycle => BOUNDS,
    };
    let setup = Setup { bounds: Some(bounds), ..Setup::advised(DEADLINE, STEP) };
    let trace = Trace::new(vehicle, Baseline::Profile, &setup, x0)?;
    let names: Vec<String> = vehicle.inputs().iter().map(cases::label).collect();
    let curve = |i: usize, colour: usize| {
        trace.over_time(trace.u.iter().map(|u| u[i]).collect(), &names[i], colour, Style::Steps)
    };
    let picture = |curves: Vec<Curve>, label: &str, bound: f64, part: &str| Figure {
        key: format!("inputs-{}{part}", vehicle.key()),
        caption: format!(
            "Our method from {x0:?}, T = {DEADLINE} s, step {STEP} s, with bounds; arrival at {}, {} of {} samples not met.",
            shown_time(trace.outcome.arrival),
            trace.outcome.unmet,
            trace.t.len()
        ),
        chart: Chart {
            title: format!("{}: input and its bounds", vehicle.title()),
            x: Scaling::linear("time (s)"),
            y: Scaling::linear(label).over(-1.15 * bound, 1.15 * bound),
            curves,
            verticals: deadline(DEADLINE),
            horizontals: vec![
                Mark { label: format!("bound {bound}"), at: bound },
                Mark { label: String::new(), at: -bound },
            ],
            ..Chart::default()
        },
    };
    Ok(match vehicle {
        Vehicle::PointMass => vec![picture(vec![curve(0, 0), curve(1, 1)], "u (m/s²)", bounds[0], "")],
        _ => vec![
            picture(vec![curve(0, 0)], &names[0], bounds[0], "-1"),
            picture(vec![curve(1, 1)], &names[1], bounds[1], "-2"),
        ],
    })
}

fn shown_time(t: Option<f64>) -> String {
    t.map_or("no time".to_owned(), |t| format!("{t:.3} s"))
}

/// ḣ over h for several starts of the point mass.
fn phase_portrait() -> Result<Figure, Error> {
    const T: f64 = 5.0;
    let speeds = [-10.0, -5.0, 0.0, 5.0, 10.0];
    let mut curves = Vec::new();
    for (method, setup, colour, style) in [
        (Baseline::Profile, Setup::advised(T, STEP), 0, Style::Solid),
        (Baseline::RepeatedRoot, Setup { margin: 0.0, ..Setup::advised(T, STEP) }, 1, Style::Dashed),
    ] {
        for (i, speed) in speeds.into_iter().enumerate() {
            // The velocity points along the line of sight, from the middle of the box.
            let part = speed / f64::sqrt(2.0);
            let mut trace = Trace::new(Vehicle::PointMass, method, &setup, [10.0, 10.0, part, part])?;
            if method == Baseline::RepeatedRoot {
                // The rest would hide everything else.
                trace = trace.cut_at_arrival();
            }
            let slope = |k: usize| {
                let last = trace.h.len() - 1;
                let (from, to) = (k.saturating_sub(1), (k + 1).min(last));
                (trace.h[to] - trace.h[from]) / (trace.t[to] - trace.t[from])
            };
            let y: Vec<f64> = (0..trace.h.len()).map(slope).collect();
            let label = if i == 0 { method.title() } else { "" };
            curves.push(
                Curve {
                    label: label.into(),
                    ends: [Some([trace.h[0], y[0]]), None],
                    x: trace.h,
                    y,
                    style,
                    colour,
                    dots: false,
                }
                .thinned(POINTS),
            );
        }
    }
    Ok(Figure {
        key: "phase-portrait".into(),
        caption: format!(
            "Point mass from (10, 10) with speeds of {speeds:?} m/s towards the disc, T = {T} s, to {} s, step {STEP} s, both \
             with the distance-shaped disc and damping. Ours comes to h = μ at rest; the repeated root, drawn to its arrival, gets there at a speed.",
            2.0 * T
        ),
        chart: Chart {
            title: "phase portrait, n = 2".into(),
            x: Scaling::linear("h (m)"),
            y: Scaling::linear("dh/dt (m/s)"),
            curves,
            verticals: zero(),
            horizontals: zero(),
            ..Chart::default()
        },
    })
}

/// The order p of y ≈ c xᵖ by least squares in logarithms, over the positive values; `None` if there are
/// fewer than two.
fn order(x: &[f64], y: &[f64]) -> Option<f64> {
    let points: Vec<(f64, f64)> = x
        .iter()
        .zip(y)
        .filter(|(_, y)| **y > 0.0)
        .map(|(x, y)| (elementary::ln(*x), elementary::ln(*y)))
        .collect();
    if points.len() < 2 {
        return None;
    }
    let n = points.len() as f64;
    let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let above: f64 = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
    Some(above / points.iter().map(|p| elementary::powi(p.0 - mx, 2)).sum::<f64>())
}

/// The time at which h crosses 0, interpolated between samples, minus the deadline; `None` without an
/// arrival.
fn lateness(trace: &Trace, deadline: f64) -> Option<f64> {
    let k = trace.arrival()?;
    let (before, after) = (trace.h.get(k.checked_sub(1)?)?, trace.h[k]);
    Some(trace.t[k - 1] + trace.period * before / (before - after) - deadline)
}

/// A start for each vehicle.
type Start = fn(Vehicle) -> [f64; 4];

/// Speed in m/s of [`moving`].
const SPEED: f64 = 20.0;

/// At the origin, moving with [`SPEED`] towards the disc.
fn moving(vehicle: Vehicle) -> [f64; 4] {
    match vehicle {
        Vehicle::PointMass => [0.0, 0.0, SPEED / 2_f64.sqrt(), SPEED / 2_f64.sqrt()],
        Vehicle::Unicycle | Vehicle::Bicycle => [0.0, 0.0, std::f64::consts::FRAC_PI_4, SPEED],
    }
}

/// The cost of held inputs over the step size.
fn steps(options: &Options) -> Result<(Vec<Figure>, Table), Error> {
    /// u_ref of the shortfall's runs, in m/s².
    const PUSH: f64 = 5.0;
    /// Period in s from which the order of the compensation margin is fitted.
    const CLEAR: f64 = 5e-3;
    const MARGIN: &str = "margin added (m), order from 5 ms";
    // The table, and functions for a row and a curve.
    let all = [1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2];
    let periods: Vec<f64> = all.into_iter().filter(|p| *p >= options.finest).collect();
    let mut table = Table::new(
        "step_size",
        "Effect of the sampling period δ",
        &["what", "vehicle", "method", "at 1 ms", "at 10 ms", "at 50 ms", "fitted order in δ"],
    )
    .note("One run each, from rest at the origin where nothing else is said, T = 10 s, RK4 with held inputs. Orders: least squares in logarithms over all periods, where all values are positive.")
    .note("Lateness: h = 0 between samples, less T; < 0 is early. Paper's method: R² − d², u_ref = 0; ours: distance-shaped, damping, margin 0.02 m.")
    .note(format!("Shortfall: how far h falls below its promised bound until T; all with the distance-shaped disc, no margin but what compensation adds, and u_ref = {PUSH} m/s² away from the disc, so that the constraint alone leads there. Moving: from the origin with {SPEED} m/s towards the disc."))
    .note("From rest the profile pointwise has none: its second derivative falls, and an input that is held is larger than it has to be.");
    let mut add = |what: &str, vehicle: Vehicle, name: &str, values: &[f64]| {
        let at = |period: f64| {
            let found = periods.iter().position(|p| *p == period).map(|k| values[k]);
            match found.filter(|v| v.is_finite()) {
                None => Cell::Nothing("never"),
                Some(0.0) => "0".into(),
                Some(v) => format!("{v:.2e}").into(),
            }
        };
        // At smaller periods, round-off dominates the compensation margin.
        let from = if what == MARGIN { CLEAR } else { 0.0 };
        let (x, y): (Vec<f64>, Vec<f64>) = periods.iter().zip(values).filter(|(p, _)| **p >= from).unzip();
        let fitted = order(&x, &y).filter(|_| values.iter().all(|v| *v > 0.0));
        table.rows.push(vec![
            what.into(),
            vehicle.title().into(),
            name.into(),
            at(1e-3),
            at(1e-2),
            at(5e-2),
            Cell::optional(fitted, 2, "-"),
        ]);
    };
    let curve = |label: String, y: Vec<f64>, colour: usize, style| {
        let shown = y.into_iter().map(|v| if v > 0.0 { v } else { f64::NAN }).collect();
        Curve { label, x: periods.clone(), y: shown, style, colour, dots: true, ends: [None; 2] }
    };
    let methods = [
        (Baseline::RepeatedRoot, "repeated root", Style::Dashed),
        (Baseline::ProfilePointwise, "profile, pointwise", Style::Solid),
        (Baseline::Profile, "profile, compensated", Style::Solid),
    ];
    // Lateness of each method in its settings.
    let mut late = Vec::new();
    for (i, vehicle) in Vehicle::ALL.into_iter().enumerate() {
        for (method, name, style) in methods {
            let setup = match method {
                Baseline::RepeatedRoot => Setup::paper(DEADLINE, STEP),
                _ => Setup::advised(DEADLINE, STEP),
            };
            let one = |&step: &f64| {
                let setup = Setup { step, end: 1.5 * DEADLINE, ..setup };
                let trace = Trace::new(vehicle, method, &setup, [0.0; 4])?;
                Ok(lateness(&trace, DEADLINE).unwrap_or(f64::NAN))
            };
            let y = periods.par_iter().map(one).collect::<Result<Vec<f64>, Error>>()?;
            add("lateness (s)", vehicle, name, &y);
            if y.iter().any(|v| *v > 0.0) {
                late.push(curve(format!("{}, {name}", vehicle.title()), y, i, style));
            }
        }
    }
    // Shortfall if only the constraint leads to the disc, and the margin that compensation adds.
    let mut short = Vec::new();
    let origin = |_: Vehicle| [0.0; 4];
    let starts: [(&str, Start); 2] = [("from rest", origin), ("moving", moving)];
    for (vehicle, (start, x0)) in
        Vehicle::ALL.map(|vehicle| (vehicle, starts[0])).into_iter().chain([(Vehicle::PointMass, starts[1])])
    {
        for (i, (method, name, style)) in methods.into_iter().enumerate() {
            let one = |&step: &f64| {
                let advised = Setup::advised(DEADLINE, step);
                let setup = Setup { margin: 0.0, nominal: Nominal::Away(PUSH), end: DEADLINE, ..advised };
                let outcome = trial::run(vehicle, method, &setup, x0(vehicle))?;
                Ok((outcome.shortfall, outcome.added))
            };
            let found = periods.par_iter().map(one).collect::<Result<Vec<(f64, f64)>, Error>>()?;
            let (y, added): (Vec<f64>, Vec<f64>) = found.into_iter().unzip();
            let named = |what: &str, y: &[f64]| {
                let fitted = order(&periods, y).map_or(String::new(), |p| format!(", order {p:.2}"));
                format!("{what}, {name}, {start}{fitted}")
            };
            add(&format!("shortfall (m), {start}"), vehicle, name, &y);
            if vehicle == Vehicle::PointMass && y.iter().any(|v| *v > 0.0) {
                short.push(curve(named("shortfall", &y), y, [1, 4, 0][i], style));
            }
            if vehicle == Vehicle::PointMass && method == Baseline::Profile && start == starts[0].0 {
                let clear: Vec<f64> =
                    added.iter().zip(&periods).map(|(m, p)| if *p < CLEAR { 0.0 } else { *m }).collect();
                add(MARGIN, vehicle, name, &added);
                let label = named("margin added", &clear);
                short.push(curve(format!("{label} from {CLEAR} s on"), added, 2, style));
            }
        }
    }
    // The two pictures.
    let figure = |key: &str, title: &str, label: &str, curves, caption: String| Figure {
        key: key.into(),
        caption,
        chart: Chart {
            title: title.into(),
            x: Scaling::logarithmic("sampling period δ (s)"),
            y: Scaling::logarithmic(label),
            curves,
            ..Chart::default()
        },
    };
    let figures = vec![
        figure(
            "lateness",
            "lateness against the sampling period",
            "arrival − T (s)",
            late,
            "One run each from rest at the origin, T = 10 s. What is not drawn is not late. The orders are in the table of the sampling period.".into(),
        ),
        figure(
            "shortfall",
            "shortfall against the sampling period, point mass",
            "largest bound − h until T (m)",
            short,
            format!("One run each from the origin, from rest or with {SPEED} m/s towards the disc, T = 10 s, distance-shaped disc, u_ref = {PUSH} m/s² away from it: the constraint alone leads there. What is not drawn never falls below its bound."),
        ),
    ];
    Ok((figures, table))
}

/// Peak input over the deadline.
fn deadlines() -> Result<Figure, Error> {
    const PERIOD: f64 = 2e-3;
    let times = [2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 14.0, 20.0, 30.0];
    // The peaks of one method over all deadlines.
    let curve = |label: &str, method, setup: fn(f64, f64) -> Setup, colour, style| {
        let mut y = Vec::new();
        for t in times {
            let setup = Setup { end: 1.5 * t, ..setup(t, PERIOD) };
            y.push(trial::run(Vehicle::PointMass, method, &setup, [0.0; 4])?.peak[0]);
        }
        Ok::<_, Error>(Curve {
            label: label.into(),
            x: times.to_vec(),
            y,
            style,
            colour,
            dots: true,
            ends: [None; 2],
        })
    };
    // Each component of d, reached at any speed under a constant acceleration: d/√2 = a T²/2.
    let distance = elementary::hypot(CENTRE[0], CENTRE[1]) - RADIUS;
    let least = times.iter().map(|t| f64::sqrt(2.0) * distance / (t * t)).collect();
    Ok(Figure {
        key: "deadlines".into(),
        caption: format!(
            "Point mass from rest at the origin, one run per deadline, step {PERIOD} s; largest |u_x| up to the arrival. The least possible arrives at full speed."
        ),
        chart: Chart {
            title: "peak input against the deadline, point mass".into(),
            x: Scaling::logarithmic("deadline T (s)"),
            y: Scaling::logarithmic("peak |u_x| (m/s²)"),
            curves: vec![
                curve(
                    "repeated root, quadratic disc, u_ref = 0",
                    Baseline::RepeatedRoot,
                    Setup::paper,
                    1,
                    Style::Dashed,
                )?,
                curve(
                    "reference profile, quadratic disc, u_ref = 0",
                    Baseline::Profile,
                    Setup::paper,
                    4,
                    Style::Dashed,
                )?,
                curve(
                    "reference profile, distance-shaped, damping",
                    Baseline::Profile,
                    Setup::advised,
                    0,
                    Style::Solid,
                )?,
                curve(
                    "low-peak profile, distance-shaped, damping",
                    Baseline::LowPeak,
                    Setup::advised,
                    2,
                    Style::Solid,
                )?,
                Curve {
                    label: "least possible".into(),
                    x: times.to_vec(),
                    y: least,
                    style: Style::Dashed,
                    colour: 6,
                    dots: false,
                    ends: [None; 2],
                },
            ],
            ..Chart::default()
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_fitted_where_values_are_positive() {
        let x = [0.1, 0.2, 0.4];
        assert!((order(&x, &x.map(|x| 3.0 * x * x)).unwrap() - 2.0).abs() < 1e-12);
        assert!((order(&x, &[0.1, -1.0, 0.4]).unwrap() - 1.0).abs() < 1e-12);
        assert_eq!(order(&x, &[0.0, -1.0, 0.4]), None);
    }
}
