//! Dynamic extension inside the filter: an integrator whose state is commanded and not measured.

use alloc::vec::Vec;

use super::rows::Rows;
use crate::error::{Error, ErrorKind, length, positive};
use crate::lie::Direction;
use crate::qp::Bounds;

/// An integrator between the filter and its plant. The filter's barriers are along a model in which the input
/// [`Self::input`] is the derivative of the state [`Self::state`], such as `SmallSlipBicycleWithRate` or `KinematicBicycle`
/// of the reference plants. The plant takes that state as its input. So x lacks it, and u and u_ref contain it in place of
/// its rate.
///
/// Over each period it changes linearly in the filter's model. The plant receives its mean over the period, to be held; the
/// two differ by O(δ²) in the state at the end. The requested value v becomes the rate `gain` (v − value), or the rate that
/// leads there within the period if that is less.
///
/// ```
/// # use punctual_core::{barriers::DistanceDisc, filter::*};
/// # use punctual_core::plants::SmallSlipBicycle;
/// let goal = DistanceDisc::new([45.0, 45.0], 2.0, 2.0)?;
/// let model = SmallSlipBicycle::new(10.0)?.with_rate();
/// // β, the last state, is the integral of input 1, and within 0.5 rad.
/// let beta = Integration { state: 4, input: 1, limits: [-0.5, 0.5], gain: 10.0 };
/// let mut filter = Filter::builder(model)
///     .barrier("goal", goal, BarrierSettings::within(10.0))?
///     .build()?
///     .with_integrator(beta)?;
/// filter.expect_hold(Some(0.01))?;
/// let mut u = [0.0; 2];
/// let report = filter.step(0.0, &[0.0, 0.0, 0.5, 3.0], &[0.0; 2], &mut u)?;
/// assert!(report.status.is_satisfied());
/// assert_eq!(u[1], filter.integrated() / 2.0);
/// # Ok::<(), punctual_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Integration {
    /// The number of the model's state that is integrated, counted from 0.
    pub state: usize,
    /// The number of the input that is its derivative, counted from 0.
    pub input: usize,
    /// Least and largest value of the state, in its unit; ±infinity if there is none. The value starts at the number nearest
    /// 0 within them.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub limits: [f64; 2],
    /// How fast the value follows the requested one, 1/s, finite, > 0.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub gain: f64,
}

/// An [`Integration`] together with what the rows need for it. Its value is kept in the state of the rows.
pub(super) struct Integrator {
    pub(super) of: Integration,
    /// The bounds on the rate; those at a sample are tighter.
    pub(super) rates: [f64; 2],
    /// Scratch: the state of the model and its direction.
    pub(super) x: [Vec<f64>; 2],
    /// Scratch: u_ref of the model and its direction.
    pub(super) u_ref: [Vec<f64>; 2],
}

impl Integrator {
    /// The integrator `of` before the plant of `rows`.
    ///
    /// # Errors
    ///
    /// As for [`Filter::with_integrator`](super::Filter::with_integrator).
    pub(super) fn new(rows: &Rows, of: Integration) -> Result<Self, Error> {
        let Integration { state, input, limits, gain } = of;
        for (field, index, count) in [("state", state, rows.state_dim), ("input", input, rows.input_dim)] {
            if index >= count {
                let message = format!("is {index}, must be < {count}");
                return Err(Error::new(ErrorKind::Range, field, message));
            }
        }
        let [min, max] = limits;
        // NaN fails this comparison on purpose.
        if !(min <= max && min < f64::INFINITY && max > f64::NEG_INFINITY) {
            let message = format!("is [{min}, {max}], must be [min, max] with min <= max");
            return Err(Error::new(ErrorKind::Range, "limits", message));
        }
        let Bounds { min, max } = &rows.bounds;
        let rates = [min[input], max[input]];
        if rates[0] > 0.0 || rates[1] < 0.0 {
            let message = format!("is [{}, {}] for the rate, must contain 0", rates[0], rates[1]);
            return Err(Error::new(ErrorKind::Range, "bounds", message));
        }
        if rows.delay > 0.0 {
            let message = format!("is {}, must be 0 with an integrator", rows.delay);
            return Err(Error::new(ErrorKind::Unsupported, "actuation_delay", message));
        }
        positive("gain", gain)?;
        let x = [vec![0.0; rows.state_dim], vec![0.0; rows.state_dim]];
        let u_ref = [vec![0.0; rows.input_dim], vec![0.0; rows.input_dim]];
        Ok(Self { of, rates, x, u_ref })
    }

    /// `value` within the limits.
    pub(super) fn limited(&self, value: f64) -> f64 {
        value.max(self.of.limits[0]).min(self.of.limits[1])
    }

    /// Completes the state and u_ref of the model, and the bounds of `rows`, for a sample whose input is held for `hold` s.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length.
    pub(super) fn begin(
        &mut self,
        rows: &mut Rows,
        hold: f64,
        x: &[f64],
        u_ref: &[f64],
    ) -> Result<(), Error> {
        let Integration { state, input, limits, .. } = self.of;
        let (value, follows) = (rows.state.integrated, self.follows(hold));
        length("x", x.len(), rows.state_dim - 1)?;
        length("u_ref", u_ref.len(), rows.input_dim)?;
        insert(&mut self.x[0], x, state, value);
        self.u_ref[0].copy_from_slice(u_ref);
        self.u_ref[0][input] = (u_ref[input] - value) * follows;
        // 0 is within these too, since the value is within its limits.
        rows.bounds.min[input] = self.rates[0].max((limits[0] - value) / hold);
        rows.bounds.max[input] = self.rates[1].min((limits[1] - value) / hold);
        rows.bounded = rows.bounds != Bounds::NONE;
        Ok(())
    }

    /// Completes the direction of a derivative at the sample that [`Self::begin`] began.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length.
    pub(super) fn begin_direction(
        &mut self,
        rows: &Rows,
        hold: f64,
        Direction { x: dx, u: du_ref }: Direction,
    ) -> Result<(), Error> {
        length("dx", dx.len(), rows.state_dim - 1)?;
        length("du_ref", du_ref.len(), rows.input_dim)?;
        insert(&mut self.x[1], dx, self.of.state, 0.0);
        self.u_ref[1].copy_from_slice(du_ref);
        self.u_ref[1][self.of.input] *= self.follows(hold);
        Ok(())
    }

    /// The rate, held for `hold` s, per unit of difference between the requested value and the present one, in 1/s.
    fn follows(&self, hold: f64) -> f64 {
        self.of.gain.min(1.0 / hold)
    }

    /// The rate for `hold` s that the requested value `wish` asks for, limited only by the bounds.
    #[cfg(feature = "plan")]
    pub(super) fn wanted(&self, value: f64, hold: f64, wish: f64) -> f64 {
        let ends = self.of.limits.map(|limit| (limit - value) / hold);
        let rate = (wish - value) * self.follows(hold);
        rate.max(self.rates[0].max(ends[0])).min(self.rates[1].min(ends[1]))
    }

    /// How that rate moves with `wish`, in 1/s: not at all beyond the bounds.
    #[cfg(feature = "plan")]
    pub(super) fn moves(&self, value: f64, hold: f64, wish: f64) -> f64 {
        let follows = self.follows(hold);
        if self.wanted(value, hold, wish) == (wish - value) * follows { follows } else { 0.0 }
    }

    /// Replaces the rate by the mean over `hold` s; returns the value at the end.
    pub(super) fn finish(&self, value: f64, hold: f64, u: &mut [f64]) -> f64 {
        let rate = u[self.of.input];
        u[self.of.input] = self.limited(value + rate * hold / 2.0);
        self.limited(value + rate * hold)
    }
}

/// `to` = `from` with `value` inserted at `place`.
pub(super) fn insert(to: &mut [f64], from: &[f64], place: usize, value: f64) {
    to[..place].copy_from_slice(&from[..place]);
    to[place] = value;
    to[place + 1..].copy_from_slice(&from[place..]);
}
