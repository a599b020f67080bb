//! Restoring a snapshot and continuing gives the same bits as never going back.
//!
//! The tests compare every variable and the bytes of the state, which contain everything that is remembered.

use punctual_modeldescription::{BaseType, Causality};

use crate::api::API;
use crate::fmu::{FILTER, Fmu, PLANT, STEERED};
use crate::slave::Slave;

/// Every model as a plant.
const MODELS: [&str; 8] = [
    "point_mass",
    "unicycle",
    "bicycle",
    "bicycle_small_slip",
    "bicycle_small_slip_rate",
    "bicycle_kinematic",
    "bicycle_kinematic_angle",
    "bicycle_kinematic_slip",
];

/// A filter with two barriers that conflict at times, recoveries and anchors, and measured periods. It only
/// uses its rows.
const CONFLICTS: &str = r#"
kind = "filter"
assurance = "off"
plant.model = "unicycle"
bounds = { a = [-3.0, 3.0], omega = [-1.0, 1.0] }
[[barrier]]
name = "goal"
centre = [4.0, 3.0]
radius = 1.0
deadline = 2.0
recovery = 0.5
[[barrier]]
name = "obstacle"
shape = "obstacle"
centre = [2.0, 1.5]
radius = 0.75
deadline = 1.0
"#;

/// A disturbance of the unicycle, with a period longer than some steps and shorter than others.
const DISTURBANCE: &str = "[disturbance]
seed = 7
period = 0.02
inputs = { a = 1.0 }
measurements = { x_p = 0.1, theta = 0.01 }
";

pub(crate) fn every_fmu() -> Vec<Fmu> {
    let mut fmus = vec![
        Fmu::new(FILTER),
        Fmu::new(&format!("direct_feedthrough = false\n{}", FILTER.trim_start())),
        Fmu::new(CONFLICTS),
        Fmu::new(STEERED),
    ];
    fmus.push(Fmu::new(&format!("{}{DISTURBANCE}", PLANT.trim_start())));
    for model in MODELS {
        let plant = PLANT.replace("unicycle", model).replace("x0 = { theta = 0.5, v = 2.0 }", "");
        fmus.push(Fmu::new(&plant));
    }
    fmus
}

/// Pseudo-random numbers (SplitMix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    pub(crate) fn below(&mut self, n: u64) -> u64 {
        self.next() % n
    }

    /// From −5 to 5.
    pub(crate) fn number(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64 * 10.0 - 5.0
    }

    /// A communication step such as importers make.
    fn step(&mut self) -> f64 {
        [0.0, 1e-9, 1e-3, 0.01, 0.0099999999999998, 0.05, 0.3][self.below(7) as usize]
    }
}

/// The actions between two communication points.
pub(crate) struct Step {
    inputs: Vec<f64>,
    rearm: Option<bool>,
    /// Whether outputs are read before the step.
    look: bool,
    pub(crate) h: f64,
}

impl Step {
    fn new(random: &mut Random, fmu: &Fmu) -> Self {
        let inputs = |v: &&punctual_modeldescription::Variable| {
            v.causality == Causality::Input && v.kind.base_type() == BaseType::Real
        };
        let len = fmu.product.variables.iter().filter(inputs).count();
        let mut inputs: Vec<f64> = (0..len).map(|_| random.number()).collect();
        let filter = fmu.product.variables.iter().any(|v| v.name == "rearm");
        if filter && random.below(50) == 0 {
            inputs[0] = f64::NAN;
        }
        let rearm = (filter && random.below(10) == 0).then(|| random.below(2) == 0);
        Self { inputs, rearm, look: random.below(2) == 0, h: random.step() }
    }

    /// A step that no FMU refuses.
    pub(crate) fn valid(random: &mut Random, fmu: &Fmu) -> Self {
        let mut step = Self::new(random, fmu);
        step.inputs.iter_mut().filter(|input| input.is_nan()).for_each(|input| *input = 0.0);
        step
    }

    /// Sets the inputs.
    pub(crate) fn begin(&self, slave: &Slave) {
        slave.set_inputs(&self.inputs);
        if let Some(rearm) = self.rearm {
            slave.set_flag("rearm", rearm);
        }
        if self.look {
            values(slave);
        }
    }

    /// Makes the step, which a plant may refuse.
    pub(crate) fn end(&self, slave: &Slave, t: &mut f64) {
        if slave.try_step(*t, self.h) == 0 {
            *t += self.h;
        }
    }
}

/// The bits of all values.
fn values(slave: &Slave) -> Vec<u64> {
    let of = |base| {
        let variables = slave.fmu.product.variables.iter().filter(move |v| v.kind.base_type() == base);
        variables.map(|v| v.value_reference).collect::<Vec<u32>>()
    };
    let reals = of(BaseType::Real);
    let mut numbers = vec![0.0_f64; reals.len()];
    slave.ok((API.get_real)(slave.component, reals.as_ptr(), reals.len(), numbers.as_mut_ptr()));
    let mut bits: Vec<u64> = numbers.into_iter().map(f64::to_bits).collect();
    for (base, get) in [(BaseType::Integer, API.get_integer), (BaseType::Boolean, API.get_boolean)] {
        let references = of(base);
        let mut numbers = vec![0; references.len()];
        slave.ok(get(slave.component, references.as_ptr(), references.len(), numbers.as_mut_ptr()));
        bits.extend(numbers.into_iter().map(|n| n as u64));
    }
    bits
}

/// All visible values, and everything that is remembered.
pub(crate) fn all(slave: &Slave) -> (Vec<u64>, Vec<u8>) {
    (values(slave), slave.now())
}

/// Number of snapshot points per FMU: its share of `PUNCTUAL_SNAPSHOTS`, or of 10,000; fewer in a debug
/// build.
fn snapshots(fmus: usize) -> usize {
    let default = if cfg!(debug_assertions) { 2_000 } else { 10_000 };
    let all: usize = std::env::var("PUNCTUAL_SNAPSHOTS").map_or(default, |n| n.parse().expect("a number"));
    all.div_ceil(fmus)
}

/// Takes snapshots at random points of a run, also between inputs and step. Then makes some steps that are
/// discarded, and continues in parallel with an instance that never went back. The snapshot is used directly,
/// or as bytes, or in a new instance.
#[test]
#[expect(clippy::print_stdout, reason = "the number of points is the result")]
fn random_snapshots() {
    let fmus = every_fmu();
    let count = snapshots(fmus.len());
    let mut points = 0;
    for (seed, fmu) in fmus.iter().enumerate() {
        let mut random = Random(seed as u64);
        let straight = Slave::ready(fmu);
        let mut back = Slave::ready(fmu);
        let (mut t, mut kept) = (0.0, back.state());
        for point in 0..count {
            // A plant must not diverge.
            if point % 100 == 0 {
                t = 0.0;
                for slave in [&straight, &back] {
                    slave.ok((API.reset)(slave.component));
                    slave.initialize();
                }
            }
            let step = Step::new(&mut random, fmu);
            let early = random.below(2) == 0;
            for slave in [&straight, &back] {
                if !early {
                    step.begin(slave);
                }
            }
            back.ok((API.get_state)(back.component, &raw mut kept));
            let bytes = back.bytes(kept);
            let mut away = t;
            for _ in 0..=random.below(2) {
                let step = Step::new(&mut random, fmu);
                step.begin(&back);
                step.end(&back, &mut away);
            }
            match random.below(8) {
                0 => {
                    let fresh = Slave::new(fmu);
                    fresh.restore(fresh.read(&bytes));
                    kept = fresh.state();
                    back = fresh;
                }
                1 => {
                    let mut read = back.read(&bytes);
                    back.restore(read);
                    back.ok((API.free_state)(back.component, &raw mut read));
                }
                _ => back.restore(kept),
            }
            let mut other = t;
            for slave in [&straight, &back] {
                if early {
                    step.begin(slave);
                }
            }
            step.end(&straight, &mut t);
            step.end(&back, &mut other);
            let name = fmu.product.configuration.name();
            assert_eq!(all(&back), all(&straight), "{name}: point {point} at {t}");
            points += 1;
        }
    }
    println!("{points} snapshots in {} FMUs", fmus.len());
}

/// Two instances step alternately and swap their states at every step.
#[test]
fn two_instances_that_change_places() {
    for fmu in every_fmu() {
        let mut random = Random(7);
        let steps: [Vec<Step>; 2] = [(); 2].map(|()| (0..40).map(|_| Step::new(&mut random, &fmu)).collect());
        let alone = steps.each_ref().map(|steps| {
            let (slave, mut t) = (Slave::ready(&fmu), 0.0);
            let run = steps.iter().map(|step| {
                step.begin(&slave);
                step.end(&slave, &mut t);
                all(&slave)
            });
            run.collect::<Vec<_>>()
        });
        let mut slaves = [Slave::ready(&fmu), Slave::ready(&fmu)];
        let mut times = [0.0; 2];
        for k in 0..40 {
            for i in 0..2 {
                steps[i][k].begin(&slaves[i]);
                steps[i][k].end(&slaves[i], &mut times[i]);
                assert_eq!(all(&slaves[i]), alone[i][k], "{}: step {k}", fmu.product.configuration.name());
            }
            let states = slaves.each_ref().map(Slave::state);
            slaves[0].restore(states[1]);
            slaves[1].restore(states[0]);
            slaves.swap(0, 1);
        }
    }
}

/// In every mode, into a fresh instance, with parameters that are not the start values.
#[test]
fn every_mode_into_a_fresh_instance() {
    for (fmu, parameter) in [(Fmu::new(FILTER), "goal.deadline"), (Fmu::new(PLANT), "x0.v")] {
        for mode in 0..4 {
            let slave = Slave::new(&fmu);
            slave.set(parameter, 3.5);
            slave.ok((API.setup_experiment)(slave.component, 0, 0.0, 2.0, 0, 0.0));
            if mode > 0 {
                slave.ok((API.enter_initialization_mode)(slave.component));
                values(&slave);
                slave.set(parameter, 4.5);
            }
            if mode > 1 {
                slave.ok((API.exit_initialization_mode)(slave.component));
                slave.set_inputs(&[1.0, 0.5]);
                slave.step(2.0, 0.1);
                slave.set_inputs(&[0.5, 0.25]);
            }
            if mode > 2 {
                slave.ok((API.terminate)(slave.component));
            }
            let bytes = slave.now();
            let finish = |slave: &Slave| {
                let first = all(slave);
                if mode == 0 {
                    slave.ok((API.enter_initialization_mode)(slave.component));
                }
                if mode <= 1 {
                    slave.ok((API.exit_initialization_mode)(slave.component));
                }
                if mode <= 2 {
                    slave.step(slave.time(), 0.1);
                }
                (first, all(slave))
            };
            let wanted = finish(&slave);
            for used in [false, true] {
                let copy = if used { Slave::ready(&fmu) } else { Slave::new(&fmu) };
                copy.restore(copy.read(&bytes));
                assert_eq!(copy.now(), bytes, "mode {mode}, used before: {used}");
                assert_eq!(finish(&copy), wanted, "mode {mode}, used before: {used}");
            }
            // Goes back from where it ended.
            slave.restore(slave.read(&bytes));
            assert_eq!(finish(&slave), wanted, "mode {mode}");
        }
    }
}

/// A master tries long steps of both FMUs, and discards those it rejects. It continues with short ones, with
/// the same results as a master that knew its steps in advance.
#[test]
fn an_adaptive_master() {
    let (filter, plant) = (Fmu::new(CONFLICTS), Fmu::new(PLANT));
    let exchange = |filter: &Slave, plant: &Slave, t: f64, h: f64| {
        let x = ["x.x_p", "x.y_p", "x.theta", "x.v"].map(|name| plant.real(name));
        filter.set_inputs(&[x[0], x[1], x[2], x[3], 0.5, 0.2]);
        filter.step(t, h);
        plant.set_inputs(&["u.a", "u.omega"].map(|name| filter.real(name)));
        plant.step(t, h);
    };
    let mut random = Random(3);
    let (f, p) = (Slave::ready(&filter), Slave::ready(&plant));
    let mut accepted = Vec::new();
    let (mut t, mut rejected) = (0.0, 0);
    while t < 4.0 {
        let mut h = 0.2;
        let states = (f.state(), p.state());
        loop {
            exchange(&f, &p, t, h);
            if h <= 0.0125 || random.below(3) == 0 {
                break;
            }
            f.restore(states.0);
            p.restore(states.1);
            h /= 2.0;
            rejected += 1;
        }
        accepted.push((t, h));
        t += h;
    }
    let (straight_f, straight_p) = (Slave::ready(&filter), Slave::ready(&plant));
    for &(t, h) in &accepted {
        exchange(&straight_f, &straight_p, t, h);
    }
    assert!(rejected > 20, "{rejected}");
    assert_eq!((all(&f), all(&p)), (all(&straight_f), all(&straight_p)));
}

/// Importers pass true while they roll back, and false otherwise.
#[test]
fn no_set_fmu_state_prior_to_current_point_is_ignored() {
    for configuration in [FILTER, PLANT] {
        let fmu = Fmu::new(configuration);
        let slave = Slave::ready(&fmu);
        let mut first = None;
        for flags in [[0, 0], [1, 1], [0, 1], [1, 0]] {
            let start = slave.state();
            for (k, flag) in flags.into_iter().enumerate() {
                slave.set_inputs(&[1.0, 2.0]);
                slave.ok((API.do_step)(slave.component, 0.1 * k as f64, 0.1, flag));
            }
            let end = slave.now();
            assert_eq!(first.get_or_insert_with(|| end.clone()), &end, "{flags:?}");
            slave.restore(start);
        }
    }
}
