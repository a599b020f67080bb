//! Which alternatives are promised, and when visits are made: the candidates among which a first sample finds its plan.
//!
//! A visit may be made at any time of its window, and visits in any order. How far the sets are from the start and from each
//! other says at which pace a plant has to go for an order. The slowest pace wins: orders and alternatives are tried from
//! there on. No guarantee depends on it: a plan keeps the times that it was found for, which are within the windows.

use alloc::vec;
use alloc::vec::Vec;

use super::planning::{Model, Planning};
use super::settings::{DECISIONS, DecisionSettings};
use super::state::Promise;
use crate::elementary;
use crate::filter::Begin;
use crate::plan::{TOLERANCES, climb};

/// One way to take alternatives, and the orders in which to make the visits that are left.
pub(super) struct Choice {
    /// The promises, one per barrier, with visits as late as asked; without those that are let go.
    pub(super) latest: Vec<Option<Promise>>,
    /// The barriers of the alternatives that are not taken.
    pub(super) let_go: Vec<usize>,
    /// Whether no two visits are as late as asked at the same time in different places.
    pub(super) is_possible: bool,
    /// The best orders, the slowest first.
    pub(super) orders: Vec<Order>,
}

/// Visits in their order, then the set that is kept at the end, if there is one.
#[derive(Clone)]
pub(super) struct Order {
    stops: Vec<Stop>,
    is_kept_at_end: bool,
    /// The distance to each stop from the one before.
    legs: Vec<f64>,
    /// The slowest pace at which every stop is reached in time, as a distance per s.
    pace: f64,
    /// The time in s of each visit at that pace.
    times: Vec<f64>,
}

/// A visit of a schedule, or the set that is kept at its end.
#[derive(Clone, Copy)]
struct Stop {
    barrier: usize,
    /// The first and the last time in s at which it may begin, and how long it lasts.
    window: [f64; 2],
    length: f64,
}

/// How far the sets are from each other.
struct Map {
    /// The distance from the start to each set, and from each set to each other one; 0 for those that are no stops.
    from_start: Vec<f64>,
    between: Vec<Vec<f64>>,
}

impl Planning<'_> {
    /// What may be promised instead of `asked` from `x` at `t`: the ways to take one of each group of alternatives, the slowest
    /// first, each with the best orders of visits. `None` if there is nothing to choose.
    pub(super) fn ways(&self, asked: &[Option<Promise>], t: f64, x: &[f64]) -> Option<Vec<Choice>> {
        if self.plans.alternatives.is_empty() && self.visits(asked) == 0 {
            return None;
        }
        let map = self.map(asked, t, x);
        let way = |let_go| self.way(asked, let_go, t, &map);
        let mut ways: Vec<Choice> = self.choices().filter_map(way).collect();
        let pace = |way: &Choice| way.orders.first().map_or(0.0, |order| order.pace);
        ways.sort_by(|a, b| pace(a).total_cmp(&pace(b)));
        ways.truncate(DECISIONS.choices);
        Some(ways)
    }

    /// The number of visits among `promises`.
    pub(super) fn visits(&self, promises: &[Option<Promise>]) -> usize {
        let slots = self.rows.slots.iter().zip(promises);
        slots.filter(|(slot, promise)| promise.is_some() && self.visit(slot).is_some()).count()
    }

    /// The barriers that are let go, for each way to take one alternative of every group.
    pub(super) fn choices(&self) -> impl Iterator<Item = Vec<usize>> {
        let groups = &self.plans.alternatives;
        let count = groups.iter().map(Vec::len).fold(1, usize::saturating_mul);
        (0..count.min(DECISIONS.most_choices)).map(move |mut choice| {
            let mut let_go = Vec::new();
            for group in groups {
                let taken = choice % group.len();
                choice /= group.len();
                let others = group.iter().enumerate().filter(|(k, _)| *k != taken);
                let_go
                    .extend(others.flat_map(|(_, barriers)| barriers).filter(|i| !group[taken].contains(i)));
            }
            let_go
        })
    }

    /// The choice without the barriers `let_go`; `None` if one of the others cannot be promised, or no order is in time.
    fn way(&self, asked: &[Option<Promise>], let_go: Vec<usize>, t: f64, map: &Map) -> Option<Choice> {
        let mut latest = asked.to_vec();
        let_go.iter().for_each(|i| latest[*i] = None);
        self.link(&mut latest, t);
        let taken = self.plans.alternatives.iter().flatten().flatten().filter(|i| !let_go.contains(i));
        if taken.into_iter().any(|i| latest[*i].is_none()) {
            return None;
        }
        let slots = &self.rows.slots;
        let dated = |i: usize| latest[i].filter(|promise| promise.from > t && promise.from.is_finite());
        let stop = |barrier: usize| {
            let (promise, slot) = (dated(barrier)?, &slots[barrier]);
            let (length, sample) = (self.visit(slot)?, t - self.rows.delay);
            let begin = if let Begin::At(begin) = slot.begin { sample + begin } else { t };
            Some(Stop { barrier, window: [begin.min(promise.from), promise.from], length })
        };
        let visits: Vec<Stop> = (0..latest.len()).filter_map(stop).collect();
        let last = (0..latest.len())
            .filter(|i| self.visit(&slots[*i]).is_none() && slots[*i].promise.settings().deadline.is_some())
            .filter_map(|barrier| {
                let from = dated(barrier)?.from;
                Some(Stop { barrier, window: [from; 2], length: f64::INFINITY })
            })
            .max_by(|a, b| a.window[1].total_cmp(&b.window[1]));
        let ordered = |last: Option<Stop>| {
            let mut orders = Orders { planning: self, map, last, t, visits: &visits, found: Vec::new() };
            orders.extend(&mut Vec::new());
            orders.found
        };
        let mut orders = ordered(last);
        if orders.is_empty() {
            // Visits within a set that is kept meanwhile.
            orders = ordered(None);
        }
        orders.sort_by(|a, b| a.pace.total_cmp(&b.pace));
        orders.truncate(DECISIONS.orders);
        let overlap = |a: &Stop, b: &Stop| {
            let apart = map.between[a.barrier][b.barrier].min(map.between[b.barrier][a.barrier]) > 0.0;
            apart && a.window[1] < b.window[1] + b.length && b.window[1] < a.window[1] + a.length
        };
        let all: Vec<&Stop> = visits.iter().chain(&last).collect();
        let is_possible = (0..all.len()).all(|i| (0..i).all(|j| !overlap(all[i], all[j])));
        (!orders.is_empty()).then_some(Choice { latest, let_go, is_possible, orders })
    }

    /// `latest` with the visits of `order` at its times, from `t` on; `None` if they are no earlier.
    pub(super) fn at_times(
        &self,
        latest: &[Option<Promise>],
        order: &Order,
        t: f64,
    ) -> Option<Vec<Option<Promise>>> {
        let mut promises = latest.to_vec();
        let mut is_earlier = false;
        for (stop, from) in order.stops.iter().zip(&order.times) {
            let until = from + stop.length;
            let Some(promise) = &mut promises[stop.barrier] else { continue };
            is_earlier |= promise.from - from >= self.plans.period;
            *promise = Promise { from: *from, until, ..*promise };
        }
        self.link(&mut promises, t);
        is_earlier.then_some(promises)
    }

    /// How far the sets of `asked` are from `x` at `t`, and from each other: as far as climbing their h leads.
    fn map(&self, asked: &[Option<Promise>], t: f64, x: &[f64]) -> Map {
        let DecisionSettings { climbs, climb_halvings, .. } = DECISIONS;
        let models: Vec<Model<'_>> = self.models().collect();
        let count = asked.len();
        let reach = |i: usize, from: &[f64]| {
            let mut place = from.to_vec();
            let promise = asked[i]?;
            climb(&*models[i], promise.from, &mut place, promise.margin, [climbs, climb_halvings]);
            Some(place)
        };
        let is_stop = |i: &usize| {
            asked[*i].is_some_and(|promise| promise.from > t)
                && self.rows.slots[*i].promise.settings().deadline.is_some()
        };
        let stops: Vec<usize> = (0..count).filter(is_stop).collect();
        let mut map = Map { from_start: vec![0.0; count], between: vec![vec![0.0; count]; count] };
        for &i in &stops {
            let Some(place) = reach(i, x) else { continue };
            map.from_start[i] = distance(x, &place);
            for &j in stops.iter().filter(|j| **j != i) {
                map.between[i][j] = reach(j, &place).map_or(0.0, |other| distance(&place, &other));
            }
        }
        map
    }
}

impl Order {
    /// The same order with more time for the way to `barrier`, from `t` on, for samples that are `period` s apart; `None` if it
    /// is no stop, or if there is no time.
    pub(super) fn slower_to(&self, barrier: usize, t: f64, period: f64) -> Option<Self> {
        let mut order = self.clone();
        let stop = order.stops.iter().position(|stop| stop.barrier == barrier)?;
        order.legs[stop] = DECISIONS.slower * order.legs[stop].max(f64::MIN_POSITIVE);
        order.pace(t, period).then_some(order)
    }

    /// Finds the slowest pace, and the times. Returns whether there is one.
    fn pace(&mut self, t: f64, period: f64) -> bool {
        let visits = self.stops.len() - usize::from(self.is_kept_at_end);
        let go = |pace: f64| {
            let (mut at, mut times) = (t, Vec::with_capacity(visits));
            for (k, Stop { window: [first, latest], length, .. }) in self.stops.iter().enumerate() {
                at += self.legs[k] / pace;
                if k < visits {
                    // A visit at once would have to be one already.
                    at = at.max(*first).max(t + period);
                }
                if at > latest + TOLERANCES.on_time * period {
                    return None;
                }
                if k < visits {
                    times.push(at.min(*latest));
                    at += length;
                }
            }
            Some(times)
        };
        let (total, DecisionSettings { paces: [slow, fast], halvings, .. }) =
            (self.legs.iter().sum::<f64>().max(f64::MIN_POSITIVE), DECISIONS);
        let (mut low, mut high) = (slow * total, fast * total);
        let Some(mut found) = go(high) else { return false };
        for _ in 0..halvings {
            let middle = elementary::sqrt(low * high);
            match go(middle) {
                Some(times) => (high, found) = (middle, times),
                None => low = middle,
            }
        }
        (self.pace, self.times) = (high, found);
        true
    }
}

/// The search for orders of visits.
struct Orders<'a> {
    planning: &'a Planning<'a>,
    map: &'a Map,
    last: Option<Stop>,
    t: f64,
    visits: &'a [Stop],
    found: Vec<Order>,
}

impl Orders<'_> {
    /// Tries every order that begins with `order`, the nearest visit first; of many visits only the nearest ones.
    fn extend(&mut self, order: &mut Vec<usize>) {
        if order.len() == self.visits.len() {
            self.found.extend(self.paced(order));
            return;
        }
        let from = order.last().map(|k| self.visits[*k].barrier);
        let is_next = |k: &usize| !order.contains(k) && self.may_follow(*k, order);
        let mut next: Vec<usize> = (0..self.visits.len()).filter(is_next).collect();
        let away = |k: &usize| self.leg(from, self.visits[*k].barrier);
        next.sort_by(|a, b| away(a).total_cmp(&away(b)));
        let most = if self.visits.len() <= DECISIONS.all_orders { usize::MAX } else { 1 };
        for k in next.into_iter().take(most) {
            order.push(k);
            self.extend(order);
            order.pop();
        }
    }

    /// Whether visit `k` may come next: what it waits for is in `order`, or is no visit.
    fn may_follow(&self, k: usize, order: &[usize]) -> bool {
        let Begin::AfterArrival(other) = self.planning.rows.slots[self.visits[k].barrier].begin else {
            return true;
        };
        let is_later = |i: usize| self.visits[i].barrier == other && !order.contains(&i);
        !(0..self.visits.len()).any(is_later)
    }

    fn leg(&self, from: Option<usize>, to: usize) -> f64 {
        from.map_or(self.map.from_start[to], |from| self.map.between[from][to])
    }

    /// The visits in `order`, at the slowest pace at which each is made within its window, and the last set reached in time.
    fn paced(&self, order: &[usize]) -> Option<Order> {
        let stops: Vec<Stop> = order.iter().map(|k| self.visits[*k]).chain(self.last).collect();
        let before = core::iter::once(None).chain(stops.iter().map(|stop| Some(stop.barrier)));
        let legs = before.zip(&stops).map(|(from, stop)| self.leg(from, stop.barrier)).collect();
        let is_kept_at_end = self.last.is_some();
        let mut order = Order { stops, is_kept_at_end, legs, pace: 0.0, times: Vec::new() };
        order.pace(self.t, self.planning.plans.period).then_some(order)
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    elementary::sqrt(a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum())
}
