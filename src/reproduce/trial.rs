//! One closed loop: a vehicle, a constraint and a start.

use std::time::Instant;

use punctual_core::barriers::{DistanceDisc, QuadraticDisc};
use punctual_core::dynamics::{ControlAffine, rk4_step};
use punctual_core::filter::{Report, SafetyFilter};
use punctual_core::lie::{self, DerivativeSource};
use punctual_core::nalgebra::SVector;
use punctual_reference::plants::{Bicycle, PointMass, Unicycle};
use punctual_reference::simulation::{Schedule, closed_loop_by};

use super::baseline::Baseline;
use crate::error::Error;

/// Centre of the safe disc in m.
pub const CENTRE: [f64; 2] = [45.0, 45.0];
/// Radius of the safe disc in m.
pub const RADIUS: f64 = 2.0;
/// ε of the distance-shaped disc in m.
const SMOOTHING: f64 = 2.0;
/// l_r of the bicycle in m.
const REAR: f64 = 10.0;

/// A plant of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vehicle {
    /// (x_p, y_p, v_x, v_y), inputs (u_x, u_y).
    PointMass,
    /// (x_p, y_p, θ, v), inputs (a, ω).
    Unicycle,
    /// (x_p, y_p, θ, v), inputs (a, β): the simplified model.
    Bicycle,
}

impl Vehicle {
    /// All three.
    pub const ALL: [Self; 3] = [Self::PointMass, Self::Unicycle, Self::Bicycle];

    /// Its name in tables.
    pub fn title(self) -> &'static str {
        match self {
            Self::PointMass => "point mass",
            Self::Unicycle => "unicycle",
            Self::Bicycle => "bicycle",
        }
    }

    /// Its name in file names.
    pub fn key(self) -> &'static str {
        match self {
            Self::PointMass => "point_mass",
            Self::Unicycle => "unicycle",
            Self::Bicycle => "bicycle",
        }
    }

    /// Its inputs with their units.
    pub fn inputs(self) -> [&'static str; 2] {
        match self {
            Self::PointMass => ["u_x (m/s²)", "u_y (m/s²)"],
            Self::Unicycle => ["a (m/s²)", "ω (rad/s)"],
            Self::Bicycle => ["a (m/s²)", "β (rad)"],
        }
    }

    fn reference(self, nominal: Nominal, x: &SVector<f64, 4>) -> SVector<f64, 2> {
        let to = [CENTRE[0] - x[0], CENTRE[1] - x[1]];
        match (nominal, self) {
            (Nominal::Coast, _) => SVector::zeros(),
            (Nominal::Damping, Self::PointMass) => [-x[2], -x[3]].into(),
            (Nominal::Damping, _) => [-x[3], 0.0].into(),
            (Nominal::Away(size), Self::PointMass) => {
                let distance = to[0].hypot(to[1]).max(f64::MIN_POSITIVE);
                to.map(|d| -size * d / distance).into()
            }
            (Nominal::Away(size), _) => {
                let ahead = to[0] * x[2].cos() + to[1] * x[2].sin();
                [if ahead < 0.0 { size } else { -size }, 0.0].into()
            }
        }
    }

    /// The derivatives of the barrier of this `shape`.
    ///
    /// # Errors
    ///
    /// None in fact: all numbers are constants.
    pub fn source(self, shape: Shape) -> Result<Box<dyn DerivativeSource>, Error> {
        fn shaped<P>(plant: P, shape: Shape) -> Result<Box<dyn DerivativeSource>, punctual_core::Error>
        where
            P: ControlAffine<4, 2> + Send + 'static,
        {
            match shape {
                Shape::Quadratic => lie::along(plant, QuadraticDisc::new(CENTRE, RADIUS)?, 2),
                Shape::Distance => lie::along(plant, DistanceDisc::new(CENTRE, RADIUS, SMOOTHING)?, 2),
            }
        }
        let source = match self {
            Self::PointMass => shaped(PointMass, shape),
            Self::Unicycle => shaped(Unicycle, shape),
            Self::Bicycle => Bicycle::new(REAR).and_then(|plant| shaped(plant, shape)),
        };
        source.map_err(Error::from)
    }

    fn advance(
        self,
        integrator: Integrator,
        x: &SVector<f64, 4>,
        u: &SVector<f64, 2>,
        dt: f64,
    ) -> SVector<f64, 4> {
        match self {
            Self::PointMass => integrator.step(&PointMass, x, u, dt),
            Self::Unicycle => integrator.step(&Unicycle, x, u, dt),
            Self::Bicycle => match Bicycle::new(REAR) {
                Ok(plant) => integrator.step(&plant, x, u, dt),
                Err(_) => *x,
            },
        }
    }
}

/// The form of the barrier; the set is the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// R² − d², in m²: the paper's.
    Quadratic,
    /// √(R² + ε²) − √(d² + ε²), in m: ours.
    Distance,
}

impl Shape {
    /// The unit of h.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Quadratic => "m²",
            Self::Distance => "m",
        }
    }
}

/// u_ref.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Nominal {
    /// 0: the paper's.
    Coast,
    /// −v on the accelerations: ours.
    Damping,
    /// This acceleration (m/s²) away from the disc: the constraint alone leads there, and is active throughout.
    Away(f64),
}

/// How the plant moves under a held input. Which one the paper uses it does not say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrator {
    /// x + f dt.
    Euler,
    /// The same for the last two states, then the positions with their new values.
    SemiImplicit,
    /// Runge-Kutta of order 4.
    Rk4,
}

impl Integrator {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Euler, Self::SemiImplicit, Self::Rk4];

    /// Its name in tables.
    pub fn title(self) -> &'static str {
        match self {
            Self::Euler => "Euler",
            Self::SemiImplicit => "semi-implicit",
            Self::Rk4 => "RK4",
        }
    }

    fn step<P: ControlAffine<4, 2>>(
        self,
        plant: &P,
        x: &SVector<f64, 4>,
        u: &SVector<f64, 2>,
        dt: f64,
    ) -> SVector<f64, 4> {
        let slope = |x: &SVector<f64, 4>| plant.drift(x) + plant.input_map(x) * u;
        match self {
            Self::Euler => x + slope(x) * dt,
            Self::SemiImplicit => {
                let now = slope(x) * dt;
                let mut next = SVector::from([x[0], x[1], x[2] + now[2], x[3] + now[3]]);
                let then = slope(&next) * dt;
                next[0] += then[0];
                next[1] += then[1];
                next
            }
            Self::Rk4 => rk4_step(plant, x, u, dt),
        }
    }
}

/// What a loop is run with beside vehicle and constraint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setup {
    /// The barrier.
    pub shape: Shape,
    /// u_ref.
    pub nominal: Nominal,
    /// μ in the unit of h.
    pub margin: f64,
    /// T in s.
    pub deadline: f64,
    /// Sampling period in s.
    pub step: f64,
    /// End of the run in s.
    pub end: f64,
    /// Bounds on |u_1| and |u_2|, if any.
    pub bounds: Option<[f64; 2]>,
    /// How the plant moves.
    pub integrator: Integrator,
}

impl Setup {
    /// As in the paper: R² − d², u_ref = 0, no margin, until 2T.
    pub fn paper(deadline: f64, step: f64) -> Self {
        Self {
            shape: Shape::Quadratic,
            nominal: Nominal::Coast,
            margin: 0.0,
            deadline,
            step,
            end: 2.0 * deadline,
            bounds: None,
            integrator: Integrator::Rk4,
        }
    }

    /// As we advise: the distance-shaped disc, damping, a margin of 0.02 m, until 2T.
    pub fn advised(deadline: f64, step: f64) -> Self {
        Self {
            shape: Shape::Distance,
            nominal: Nominal::Damping,
            margin: 0.02,
            ..Self::paper(deadline, step)
        }
    }

    /// Whether it has the barrier and the nominal controller that we advise.
    pub fn is_advised(&self) -> bool {
        self.shape == Shape::Distance && self.nominal == Nominal::Damping
    }

    /// Its name in tables.
    pub fn title(&self) -> &'static str {
        if self.is_advised() { "distance, damping" } else { "quadratic, u_ref = 0" }
    }
}

/// One sample of a loop.
pub struct Sample<'a> {
    /// In s.
    pub t: f64,
    /// The state.
    pub x: [f64; 4],
    /// The input wanted.
    pub u_ref: [f64; 2],
    /// The input.
    pub u: [f64; 2],
    /// The filter's report.
    pub report: &'a Report,
}

/// What a loop came to.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// First sample with h ≥ 0, in s.
    pub arrival: Option<f64>,
    /// Least h from the deadline on, in the unit of h.
    pub least_h: f64,
    /// Least R − d from the deadline on, in m.
    pub least_depth: f64,
    /// Largest |u_1| and |u_2| up to the arrival, or the end.
    pub peak: [f64; 2],
    /// ∫‖u‖² dt up to the arrival, or the end.
    pub effort: f64,
    /// The same to the end of the run.
    pub whole_effort: f64,
    /// Largest |u_1| and |u_2| of the whole run.
    pub whole_peak: [f64; 2],
    /// How far h fell below the bound that is promised, up to the deadline, in the unit of h: for ours r + μ
    /// without what compensation adds to μ.
    pub shortfall: f64,
    /// What compensation adds to the margin, in the unit of h.
    pub added: f64,
    /// h at the start.
    pub first_h: f64,
    /// Samples whose constraint was not met.
    pub unmet: usize,
}

impl Outcome {
    /// Whether it had arrived by `t`.
    pub fn by(&self, t: f64) -> bool {
        self.arrival.is_some_and(|arrival| arrival <= t + 1e-9)
    }

    /// Whether it was on time, and inside from the deadline on.
    pub fn kept(&self, deadline: f64) -> bool {
        self.by(deadline) && self.least_h >= 0.0
    }
}

/// Runs `vehicle` with `baseline` from `x0`; `observe` sees every sample.
///
/// # Errors
///
/// A parameter out of range.
pub fn observed(
    vehicle: Vehicle,
    baseline: Baseline,
    setup: &Setup,
    x0: [f64; 4],
    mut observe: impl FnMut(&Sample),
) -> Result<Outcome, Error> {
    let mut filter = baseline.filter(vehicle.source(setup.shape)?, setup).map_err(Error::from)?;
    let schedule =
        Schedule { step: setup.step, steps: (setup.end / setup.step).round() as usize, substeps: 1 };
    let mut out = Outcome {
        arrival: None,
        least_h: f64::INFINITY,
        least_depth: f64::INFINITY,
        peak: [0.0; 2],
        effort: 0.0,
        whole_effort: 0.0,
        whole_peak: [0.0; 2],
        shortfall: 0.0,
        added: 0.0,
        first_h: f64::NAN,
        unmet: 0,
    };
    let u_ref = |x: &SVector<f64, 4>| vehicle.reference(setup.nominal, x);
    closed_loop_by(
        &mut filter,
        |x, u, dt| vehicle.advance(setup.integrator, x, u, dt),
        x0.into(),
        schedule,
        |_, x| u_ref(x),
        |t, x, u, report| {
            let b = &report.barriers[0];
            let before = out.arrival.is_none();
            out.arrival = b.arrival_time;
            if out.first_h.is_nan() {
                out.first_h = b.h;
            }
            let spent = u.norm_squared() * setup.step;
            for i in 0..2 {
                out.whole_peak[i] = out.whole_peak[i].max(u[i].abs());
            }
            out.whole_effort += spent;
            // The arrival's own sample already belongs to what keeps it inside.
            if before && out.arrival.is_none() {
                (out.peak, out.effort) = (out.whole_peak, out.whole_effort);
            }
            out.unmet += usize::from(!report.status.is_satisfied());
            // Half a step early, so that round-off in t cannot skip the sample at the deadline.
            if t > setup.deadline - setup.step / 2.0 {
                // Not `f64::min`, which drops what is not a number.
                let depth = RADIUS - (x[0] - CENTRE[0]).hypot(x[1] - CENTRE[1]);
                out.least_h = if b.h < out.least_h || b.h.is_nan() { b.h } else { out.least_h };
                out.least_depth =
                    if depth < out.least_depth || depth.is_nan() { depth } else { out.least_depth };
            }
            out.added = b.margin - setup.margin;
            if t < setup.deadline + setup.step / 2.0 && b.profile.is_finite() {
                out.shortfall = out.shortfall.max(b.profile - out.added - b.h);
            }
            observe(&Sample { t, x: (*x).into(), u_ref: u_ref(x).into(), u: (*u).into(), report });
        },
    )
    .map_err(Error::from)?;
    Ok(out)
}

/// [`observed`], unobserved.
///
/// # Errors
///
/// As for [`observed`].
pub fn run(vehicle: Vehicle, baseline: Baseline, setup: &Setup, x0: [f64; 4]) -> Result<Outcome, Error> {
    observed(vehicle, baseline, setup, x0, |_| {})
}

/// Seconds of a filter's step, along the states of the loop from `x0`: the least mean of several passes.
///
/// # Errors
///
/// As for [`observed`].
pub fn seconds_per_step(
    vehicle: Vehicle,
    baseline: Baseline,
    setup: &Setup,
    x0: [f64; 4],
) -> Result<f64, Error> {
    const PASSES: usize = 7;
    let setup = Setup { end: setup.deadline, ..*setup };
    let mut samples = Vec::new();
    observed(vehicle, baseline, &setup, x0, |s| samples.push((s.t, s.x, s.u_ref)))?;
    let mut best = f64::INFINITY;
    for _ in 0..PASSES {
        let mut filter: SafetyFilter =
            baseline.filter(vehicle.source(setup.shape)?, &setup).map_err(Error::from)?;
        let mut u = [0.0; 2];
        let begin = Instant::now();
        for (t, x, u_ref) in &samples {
            filter.step(*t, x, u_ref, &mut u).map_err(Error::from)?;
        }
        std::hint::black_box(u);
        best = best.min(begin.elapsed().as_secs_f64() / samples.len() as f64);
    }
    Ok(best)
}
