//! The order of components within a communication step.
//!
//! An output has direct feedthrough if it depends on an input at the same instant. A component with such an
//! output must run before each reader of it, and after each component that feeds it. All other components
//! keep their outputs until they step, so they run last, in any order. The order is a topological one of the
//! signals that come from feedthrough outputs. If these form a cycle, it is cut at its first component in
//! file order, and the signals into that component are read one step late.

/// A signal between two components.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Edge {
    /// The component whose output it is.
    pub(super) from: usize,
    /// The component that reads it.
    pub(super) to: usize,
    /// Whether an output of `to` depends on it directly. Signals that act only through the state are kept
    /// undelayed if possible, but never at the cost of cutting a chain of direct ones.
    pub(super) direct: bool,
}

/// Orders the components `members` (positions in file order) so that as few `edges` as possible point backwards.
/// Edges that touch other components are ignored.
pub(super) fn order(members: &[usize], edges: &[Edge]) -> Vec<usize> {
    let mut waiting = members.to_vec();
    let mut order = Vec::with_capacity(members.len());
    while !waiting.is_empty() {
        let free = |only_direct: bool| {
            waiting.iter().position(|&c| {
                !edges.iter().any(|e| {
                    e.to == c && e.from != c && waiting.contains(&e.from) && (e.direct || !only_direct)
                })
            })
        };
        let next = free(false).or_else(|| free(true)).unwrap_or_else(|| first_of_a_cycle(&waiting, edges));
        order.push(waiting.remove(next));
    }
    order
}

/// The position in `waiting` of the first component of a cycle of direct edges that no other waiting
/// component leads into. Such a cycle exists whenever every component waits for another.
fn first_of_a_cycle(waiting: &[usize], edges: &[Edge]) -> usize {
    let reached_from = |start: usize| {
        let mut reached = vec![start];
        let mut next = 0;
        while next < reached.len() {
            let from = reached[next];
            for e in edges.iter().filter(|e| e.direct && e.from == from && waiting.contains(&e.to)) {
                if !reached.contains(&e.to) {
                    reached.push(e.to);
                }
            }
            next += 1;
        }
        reached
    };
    let reached: Vec<Vec<usize>> = waiting.iter().map(|&c| reached_from(c)).collect();
    (0..waiting.len())
        .find(|&i| {
            (0..waiting.len()).all(|j| !reached[j].contains(&waiting[i]) || reached[i].contains(&waiting[j]))
        })
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn direct(pairs: &[(usize, usize)]) -> Vec<Edge> {
        pairs.iter().map(|&(from, to)| Edge { from, to, direct: true }).collect()
    }

    #[test]
    fn a_chain_is_followed_whatever_the_file_order() {
        assert_eq!(order(&[0, 1, 2], &direct(&[(2, 1), (1, 0)])), [2, 1, 0]);
        assert_eq!(order(&[0, 1, 2, 3], &direct(&[(3, 0), (3, 1), (0, 2), (1, 2)])), [3, 0, 1, 2]);
    }

    #[test]
    fn unrelated_components_keep_the_file_order() {
        assert_eq!(order(&[4, 1, 3], &direct(&[(1, 0), (0, 4)])), [4, 1, 3]);
    }

    #[test]
    fn a_cycle_is_cut_at_its_first_component_only() {
        // 3 feeds the cycle 0 → 2 → 1 → 0, which feeds 4.
        let edges = direct(&[(0, 2), (2, 1), (1, 0), (3, 2), (1, 4)]);
        assert_eq!(order(&[4, 0, 1, 2, 3], &edges), [3, 0, 2, 1, 4]);
        assert_eq!(order(&[0], &direct(&[(0, 0)])), [0]);
    }

    #[test]
    fn signals_into_the_state_do_not_cut_direct_chains() {
        let mut edges = direct(&[(1, 0)]);
        edges.push(Edge { from: 0, to: 1, direct: false });
        assert_eq!(order(&[0, 1], &edges), [1, 0]);
    }
}
