//! The table of docs/bicycle.md: how well the promise holds if the plant is another bicycle than the
//! filter's, and what restores it.

use std::sync::Arc;

use punctual_core::barriers::DistanceDisc;
use punctual_core::dynamics::{DynPlant, Erased};
use punctual_core::filter::{BarrierSettings, Filter, Integration, Sampling};
use punctual_core::lie;
use punctual_core::plants::{Bicycle, KinematicBicycle, SmallSlipBicycle, Steering};
use punctual_cosim::error::Error;
use rayon::prelude::*;

use super::cases::{CENTRE, RADIUS, SMOOTHING, Setup};
use super::starts::hundred;
use super::table::{Cell, Table};
use super::trial::{Measured, Outcome};
use super::{Options, Watch};

/// Deadline T in s.
const DEADLINE: f64 = 5.0;
/// Largest acceleration in m/s².
const ACCELERATION: f64 = 40.0;
/// Largest rate of the slip or steering angle in rad/s.
const RATE: f64 = 4.0;
/// Rate in 1/s at which the angle follows its target value, which is 0.
const GAIN: f64 = 2.0;

/// A vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    /// Its name in the table.
    pub title: &'static str,
    /// Distance of either axle from the centre of mass, in m, > 0.
    pub length: f64,
    /// Largest slip angle in rad, > 0.
    pub slip: f64,
}

impl Size {
    /// A car with a turning circle of 3 m radius and a steering angle of 0.83 rad.
    pub const CAR: Self = Self { title: "car", length: 1.5, slip: 0.5 };
    /// The paper's vehicle, with a turning circle of 20 m.
    pub const LONG: Self = Self { title: "paper's, 0.5 rad", length: 10.0, slip: 0.5 };
    /// The paper's vehicle with a steering angle of 1.38 rad and a turning circle of 8.3 m.
    pub const AGILE: Self = Self { title: "paper's, 1.2 rad", length: 10.0, slip: 1.2 };

    fn simplified(self) -> Result<Bicycle, punctual_core::Error> {
        Bicycle::new(self.length)
    }

    fn small_slip(self) -> Result<SmallSlipBicycle, punctual_core::Error> {
        SmallSlipBicycle::new(self.length)
    }

    fn kinematic(self) -> Result<KinematicBicycle, punctual_core::Error> {
        KinematicBicycle::new(self.length, self.length)
    }
}

/// A bicycle model, for the filter or for the plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// The slip angle only turns the heading.
    Simplified,
    /// The slip angle also moves the vehicle sideways, proportionally.
    SmallSlip,
    /// The bicycle without approximation.
    Kinematic,
}

impl Model {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Simplified, Self::SmallSlip, Self::Kinematic];

    /// Its name in the table.
    pub fn title(self) -> &'static str {
        match self {
            Self::Simplified => "simplified",
            Self::SmallSlip => "small slip",
            Self::Kinematic => "kinematic",
        }
    }

    /// The plant of this model. Its second input is the angle that `filter` computes: the steering angle for
    /// the kinematic model, else the slip angle.
    fn plant(self, size: Size, filter: Self) -> Result<Box<dyn DynPlant>, punctual_core::Error> {
        let steering = if filter == Self::Kinematic { Steering::Angle } else { Steering::SlipAngle };
        Ok(match self {
            Self::Simplified => Box::new(Erased(size.simplified()?)),
            Self::SmallSlip => Box::new(Erased(size.small_slip()?)),
            Self::Kinematic => Box::new(size.kinematic()?.steered(steering)),
        })
    }
}

/// Filter settings that compensate for its model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Remedy {
    /// Its name in the table.
    pub title: &'static str,
    /// Margin μ in m.
    pub margin: f64,
    /// Rate of both phases, in 1/s.
    pub rate: f64,
    /// Bound on the unmodelled part of ḧ, in m/s².
    pub disturbance: f64,
}

impl Remedy {
    /// A margin of 0.02 m, a rate of 5/s.
    pub const NONE: Self = Self { title: "none", margin: 0.02, rate: 5.0, disturbance: 0.0 };
    /// All that are compared.
    pub const ALL: [Self; 4] = [
        Self::NONE,
        Self { title: "margin 0.5 m", margin: 0.5, ..Self::NONE },
        Self { title: "rate 10/s", rate: 10.0, ..Self::NONE },
        Self { title: "disturbance 5 m/s²", disturbance: 5.0, ..Self::NONE },
    ];
}

/// A filter paired with a plant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pairing {
    /// The vehicle.
    pub size: Size,
    /// The bicycle model of the filter.
    pub filter: Model,
    /// Its settings against the model error.
    pub remedy: Remedy,
    /// The bicycle model of the plant.
    pub plant: Model,
    /// Sampling period in s.
    pub step: f64,
}

impl Pairing {
    /// The pairings of the table with steps above `finest` (in s), in the order of the table.
    fn all(finest: f64) -> Vec<Self> {
        let mut all = Vec::new();
        let steps = [(0.01, &Remedy::ALL[..]), (0.001, &[Remedy::NONE])];
        for (step, remedies) in steps.into_iter().filter(|(step, _)| *step > finest) {
            for size in [Size::CAR, Size::LONG, Size::AGILE] {
                let none = Remedy::NONE;
                for plant in Model::ALL {
                    let simplified = |&remedy| Self { size, filter: Model::Simplified, remedy, plant, step };
                    all.extend(remedies.iter().map(simplified));
                    all.push(Self { size, filter: Model::SmallSlip, remedy: none, plant, step });
                }
                let kinematic = Model::Kinematic;
                all.push(Self { size, filter: kinematic, remedy: none, plant: kinematic, step });
            }
        }
        all
    }

    fn controlled(&self) -> Result<Filter, punctual_core::Error> {
        let Self { size, remedy, step, .. } = *self;
        let settings = BarrierSettings::within(DEADLINE)
            .rate(remedy.rate)
            .stay_rate(remedy.rate)
            .margin(remedy.margin)
            .disturbance(remedy.disturbance);
        let disc = DistanceDisc::new(CENTRE, RADIUS, SMOOTHING)?;
        let integrates = self.filter != Model::Simplified;
        let (states, second) = if integrates { (5, RATE) } else { (4, size.slip) };
        let source = match self.filter {
            Model::Simplified => lie::along(Arc::new(size.simplified()?), disc, 2)?,
            Model::SmallSlip => lie::along(Arc::new(size.small_slip()?.with_rate()), disc, 2)?,
            Model::Kinematic => lie::along(Arc::new(size.kinematic()?), disc, 2)?,
        };
        let filter = Filter::from_sources(states, 2)
            .source("goal", source, settings)?
            .sampling(Sampling::Measured { first: Some(step) })?
            .bounds(&[-ACCELERATION, -second], &[ACCELERATION, second])?
            .build()?;
        if !integrates {
            return Ok(filter);
        }
        let limit = match self.filter {
            Model::Kinematic => size.kinematic()?.steering_angle(size.slip),
            _ => size.slip,
        };
        let angle = Integration { state: 4, input: 1, limits: [-limit, limit], gain: GAIN };
        filter.with_integrator(angle)
    }

    /// Runs from `x0` until 2T. Returns the outcome, and whether some step before the deadline did not meet
    /// its constraint.
    fn run(&self, x0: [f64; 4]) -> Result<(Outcome, bool), punctual_core::Error> {
        let setup = Setup::advised(DEADLINE, self.step);
        let plant = self.plant.plant(self.size, self.filter)?;
        let mut filter = self.controlled()?;
        if filter.counts_holds() {
            filter.expect_hold(Some(self.step))?;
        }
        let (mut x, mut u) = (x0, [0.0; 2]);
        let (mut outcome, mut unmet) = (Outcome::default(), false);
        for k in 0..=(setup.end / self.step).round() as usize {
            let t = k as f64 * self.step;
            let u_ref = [-x[3], 0.0];
            let report = filter.step(t, &x, &u_ref, &mut u)?;
            let (h, satisfied) = (report.barriers[0].h, report.status.is_satisfied());
            let arrival = outcome.arrival.or((h >= 0.0).then_some(t));
            outcome.take(&setup, &Measured { t, position: [x[0], x[1]], u, h, arrival, satisfied });
            unmet |= t < DEADLINE && !satisfied;
            plant.rk4_step(&mut x, &u, self.step)?;
        }
        Ok((outcome, unmet))
    }

    /// Runs from each of `starts`.
    ///
    /// # Errors
    ///
    /// A number of the pairing out of range.
    pub fn runs(&self, starts: &[[f64; 4]]) -> Result<Tally, Error> {
        let runs: Vec<_> = starts.par_iter().map(|x0| self.run(*x0)).collect::<Result<_, _>>()?;
        let mut peaks: Vec<f64> = runs.iter().map(|(outcome, _)| outcome.whole_peak[0]).collect();
        peaks.sort_by(f64::total_cmp);
        Ok(Tally {
            runs: runs.len(),
            on_time: runs.iter().filter(|(outcome, _)| outcome.by(DEADLINE)).count(),
            inside: runs.iter().filter(|(outcome, _)| outcome.least_h >= 0.0).count(),
            least: runs.iter().map(|(outcome, _)| outcome.least_h).fold(f64::INFINITY, f64::min),
            unmet: runs.iter().filter(|(_, unmet)| *unmet).count(),
            peak: peaks.get(peaks.len().saturating_sub(1) / 2).copied(),
        })
    }
}

/// Results of the runs of a pairing.
#[derive(Clone, Copy, Debug)]
pub struct Tally {
    /// Number of runs.
    pub runs: usize,
    /// Runs that are inside at some sample up to the deadline.
    pub on_time: usize,
    /// Runs that are inside at every sample from the deadline to 2T.
    pub inside: usize,
    /// Least h at these samples, in m.
    pub least: f64,
    /// Runs in which some step before the deadline did not meet its constraint, so that nothing is promised.
    pub unmet: usize,
    /// Median of the largest |a| of the runs, in m/s².
    pub peak: Option<f64>,
}

impl Tally {
    /// Whether all runs were on time, and inside from then on.
    pub fn kept(&self) -> bool {
        (self.on_time, self.inside) == (self.runs, self.runs)
    }
}

/// The table, and whether every filter kept the car's promise on every plant. `tell` gets the fraction done,
/// from any thread.
///
/// # Errors
///
/// None in practice, since all parameters are constants.
pub fn table(options: &Options, tell: &(dyn Fn(f64) + Sync)) -> Result<(Table, bool), Error> {
    let starts = hundred(options.runs);
    let mut table = Table::new(
        "bicycles",
        "A filter for one model of a bicycle on the plant of another",
        &[
            "step (s)",
            "vehicle",
            "filter",
            "remedy",
            "plant",
            "on time",
            "inside from T to 2T",
            "least h (m)",
            "with an unmet step",
            "median peak |a| (m/s²)",
        ],
    )
    .note(format!(
        "{} starts (tests/data/starts100.csv), T = {DEADLINE} s, RK4, to {} s; distance-shaped disc, damping.",
        starts.len(),
        2.0 * DEADLINE
    ))
    .note(format!("|a| ≤ {ACCELERATION} m/s², rates of angles ≤ {RATE} rad/s."));
    let all = Pairing::all(options.finest);
    let loops = |pairing: &Pairing| (1.0 / pairing.step).round() as usize;
    let watch = Watch::new(all.iter().map(loops).sum(), tell);
    let mut kept = true;
    for pairing in all {
        let found = pairing.runs(&starts)?;
        watch.done(loops(&pairing));
        kept &= pairing.size != Size::CAR || found.kept();
        table.rows.push(vec![
            Cell::Number(pairing.step, 3),
            pairing.size.title.into(),
            pairing.filter.title().into(),
            pairing.remedy.title.into(),
            pairing.plant.title().into(),
            Cell::count(found.on_time),
            Cell::count(found.inside),
            Cell::Number(found.least, 3),
            Cell::count(found.unmet),
            Cell::optional(found.peak, 1, "-"),
        ]);
    }
    Ok((table, kept))
}
