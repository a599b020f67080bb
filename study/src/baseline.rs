//! The baselines with their parameters, our own methods, and the settings in which they run.

use punctual_core::elementary;
use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder, Method, ProfileKind, Sampling};
use punctual_core::lie::DerivativeSource;
use punctual_reference::baselines::{Chain, Exponent, Exponential, FirstOrderFixedTime, Tube};

/// A constraint with its parameters, for relative degree 2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Baseline {
    /// The paper's method: the repeated root.
    RepeatedRoot,
    /// Ours: the Hermite profile with its default rate. It accounts for held inputs, whose period is known
    /// from the start.
    Profile,
    /// Ours, enforced only at the samples.
    ProfilePointwise,
    /// Ours with the profile of least peak.
    LowPeak,
    /// Exponential, the same rate (1/s) twice.
    Exponential(f64),
    /// High-order with linear functions of these gains (1/s).
    HighOrder([f64; 2]),
    /// High-order with powers: both gains, and their common exponent.
    FiniteTime([f64; 2], f64),
    /// First-order fixed-time: exponent, and the rate (1/s) of the second order.
    FirstOrder(f64, f64),
    /// A tube: the power of its schedule, and its rate (1/s).
    Tube(usize, f64),
}

impl Baseline {
    /// Its name in tables, without parameters.
    pub fn title(self) -> &'static str {
        match self {
            Self::RepeatedRoot => "repeated root (the paper)",
            Self::Profile => "reference profile (ours)",
            Self::ProfilePointwise => "reference profile, pointwise",
            Self::LowPeak => "low-peak profile (ours)",
            Self::Exponential(_) => "exponential CBF",
            Self::HighOrder(_) => "high-order CBF",
            Self::FiniteTime(..) => "finite-time HOCBF (Xiao)",
            Self::FirstOrder(..) => "first-order fixed-time CBF",
            Self::Tube(..) => "constricting tube",
        }
    }

    /// Its parameters as text.
    pub fn parameters(self) -> String {
        match self {
            Self::RepeatedRoot | Self::Profile | Self::ProfilePointwise | Self::LowPeak => "-".to_owned(),
            Self::Exponential(a) => format!("a = {a}"),
            Self::HighOrder([p, q]) => format!("p = {p}, {q}"),
            Self::FiniteTime([p1, p2], q) => format!("p = {p1}, {p2}; q = {q}"),
            Self::FirstOrder(p, k) => format!("p = {p}; k = {k}"),
            Self::Tube(k, a) => format!("k = {k}; a = {a}"),
        }
    }

    /// Number of free parameters.
    pub fn parameter_count(self) -> usize {
        match self {
            Self::RepeatedRoot | Self::Profile | Self::ProfilePointwise | Self::LowPeak => 0,
            Self::Exponential(_) => 1,
            Self::HighOrder(_) | Self::FirstOrder(..) | Self::Tube(..) => 2,
            Self::FiniteTime(..) => 3,
        }
    }

    /// The baselines of the literature with our default parameters: a = 20/T as in our own default for a rate
    /// of errors against a moving bound, 1 for the gains of chains, 1/2 for exponents.
    pub fn defaults(deadline: f64) -> [Self; 5] {
        let rate = BarrierSettings::default_rate(deadline, 0.0);
        [
            Self::Exponential(1.0),
            Self::HighOrder([1.0, 1.0]),
            Self::FiniteTime([1.0, 1.0], 0.5),
            Self::FirstOrder(0.5, rate),
            Self::Tube(2, rate),
        ]
    }

    /// The candidates of [`super::search`] for the same method; none if it has no free parameters.
    pub fn candidates(self) -> Vec<Self> {
        let powers = |from: i32, to: i32| (from..=to).map(|e| elementary::powi(2.0, e));
        match self {
            Self::Exponential(_) => {
                let rates = [0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0, 23.0, 32.0];
                rates.map(Self::Exponential).into()
            }
            Self::HighOrder(_) => {
                // The order of the two gains does not matter.
                let pairs = powers(-2, 5).flat_map(|p| powers(-2, 5).map(move |q| [p, q]));
                pairs.filter(|[p, q]| p <= q).map(Self::HighOrder).collect()
            }
            Self::FiniteTime(..) => {
                let gains = powers(-1, 8).flat_map(|p| powers(-1, 6).map(move |q| [p, q]));
                let all = gains.flat_map(|gains| [0.25, 0.5, 0.75, 0.9].map(|q| Self::FiniteTime(gains, q)));
                all.collect()
            }
            Self::FirstOrder(..) => [0.25, 0.5, 0.75, 0.9]
                .into_iter()
                .flat_map(|p| powers(0, 5).map(move |k| Self::FirstOrder(p, k)))
                .collect(),
            Self::Tube(..) => {
                let rates = [1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0];
                (2..=4).flat_map(|k| rates.map(|a| Self::Tube(k, a))).collect()
            }
            _ => Vec::new(),
        }
    }

    /// The filter with this constraint on `source`.
    ///
    /// # Errors
    ///
    /// A parameter out of range.
    pub fn filter(
        self,
        source: Box<dyn DerivativeSource>,
        setup: &super::Setup,
    ) -> Result<Filter, punctual_core::Error> {
        let mut settings = BarrierSettings::within(setup.deadline).margin(setup.margin);
        match self {
            Self::RepeatedRoot => settings.method = Method::RepeatedRoot,
            Self::LowPeak => settings.profile = ProfileKind::LowPeak,
            _ => {}
        }
        let builder = Filter::from_sources(source.state_dim(), source.input_dim());
        let builder = builder.source("goal", source, settings)?;
        let builder = match self {
            Self::Exponential(a) => builder.condition(Exponential::repeated(2, a)?)?,
            Self::HighOrder(gains) => builder.condition(Chain::linear(&gains)?)?,
            Self::FiniteTime(gains, q) => builder.condition(Chain::finite_time(&gains, &[q, q])?)?,
            Self::FirstOrder(p, k) => {
                builder.condition(FirstOrderFixedTime::new(2, Exponent::new(p)?, k)?)?
            }
            Self::Tube(power, rate) => builder.condition(Tube::new(2, power, rate)?)?,
            _ => builder,
        };
        let builder = match setup.bounds {
            Some(bounds) => builder.bounds(&bounds.map(|b| -b), &bounds)?,
            None => builder,
        };
        builder.sampling(self.sampling(setup.step)).and_then(FilterBuilder::build)
    }

    /// How the period between samples is treated; `step` is the first one, in s.
    pub fn sampling(self, step: f64) -> Sampling {
        match self {
            Self::Profile | Self::LowPeak => Sampling::Measured { first: Some(step) },
            _ => Sampling::Pointwise,
        }
    }
}
