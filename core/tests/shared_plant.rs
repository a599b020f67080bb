//! Barriers along one plant share what depends on it alone, and every bit is that of barriers that do not.

#![expect(clippy::float_cmp, reason = "the numbers have to be the same to the bit")]

use crate::draw;
use crate::support;

use std::sync::Arc;

use draw::Draw;
use punctual_core::barriers::{DistanceDisc, Outside, StateBound};
use punctual_core::dynamics::{ControlAffine, rk4_step};
use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder};
use punctual_core::lie::{self, DerivativeSource, SharedPlant};
use punctual_core::plants::{Bicycle, PointMass, Unicycle};
use support::Reduced;

/// A source, or the same one alone.
fn source(source: Box<dyn DerivativeSource>, alone: bool) -> Box<dyn DerivativeSource> {
    if alone { Box::new(Reduced::alone(source)) } else { source }
}

/// A goal, some obstacles, and a limit of the speed, which has another relative degree.
fn filter<P>(plant: P, draw: &mut Draw, alone: bool) -> Filter
where
    P: ControlAffine<4, 2> + Copy + Send + Sync + 'static,
{
    let plant = Arc::new(plant);
    let disc = |x, y, radius| DistanceDisc::new([x, y], radius, 1.0).expect("a disc");
    let along = |barrier| source(lie::along(Arc::clone(&plant), barrier, 2).expect("a degree"), alone);
    let mut builder = Filter::from_sources(4, 2)
        .source("goal", along(disc(20.0, 10.0, 2.0)), BarrierSettings::within(6.0))
        .expect("a barrier");
    for i in 0..4 {
        let [x, y] = [(); 2].map(|()| draw.uniform(4.0, 18.0));
        let clear =
            source(lie::along(Arc::clone(&plant), Outside(disc(x, y, 1.5)), 2).expect("a degree"), alone);
        builder =
            builder.source(&format!("clear {i}"), clear, BarrierSettings::keeping()).expect("a barrier");
    }
    let fast =
        lie::along(Arc::clone(&plant), StateBound::at_most(3, 9.0).expect("a bound"), 1).expect("a degree");
    builder
        .source("fast", source(fast, alone), BarrierSettings::keeping())
        .and_then(|b| b.bounds(&[-6.0, -2.0], &[6.0, 2.0]))
        .and_then(|b| b.actuation_delay(if draw.uniform(0.0, 1.0) < 0.3 { 0.01 } else { 0.0 }))
        .and_then(FilterBuilder::build)
        .expect("a filter")
}

fn agrees<P>(plant: P, seed: u64)
where
    P: ControlAffine<4, 2> + Copy + Send + Sync + 'static,
{
    let [mut shared, mut alone] = [false, true].map(|alone| filter(plant, &mut Draw::new(seed), alone));
    let mut draw = Draw::new(seed + 1000);
    let mut x = [0.0, 0.0, draw.uniform(0.0, 1.0), draw.uniform(0.0, 5.0)];
    let mut t = 0.0;
    for k in 0..400 {
        let u_ref =
            [draw.uniform(-6.0, 6.0), draw.uniform(-2.0, 2.0)].map(|u| if k % 3 == 0 { 0.0 } else { u });
        let (mut u, mut wanted) = ([0.0; 2], [0.0; 2]);
        let report = shared.step(t, &x, &u_ref, &mut u).expect("right dimensions");
        let expected = alone.step(t, &x, &u_ref, &mut wanted).expect("right dimensions");
        assert_eq!((report, u), (expected, wanted), "seed {seed}, step {k}");
        assert_eq!(shared.state(), alone.state(), "seed {seed}, step {k}");
        let dt = draw.uniform(0.005, 0.05);
        (x, t) = (rk4_step(&plant, &x, &u, dt), t + dt);
    }
}

#[test]
fn barriers_that_share_a_plant_have_the_same_bits() {
    for seed in 0..8 {
        agrees(Unicycle, seed);
        agrees(PointMass, seed);
        agrees(Bicycle::new(2.0 + seed as f64).expect("a length"), seed);
    }
}

/// Two plants of one type are not taken for one another.
#[test]
fn two_plants_share_nothing() {
    let bicycle = |l_r| Bicycle::new(l_r).expect("a length");
    let [one, other] = [1.0, 1.0].map(|l_r| Arc::new(bicycle(l_r)));
    let id = |plant: &Arc<Bicycle>| {
        let source = lie::along(Arc::clone(plant), DistanceDisc::new([20.0, 10.0], 2.0, 1.0)?, 2)?;
        Ok::<_, punctual_core::Error>(source.shared().map(SharedPlant::plant))
    };
    assert_eq!(id(&one), id(&one));
    assert_ne!(id(&one), id(&other));
    // Two barriers along two bicycles: each step goes by both, as it does where they share nothing.
    let disc = || DistanceDisc::new([20.0, 10.0], 2.0, 1.0).expect("a disc");
    let built = |alone: bool| {
        let along = |l_r| source(lie::along(Arc::new(bicycle(l_r)), disc(), 2).expect("a degree"), alone);
        Filter::from_sources(4, 2)
            .source("short", along(1.0), BarrierSettings::within(6.0))
            .and_then(|b| b.source("long", along(4.0), BarrierSettings::within(5.0)))
            .and_then(FilterBuilder::build)
            .expect("a filter")
    };
    let [mut shared, mut alone] = [false, true].map(built);
    let (mut u, mut wanted) = ([0.0; 2], [0.0; 2]);
    let x = [0.0, 0.0, 0.3, 4.0];
    let report = shared.step(0.0, &x, &[0.0; 2], &mut u).expect("right dimensions");
    assert_ne!(report.barriers[0].row.normal, report.barriers[1].row.normal);
    let expected = alone.step(0.0, &x, &[0.0; 2], &mut wanted).expect("right dimensions");
    assert_eq!((report, u), (expected, wanted));
    // A plant that is put in the place of another one shares with it no more, and then again.
    for l_r in [1.0, 4.0] {
        for (filter, is_alone) in [(&mut shared, false), (&mut alone, true)] {
            let other = source(lie::along(Arc::new(bicycle(l_r)), disc(), 2).expect("a degree"), is_alone);
            filter.set_source(0, other).expect("the same degree");
        }
        let report = shared.step(0.1, &x, &[0.0; 2], &mut u).expect("right dimensions");
        let expected = alone.step(0.1, &x, &[0.0; 2], &mut wanted).expect("right dimensions");
        assert_eq!((report, u), (expected, wanted), "{l_r}");
    }
}
