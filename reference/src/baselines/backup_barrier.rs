//! The backup control barrier function.

use std::array::from_fn;

use punctual_core::barrier::Barrier;
use punctual_core::dynamics::ControlAffine;
use punctual_core::error::{Error, ErrorKind, positive};
use punctual_core::filter::FilterBuilder;
use punctual_core::jet::Tangent;
use punctual_core::qp::{Outcome, Problem, Row, Workspace};
use punctual_core::{MAX_INPUTS, MAX_ROWS};

use super::backup::{Backup, Law};

/// The input closest to u_ref such that d/dt h(φ(τ, x)) ≥ −α h(φ(τ, x)) for τ on a grid, and the same for the
/// terminal set at the end of the grid. φ(τ, x) is the state to which the backup leads from x in the time τ.
///
/// The derivatives are ∇h Dφ (f + g u), exact along the flow with held inputs. There is no row for τ = 0,
/// since for a relative degree above 1 it contains no input. The method keeps the set of states from which
/// the backup is safe until the end of the grid and in the terminal set there. As in the source, the rows are
/// those of continuous time. They do not account for held inputs, or for times between grid points.
///
/// It promises h ≥ 0 if the start is in that set, the rows can be met, and samples are dense. It supports no
/// start outside the set, and no deadline.
///
/// # References
///
/// T. Gurriet, M. Mote, A. D. Ames and E. Feron, *An online approach to active set invariance*, IEEE Conf. Decision and
/// Control (2018). Y. Chen, M. Jankovic, M. Santillo and A. D. Ames, *Backup control barrier functions: formulation and
/// comparative study*, IEEE Conf. Decision and Control (2021), arXiv:2104.11332.
pub struct BackupBarrier<P, L, B, C> {
    backup: Backup<P, L, B, C>,
    rate: f64,
    workspace: Workspace,
}

/// A step of a [`BackupBarrier`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BackedUp<const NU: usize> {
    /// The input: that of the quadratic program, or that of the backup if the rows cannot be met.
    pub input: [f64; NU],
    /// Whether the rows were met.
    pub met: bool,
    /// The least value of h along the backup and of the terminal set's barrier at its end, in the unit of h:
    /// ≥ 0 in the set that is kept.
    pub least: f64,
}

impl<P, L, B, C> BackupBarrier<P, L, B, C> {
    /// With α = `rate` in 1/s, finite, > 0.
    ///
    /// # Errors
    ///
    /// A rate out of range, or a horizon with more rows than a quadratic program may have.
    pub fn new(backup: Backup<P, L, B, C>, rate: f64) -> Result<Self, Error> {
        if backup.horizon >= MAX_ROWS {
            let message = format!("is {} periods, must be < {MAX_ROWS}", backup.horizon);
            return Err(Error::new(ErrorKind::Range, "horizon", message));
        }
        Ok(Self { backup, rate: positive("rate", rate)?, workspace: Workspace::default() })
    }

    /// The input closest to `u_ref` at time `t` and state `x`.
    pub fn step<const NX: usize, const NU: usize>(
        &mut self,
        t: f64,
        x: &[f64; NX],
        u_ref: &[f64; NU],
    ) -> BackedUp<NU>
    where
        P: ControlAffine<NX, NU>,
        L: Law<NX, NU>,
        B: Barrier<NX>,
        C: Barrier<NX>,
    {
        let (drift, map) = (self.backup.plant.drift(x), self.backup.plant.input_map(x));
        // The rate of every value is its rate along f plus, for each column of g, the rate along it times the
        // input.
        let along_drift = self.along(t, x, &drift);
        let mut rows: Vec<Row> = along_drift
            .iter()
            .map(|(value, slope)| Row { floor: -self.rate * value - slope, ..Row::ZERO })
            .collect();
        for j in 0..NU.min(MAX_INPUTS) {
            let slopes = self.along(t, x, &map.map(|row| row[j]));
            for (row, (_, slope)) in rows.iter_mut().zip(slopes) {
                row.normal[j] = slope;
            }
        }
        let least = along_drift.iter().map(|(value, _)| *value).fold(self.backup.safe.value(t, x), f64::min);
        let mut input = *u_ref;
        let problem =
            Problem::new(&rows, &self.backup.bounds, u_ref, FilterBuilder::DEFAULT_CORRECTION_LIMIT);
        let met = self.workspace.solve(&problem, &mut input).outcome == Outcome::Optimal;
        if !met {
            input = self.backup.law.input(x);
        }
        BackedUp { input, met, least }
    }

    /// h and its derivative along `direction` at every grid point of the backup except the first, and those
    /// of the terminal set's barrier at its end.
    fn along<const NX: usize, const NU: usize>(
        &self,
        t: f64,
        x: &[f64; NX],
        direction: &[f64; NX],
    ) -> Vec<(f64, f64)>
    where
        P: ControlAffine<NX, NU>,
        L: Law<NX, NU>,
        B: Barrier<NX>,
        C: Barrier<NX>,
    {
        let mut x = from_fn(|i| Tangent { value: x[i], directional: direction[i] });
        let mut found = Vec::with_capacity(self.backup.horizon + 1);
        let mut at = Tangent::from(t);
        for k in 1..=self.backup.horizon {
            x = self.backup.moved(&x, &self.backup.law.input(&x));
            at = Tangent::from(t + k as f64 * self.backup.period);
            found.push(self.backup.safe.value(at, &x));
        }
        found.push(self.backup.terminal.value(at, &x));
        found.into_iter().map(|h: Tangent<f64>| (h.value, h.directional)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::double_integrator::{LIMIT, PERIOD, WALL, backup, driven};
    use super::*;

    #[test]
    fn stops_before_the_wall_that_it_is_pushed_into() {
        let mut filter = BackupBarrier::new(backup(), 2.0).expect("valid");
        let trajectory = driven([0.0, 0.0], 900, |t, x| {
            let step = filter.step(t, x, &[LIMIT]);
            assert!(step.least > -1e-3 && step.input[0].abs() <= LIMIT, "{step:?} at {x:?}");
            step.input
        });
        let last = trajectory.last().expect("a trajectory").0;
        assert!(trajectory.iter().all(|(x, _)| x[0] <= WALL));
        assert!(last[1].abs() < 1e-2 && last[0] > WALL - 0.1, "{last:?}");
        // At this distance no input within the limit matters, so u_ref is unchanged.
        assert_eq!(trajectory[0].1[0], LIMIT);
    }

    /// Below the limit the brake is v̇ = −k v, held over the period. In each period v falls by the factor 1 −
    /// kδ, and x moves by v δ (1 − kδ/2). So the rate of each row is known.
    #[test]
    fn the_rows_are_those_of_the_flow() {
        let backup = backup();
        let (gain, n) = (backup.law.gain, backup.horizon as i32);
        let filter = BackupBarrier::new(backup, 2.0).expect("valid");
        let x = [3.0, 0.05];
        let moved = |k: i32| {
            let left = (1.0 - gain * PERIOD).powi(k);
            (1.0 - gain * PERIOD / 2.0) * (1.0 - left) / gain
        };
        let found = filter.along::<2, 1>(0.0, &x, &[0.0, 1.0]);
        assert_eq!(found.len(), n as usize + 1);
        for k in 1..=n {
            let (h, slope) = found[k as usize - 1];
            assert!((h - (WALL - 3.0 - 0.05 * moved(k))).abs() < 1e-12, "{h} at {k}");
            assert!((slope + moved(k)).abs() < 1e-12, "{slope} at {k}");
        }
    }

    #[test]
    fn numbers_out_of_range_are_refused() {
        let refused = |backup: Backup<_, _, _, _>, rate: f64| {
            BackupBarrier::new(backup, rate).err().map(|e| e.to_string()).unwrap_or_default()
        };
        assert_eq!(refused(backup(), 0.0), "rate: is 0, must be finite and > 0");
        assert_eq!(
            refused(Backup { horizon: 128, ..backup() }, 1.0),
            "horizon: is 128 periods, must be < 128"
        );
        let period = Backup { period: -1.0, ..backup() }.validated().err().map(|e| e.to_string());
        assert_eq!(period.unwrap_or_default(), "period: is -1, must be finite and > 0");
    }
}
