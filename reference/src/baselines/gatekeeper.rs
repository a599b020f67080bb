//! gatekeeper: follows the nominal controller as long as the backup keeps the system safe from where it
//! leads.

use std::collections::VecDeque;

use punctual_core::barrier::Barrier;
use punctual_core::dynamics::ControlAffine;

use super::backup::{Backup, Law};

/// At every sample, a candidate follows the nominal controller for some time and the backup from then on. The
/// valid candidate that follows it longest is committed. If there is none, the committed one continues.
///
/// A candidate is valid if it is safe at every sample, and its backup ends in the terminal set within the
/// horizon. The nominal controller must be known in advance as a function of time and state, which no other
/// filter here requires. Switching times are whole periods, tried from the longest down, as in the source.
///
/// It promises h ≥ 0 from the first sample on if there is a valid candidate then. It supports no start
/// outside the set, and no deadline. The source also has disturbances and sets that become known step by
/// step; neither is implemented here.
///
/// # References
///
/// D. R. Agrawal, R. Chen and D. Panagou, *gatekeeper: online safety verification and control for nonlinear systems in
/// dynamic environments*, arXiv:2211.14361.
#[derive(Clone, Debug)]
pub struct Gatekeeper<P, L, B, C, const NU: usize> {
    backup: Backup<P, L, B, C>,
    lead: usize,
    /// The nominal inputs that remain before the committed candidate's backup; `None` before anything is
    /// committed.
    committed: Option<VecDeque<[f64; NU]>>,
}

impl<P, L, B, C, const NU: usize> Gatekeeper<P, L, B, C, NU> {
    /// A filter that follows the nominal controller for at most `lead` periods at a time.
    pub fn new(backup: Backup<P, L, B, C>, lead: usize) -> Self {
        Self { backup, lead, committed: None }
    }

    /// The input at time `t` and state `x`, for a nominal controller u_ref = `nominal`(t, x), clamped to the
    /// bounds. `None` if nothing is committed: no candidate has been valid so far, and nothing is promised.
    pub fn step<const NX: usize>(
        &mut self,
        t: f64,
        x: &[f64; NX],
        nominal: impl Fn(f64, &[f64; NX]) -> [f64; NU],
    ) -> Option<[f64; NU]>
    where
        P: ControlAffine<NX, NU>,
        L: Law<NX, NU>,
        B: Barrier<NX>,
        C: Barrier<NX>,
    {
        let backup = &self.backup;
        let time = |k: usize| t + k as f64 * backup.period;
        // The trajectory under the nominal controller, as long as it is safe.
        let (mut inputs, mut states) = (VecDeque::new(), vec![*x]);
        while inputs.len() < self.lead {
            let (k, at) = (inputs.len(), states[inputs.len()]);
            let u = backup.bounded(&nominal(time(k), &at));
            let next = backup.moved(&at, &u);
            if backup.safe.value(time(k + 1), &next) < 0.0 {
                break;
            }
            inputs.push_back(u);
            states.push(next);
        }
        let switch = (0..states.len()).rev().find(|&k| backup.saves(time(k), &states[k]));
        if let Some(switch) = switch {
            inputs.truncate(switch);
            self.committed = Some(inputs);
        }
        let next = self.committed.as_mut()?.pop_front();
        Some(next.unwrap_or_else(|| backup.law.input(x)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::double_integrator::{LIMIT, PERIOD, WALL, backup, driven};
    use super::*;

    #[test]
    fn stops_before_the_wall_that_it_is_pushed_into() {
        let mut gatekeeper = Gatekeeper::new(backup(), 10);
        let trajectory = driven([0.0, 0.0], 600, |t, x| {
            gatekeeper.step(t, x, |_, _| [LIMIT]).expect("a backup from rest")
        });
        let last = trajectory.last().expect("a trajectory").0;
        assert!(trajectory.iter().all(|(x, _)| x[0] <= WALL));
        // At rest, no further from the wall than the cost of one held push and its stopping distance.
        assert!(last[1].abs() < 1e-6 && last[0] > WALL - 0.02, "{last:?}");
        // u_ref is unchanged until only the stopping distance at `LIMIT` remains.
        let touched = trajectory.iter().find(|(_, u)| u[0] != LIMIT).expect("some").0;
        let left = WALL - touched[0];
        let needed = touched[1] * touched[1] / (2.0 * LIMIT);
        assert!(left >= needed && left < needed + 2.5 * touched[1] * PERIOD, "{left} for {needed}");
    }

    #[test]
    fn leaves_alone_what_never_comes_near() {
        let mut gatekeeper = Gatekeeper::new(backup(), 10);
        let trajectory =
            driven([0.0, 0.0], 300, |t, x| gatekeeper.step(t, x, |t, _| [0.3 * t.cos()]).expect("a backup"));
        assert!(trajectory.iter().enumerate().all(|(k, (_, u))| u[0] == 0.3 * (k as f64 * PERIOD).cos()));
    }

    #[test]
    fn refuses_a_start_that_cannot_stop() {
        // Stopping from 8 m/s takes 16 m, and there are 10.
        let mut gatekeeper = Gatekeeper::new(backup(), 10);
        assert_eq!(gatekeeper.step(0.0, &[0.0, 8.0], |_, _| [0.0]), None);
        // Once committed, a candidate continues even if the state leaves the model.
        assert!(gatekeeper.step(0.0, &[0.0, 1.0], |_, _| [0.0]).is_some());
        assert!(gatekeeper.step(PERIOD, &[0.0, 8.0], |_, _| [0.0]).is_some());
    }
}
