//! What is accepted is kept: random closed loops, checked by the judge at all instants.

use punctual_core::filter::AssuranceStatus;

use super::cases;
use crate::judge::families::assured;
use crate::judge::on_every_core;
use crate::judge::run::run_assured;

/// Vehicles of any kind, starts, deadlines, bounds, obstacles, regular and irregular steps announced to the
/// filter, and five ways to choose u_ref.
#[test]
fn table_of_assured_promises() {
    let count = cases(12, 10_000);
    let first = 0xa55e_0000_0000;
    let runs = on_every_core(count, |i| run_assured(&assured(first + i)));
    let accepted = runs.iter().filter(|run| run.refused.is_none());
    let number = |status: AssuranceStatus| accepted.clone().filter(|run| run.status == status).count();
    let (kept, irregular, lost) =
        (number(AssuranceStatus::Assured), number(AssuranceStatus::Irregular), number(AssuranceStatus::Lost));
    let samples: usize = accepted.clone().map(|run| run.run.samples).sum();
    let driven: usize = accepted.clone().map(|run| run.driven).sum();
    let infeasible: usize = accepted.clone().map(|run| run.infeasible).sum();
    let broken: Vec<_> =
        runs.iter().zip(first..).filter_map(|(run, seed)| Some((seed, run.broken()?))).collect();
    let accepted = accepted.count();
    println!(
        "{count} starts: accepted {accepted}, broken while assured {}, infeasible steps while assured {infeasible}; \
         assured to the end {kept}, ended by irregular steps {irregular}, lost {lost}; \
         the plan drove {driven} of {samples} steps",
        broken.len()
    );
    for (seed, (set, found)) in broken.iter().take(5) {
        println!("assured({seed:#x}), set {set}: {found:?}\n{:?}", assured(*seed));
    }
    for (run, seed) in runs.iter().zip(first..).filter(|(run, _)| run.status == AssuranceStatus::Lost).take(5)
    {
        println!("lost: assured({seed:#x}) after {} samples: {:?}", run.run.samples, assured(seed));
    }
    assert!(broken.is_empty(), "{} broken, {:?}", broken.len(), broken[0]);
    assert_eq!((infeasible, lost), (0, 0));
    assert!(4 * accepted as u64 >= count && driven > 0, "too hard or too easy to show anything");
}
