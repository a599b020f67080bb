//! gatekeeper: the nominal controller for as long as the backup saves from where it leads.

use std::collections::VecDeque;

use punctual_core::barrier::Barrier;
use punctual_core::dynamics::ControlAffine;

use super::backup::{Backup, Law};

/// At every sample a candidate follows the nominal controller for a time and the backup from then on. The one that
/// follows it longest and is valid is committed. Where none is, the committed one goes on.
///
/// Valid is a candidate that is safe at every sample of it, and whose backup ends in the terminal set within its
/// horizon. The nominal controller has to be known ahead, as a function of time and state: this is asked of no other
/// filter here. Its times are whole periods, tried from the longest down, as in the source.
///
/// It promises h ≥ 0 from the first sample on, where there is a valid candidate there. It can be asked for no set that
/// the start is outside of, and for no deadline. The source also has disturbances and sets that are seen step by step;
/// neither is here.
///
/// # References
///
/// D. R. Agrawal, R. Chen and D. Panagou, *gatekeeper: online safety verification and control for nonlinear systems in
/// dynamic environments*, arXiv:2211.14361.
#[derive(Clone, Debug)]
pub struct Gatekeeper<P, L, B, C, const NU: usize> {
    backup: Backup<P, L, B, C>,
    lead: usize,
    /// The nominal inputs that are left before the backup of what is committed; `None` before anything was.
    committed: Option<VecDeque<[f64; NU]>>,
}

impl<P, L, B, C, const NU: usize> Gatekeeper<P, L, B, C, NU> {
    /// Follows the nominal controller for at most `lead` periods at a time.
    pub fn new(backup: Backup<P, L, B, C>, lead: usize) -> Self {
        Self { backup, lead, committed: None }
    }

    /// The input at time `t` and state `x`, for a nominal controller u_ref = `nominal`(t, x), taken within the bounds.
    /// `None` where nothing is committed: no candidate was valid, then or before, and nothing is promised.
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
        // The way under the nominal controller, as far as it is safe.
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
        let way = driven([0.0, 0.0], 600, |t, x| {
            gatekeeper.step(t, x, |_, _| [LIMIT]).expect("a backup from rest")
        });
        let last = way.last().expect("a way").0;
        assert!(way.iter().all(|(x, _)| x[0] <= WALL));
        // At rest, no further from the wall than one held push and the path that it takes to stop cost.
        assert!(last[1].abs() < 1e-6 && last[0] > WALL - 0.02, "{last:?}");
        // Untouched until the path that it takes to stop at `LIMIT` is all that is left.
        let touched = way.iter().find(|(_, u)| u[0] != LIMIT).expect("some").0;
        let left = WALL - touched[0];
        let needed = touched[1] * touched[1] / (2.0 * LIMIT);
        assert!(left >= needed && left < needed + 2.5 * touched[1] * PERIOD, "{left} for {needed}");
    }

    #[test]
    fn leaves_alone_what_never_comes_near() {
        let mut gatekeeper = Gatekeeper::new(backup(), 10);
        let way =
            driven([0.0, 0.0], 300, |t, x| gatekeeper.step(t, x, |t, _| [0.3 * t.cos()]).expect("a backup"));
        assert!(way.iter().enumerate().all(|(k, (_, u))| u[0] == 0.3 * (k as f64 * PERIOD).cos()));
    }

    #[test]
    fn refuses_a_start_that_cannot_stop() {
        // 8 m/s need 16 m, and there are 10.
        let mut gatekeeper = Gatekeeper::new(backup(), 10);
        assert_eq!(gatekeeper.step(0.0, &[0.0, 8.0], |_, _| [0.0]), None);
        // Once committed, the committed one goes on where the model is left.
        assert!(gatekeeper.step(0.0, &[0.0, 1.0], |_, _| [0.0]).is_some());
        assert!(gatekeeper.step(PERIOD, &[0.0, 8.0], |_, _| [0.0]).is_some());
    }
}
