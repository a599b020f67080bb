//! `punctual run` equals the core in process, bit for bit: files, FMI and a shared library in between change
//! nothing.
//!
//! The loop below is [`punctual_reference::simulation::closed_loop`] with one difference, the time of a
//! sample. `closed_loop` samples at k·h. The master steps from the same k·h, but an instance continues from
//! the end of its last step, (k−1)·h + h, as long as the two differ only by round-off. So its time never runs
//! backwards with a master that counts differently. The filter's profile is a function of that time, so the
//! last bits depend on it.

use punctual_core::barriers::DistanceDisc;
use punctual_core::dynamics::rk4_step;
use punctual_core::filter::{BarrierSettings, Filter, Sampling};
use punctual_core::plants::Unicycle;

use crate::running::recorded;
use crate::table::{Table, assert_same_bits};

/// The step and length of the run: 3 s.
const STEP: f64 = 0.001;
const STEPS: usize = 3000;

/// From when the filter's input acts.
#[derive(Clone, Copy, PartialEq)]
enum Order {
    /// From the sample on.
    GaussSeidel,
    /// From the next communication point on.
    Jacobi,
}

/// The filter of examples/vehicles/unicycle-filter.toml. In Jacobi order the master tells it that its input acts a step late.
fn filter(order: Order) -> Filter {
    let goal = DistanceDisc::new([45.0, 45.0], 2.0, 2.0).expect("a disc");
    let settings = BarrierSettings::within(10.0).margin(0.02);
    let builder = Filter::builder(Unicycle).barrier("goal", goal, settings);
    let sampling = Sampling::Measured { first: Some(STEP) };
    let delay = if order == Order::Jacobi { STEP } else { 0.0 };
    let builder = builder.and_then(|b| b.sampling(sampling)).and_then(|b| b.actuation_delay(delay));
    builder.and_then(|b| b.build()).expect("a filter")
}

/// The values compared, row by row: state, input of the plant, h.
#[derive(Default)]
struct Rows {
    x: [Vec<f64>; 4],
    u: [Vec<f64>; 2],
    h: Vec<f64>,
}

impl Rows {
    fn push(&mut self, x: &[f64; 4], u: &[f64; 2], h: f64) {
        self.x.iter_mut().zip(x.iter()).for_each(|(column, value)| column.push(*value));
        self.u.iter_mut().zip(u.iter()).for_each(|(column, value)| column.push(*value));
        self.h.push(h);
    }
}

fn in_process(order: Order) -> Rows {
    let mut filter = filter(order);
    let mut rows = Rows::default();
    let mut x = [0.0; 4];
    // The last result of the filter, and h of that sample. In Jacobi order these are still read when the
    // plant is at the next point. Before the first step, h comes from looking ahead at the start, and the input is what
    // the filter assumes to act before its first sample.
    let mut last = [0.0; 2];
    let mut sample = |time: f64, x: &[f64; 4]| {
        // The nominal controller: damping, a = −v.
        let u_ref = [-x[3], 0.0];
        let mut u = [0.0; 2];
        let report = filter.step(time, x, &u_ref, &mut u).expect("right lengths");
        (u, report.barriers[0].h)
    };
    let mut time = 0.0;
    let mut last_h = 0.0;
    for k in 0..=STEPS {
        // No step begins at the stop time, so in Jacobi order that sample is never taken.
        let (u, h) = if order == Order::Jacobi && k == STEPS { (last, last_h) } else { sample(time, &x) };
        if k == 0 || order == Order::GaussSeidel {
            (last, last_h) = (u, h);
        }
        if k == 0 && order == Order::Jacobi {
            last = [0.0; 2];
        }
        rows.push(&x, &last, last_h);
        x = rk4_step(&Unicycle, &x, &last, STEP);
        (last, last_h) = (u, h);
        time = k as f64 * STEP + STEP;
    }
    rows
}

fn compare(found: &Table, wanted: &Rows) {
    assert_eq!(found.len(), STEPS + 1);
    for (i, state) in ["x_p", "y_p", "theta", "v"].iter().enumerate() {
        assert_same_bits(state, &found.column(&format!("plant.x.{state}")), &wanted.x[i]);
        assert_same_bits(state, &found.column(&format!("filter.x.{state}")), &wanted.x[i]);
    }
    for (i, input) in ["a", "omega"].iter().enumerate() {
        assert_same_bits(input, &found.column(&format!("filter.u.{input}")), &wanted.u[i]);
        assert_same_bits(input, &found.column(&format!("plant.u.{input}")), &wanted.u[i]);
    }
    assert_same_bits("h", &found.column("filter.goal.h"), &wanted.h);
}

const THREE_SECONDS: (&str, &str) = ("stop_time = 20.0", "stop_time = 3.0");

#[test]
fn a_run_in_gauss_seidel_order_is_the_loop_in_process() {
    compare(&recorded(&[THREE_SECONDS], ""), &in_process(Order::GaussSeidel));
}

#[test]
fn a_run_in_jacobi_order_is_the_loop_with_a_delay() {
    let jacobi = ("step = 0.001", "order = \"jacobi\"\nstep = 0.001");
    compare(&recorded(&[THREE_SECONDS, jacobi], ""), &in_process(Order::Jacobi));
}
