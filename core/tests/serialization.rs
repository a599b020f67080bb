//! States, reports and settings as JSON, and back.

use crate::scenario;

use proptest::prelude::*;
use punctual_core::convergence::operator::Operator;
use punctual_core::convergence::{FixedTimeState, Phase, Unmet};
use punctual_core::dynamics::rk4_step;
use punctual_core::filter::{
    BarrierSettings, Begin, Curvature, End, Filter, FilterBuilder, FilterState, Integration, Method, Report,
    SampleDerivative, Sampling, Strictness,
};
use punctual_core::lie::Direction;
use punctual_core::plants::Unicycle;
use punctual_core::qp::Bounds;
use scenario::{distance_disc, quadratic_disc};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

const STEP: f64 = 0.05;
const BOUNDS: [f64; 2] = [6.0, 2.0];

fn json<T: Serialize>(value: &T) -> String {
    serde_json::to_string(value).expect("serialises")
}

fn back<T: DeserializeOwned>(text: &str) -> T {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

/// A goal with a deadline, and a set without one: its deadline is infinite.
fn filter() -> Filter {
    Filter::builder(Unicycle)
        .barrier("goal", distance_disc(), BarrierSettings::within(12.0))
        .and_then(|b| b.barrier("room", quadratic_disc(), BarrierSettings::keeping()))
        .and_then(|b| b.bounds(&BOUNDS.map(|b| -b), &BOUNDS))
        .and_then(|b| b.sampling(Sampling::Measured { first: Some(STEP) }))
        .and_then(FilterBuilder::build)
        .expect("valid filter")
}

/// What each of `count` steps from sample number `from` says, and the input, by their bits.
fn run(filter: &mut Filter, x: &mut [f64; 4], from: usize, count: usize) -> Vec<String> {
    (from..from + count)
        .map(|k| {
            let mut u = [0.0; 2];
            let report = filter.step(k as f64 * STEP, x, &[1.0, 0.1], &mut u).expect("right lengths");
            let said = json(report);
            *x = rk4_step(&Unicycle, x, &u, STEP);
            format!("{said} {:?}", u.map(f64::to_bits))
        })
        .collect()
}

/// Runs, writes the state to JSON, and goes on in a new filter: bit for bit what the first one says.
#[test]
fn a_filter_goes_on_from_a_file() {
    let (mut one, mut x) = (filter(), [0.0, 0.0, 0.3, 1.0]);
    run(&mut one, &mut x, 0, 100);
    let text = json(one.state());
    let state: FilterState = back(&text);
    assert_eq!(&state, one.state());
    assert_eq!(state.barriers[1].deadline, f64::INFINITY);
    assert_eq!(text.matches("\"inf\"").count(), 1, "{text}");
    let mut two = filter();
    two.restore(&state).expect("as many barriers");
    let mut also = x;
    assert_eq!(run(&mut one, &mut x, 100, 200), run(&mut two, &mut also, 100, 200));
    assert_eq!(x, also);
    assert_eq!(json(one.state()), json(two.state()));
}

/// Nothing stands in a file that is no number but a word or none: a state that was never used, with a barrier that was
/// never seen, and the report before the first step.
#[test]
fn reports_and_fresh_states_come_back() {
    let mut filter = filter();
    let fresh = json(filter.report());
    assert!(fresh.contains("\"NaN\""), "{fresh}");
    assert_eq!(json(&back::<Report>(&fresh)), fresh);
    assert_eq!(&back::<FilterState>(&json(filter.state())), filter.state());
    let mut u = [0.0; 2];
    let report = filter.step(0.0, &[0.0, 0.0, 0.3, 1.0], &[0.0; 2], &mut u).expect("right lengths");
    assert_eq!(&back::<Report>(&json(report)), report);
    let mut derivative = SampleDerivative::default();
    let (x, u_ref) = ([0.0, 0.0, 0.3, 1.0], [0.0; 2]);
    let unknown =
        filter.differentiate(1.0, &x, &u_ref, Direction { x: &[1.0; 4], u: &[0.0; 2] }, &mut derivative);
    assert_eq!(unknown, Ok(None));
    let read: SampleDerivative = back(&json(&derivative));
    assert_eq!((read.u, read.barriers), (derivative.u, derivative.barriers));
}

#[test]
fn settings_come_back() {
    let settings = BarrierSettings::within(5.0).method(Method::RepeatedRoot).stay_rate(3.0).recovery(0.1);
    assert_eq!(back::<BarrierSettings>(&json(&settings)), settings);
    let rates = Operator::new(&[1.0, 2.5]).ok();
    let settings = BarrierSettings::within(f64::INFINITY).rates(rates);
    assert_eq!(back::<BarrierSettings>(&json(&settings)), settings);
    assert_eq!(back::<BarrierSettings>("{\"deadline\": 7}"), BarrierSettings::within(7.0));
    assert_eq!(back::<BarrierSettings>("{}"), BarrierSettings::keeping());
    let sampling = Sampling::Measured { first: Some(0.1) };
    assert_eq!(back::<Sampling>(&json(&sampling)), sampling);
    let window = (Begin::AfterArrival(2), End::At(4.0), Strictness::Soft(1.5));
    assert_eq!(back::<(Begin, End, Strictness)>(&json(&window)), window);
    let beta = Integration { state: 4, input: 1, limits: [f64::NEG_INFINITY, 0.5], gain: 10.0 };
    assert_eq!(back::<Integration>(&json(&beta)), beta);
    assert_eq!(back::<Bounds>(&json(&Bounds::NONE)), Bounds::NONE);
}

#[test]
fn what_a_constructor_refuses_a_file_cannot_bring() {
    let refused = |text: &str| {
        let message = serde_json::from_str::<BarrierSettings>(text).unwrap_err().to_string();
        message.split(" at line").next().expect("a message").to_owned()
    };
    assert_eq!(refused("{\"rates\": [1, -2]}"), "rates[2]: is -2, must be finite and > 0");
    assert!(refused("{\"deadlin\": 1}").starts_with("unknown field `deadlin`"));
    let word = refused("{\"margin\": \"infinite\"}");
    assert_eq!(word, "invalid value: string \"infinite\", expected a number, \"inf\", \"-inf\" or \"NaN\"");
}

/// Ordinary numbers, and those that no filter remembers.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![-100.0..100.0, -1.0..1.0, any::<f64>(), Just(f64::NAN), Just(f64::INFINITY), Just(0.0)]
}

prop_compose! {
    fn promise()(
        phase in prop::sample::select(Phase::ALL.to_vec()),
        n in prop::array::uniform32(number()),
        anchor in prop::array::uniform8(number()),
        options in prop::array::uniform4(prop::option::of(number())),
        counts in prop::array::uniform3(any::<u32>()),
        flags in prop::array::uniform2(any::<bool>()),
    ) -> FixedTimeState {
        FixedTimeState {
            phase,
            start_time: options[0],
            anchor_time: n[0],
            deadline: n[1],
            recoveries: counts[0],
            postponed: counts[1],
            anchor,
            rate: n[2],
            stay_rate: n[3],
            stay_margin: n[4],
            pull: n[5],
            gain: n[6],
            margin: n[7],
            least_margin: n[10],
            period: n[8],
            fallback: flags[0],
            arrival: options[1],
            since: options[3],
            on_course: flags[1],
            unmet: options[2].map(|since| Unmet { steps: counts[2], since, h: n[9] }),
        }
    }
}

prop_compose! {
    fn curvature()(
        barrier in 0_u32..3,
        hessian in prop::array::uniform6(number()),
        looked in any::<u32>(),
        sideways in prop::option::of(any::<u32>()),
    ) -> Curvature {
        Curvature { barrier, hessian, looked, sideways }
    }
}

proptest! {
    /// What stands in a file cannot lead the input out of its bounds.
    #[test]
    fn any_state_leaves_the_input_within_its_bounds(
        barriers in prop::collection::vec(promise(), 2),
        (time, period) in (prop::option::of(number()), prop::option::of(number())),
        start in prop::option::of(number()),
        input in prop::array::uniform32(number()),
        curvatures in prop::array::uniform2(prop::option::of(curvature())),
    ) {
        let state = FilterState { barriers, time, period, input, start, curvatures, ..Default::default() };
        let text = json(&state);
        prop_assert_eq!(json(&back::<FilterState>(&text)), text);
        let mut filter = filter();
        filter.restore(&state).expect("as many barriers");
        for k in 0..3 {
            let mut u = [f64::NAN; 2];
            filter.step(f64::from(k) * STEP, &[0.0, 0.0, 0.3, 1.0], &[1.0, 0.1], &mut u).expect("right lengths");
            prop_assert!(u.iter().zip(BOUNDS).all(|(u, b)| u.abs() <= b), "{u:?}");
        }
    }
}

/// Each number of a state from elsewhere may be any: a step does not end for that, and its input is within the bounds.
#[test]
fn no_number_of_a_state_ends_a_step() {
    fn numbers(value: &mut Value, visit: &mut dyn FnMut(&mut Value)) {
        match value {
            Value::Array(all) => all.iter_mut().for_each(|value| numbers(value, visit)),
            Value::Object(all) => all.values_mut().for_each(|value| numbers(value, visit)),
            Value::Number(_) => visit(value),
            Value::String(text) if ["inf", "-inf", "NaN"].contains(&text.as_str()) => visit(value),
            _ => {}
        }
    }
    let mut restored = 0;
    // On the way, and inside of both sets.
    for x in [[0.0, 0.0, 0.3, 1.0], [45.0, 44.5, 0.3, 0.1]] {
        let (mut one, mut u) = (filter(), [0.0; 2]);
        for k in 0..4 {
            one.step(f64::from(k) * STEP, &x, &[1.0, 0.1], &mut u).expect("right lengths");
        }
        let mut written = serde_json::to_value(one.state()).expect("serialises");
        let mut count = 0;
        numbers(&mut written, &mut |_| count += 1);
        assert!(count > 20, "{count}");
        let wrongs =
            ["NaN", "inf", "-inf"].map(Value::from).into_iter().chain([-1.0, 0.0, 1e300].map(Value::from));
        for (place, wrong) in (0..count).flat_map(|place| wrongs.clone().map(move |wrong| (place, wrong))) {
            let (mut damaged, mut at) = (written.clone(), 0);
            numbers(&mut damaged, &mut |value| {
                if at == place {
                    *value = wrong.clone();
                }
                at += 1;
            });
            let Ok(state) = serde_json::from_value::<FilterState>(damaged) else { continue };
            restored += 1;
            let mut other = filter();
            other.restore(&state).expect("as many barriers");
            for k in 4..8 {
                other.step(f64::from(k) * STEP, &x, &[1.0, 0.1], &mut u).expect("right lengths");
                assert!(u.iter().zip(BOUNDS).all(|(u, bound)| u.abs() <= bound), "{place} is {wrong}: {u:?}");
            }
        }
    }
    assert!(restored > 200, "{restored}");
}
