//! How promises hold under bounds and any u_ref: for rows alone, for backup plans, and for the filters of the
//! literature that have a backup.

use std::sync::Arc;

use std::array::from_fn;

use punctual_core::elementary;
use punctual_cosim::error::Error;
use punctual_pictures::plot::{Chart, Curve, Mark, Scaling, Style};
use rayon::prelude::*;

use punctual_core::barrier::Barrier;
use punctual_core::barriers::DistanceDisc;
use punctual_core::dynamics::{ControlAffine, rk4_step};
use punctual_core::filter::{BarrierSettings, Filter, Sampling};
use punctual_core::lie;
use punctual_core::plants::{Bicycle, MovedPoint, PointMass, Unicycle};
use punctual_core::qp::Bounds;
use punctual_reference::baselines::{Backup, BackupBarrier, Brake, Gatekeeper, Stoppable, Tube};

use super::baseline::Baseline;
use super::cases::{CENTRE, DEADLINE, Nominal, RADIUS, REAR, SMOOTHING, Setup, Vehicle};
use super::starts::{hundred, uniform};
use super::table::{Cell, Table};
use super::{Figure, Options, Watch};

/// Sampling period in s of all methods except the tube.
const PERIOD: f64 = 0.05;
/// Sampling period in s of the tube, which does not account for held inputs.
const FINE: f64 = 1e-3;
/// End of a run in s.
const END: f64 = 2.0 * DEADLINE;
/// Bound on |u_i| of the points, and on the acceleration of the others, in m/s² (m/s if the input is a
/// velocity).
const BOUND: f64 = 8.0;
/// Bound on the turning rate in rad/s, and on the slip angle in rad.
const TURN: f64 = 1.0;
/// Magnitude of a u_ref away from the disc, in the unit of u.
const PUSH: f64 = 5.0;
/// The most periods for which gatekeeper follows u_ref.
const LEAD: usize = 20;
/// Periods within which a brake must reach its terminal set.
const HORIZON: usize = 40;
/// α of the backup control barrier function in 1/s.
const RATE: f64 = 2.0;
/// Number of points in each period at which h is checked.
const CHECKS: usize = 5;
/// The least change of u_ref that counts, relative to the bounds.
const LEAST_CHANGE: f64 = 1e-6;
/// Points of a curve.
const POINTS: usize = 400;
/// Seed of the starts inside the disc.
const SEED: u64 = 2000;

/// What the filter is asked to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    /// From outside: be inside by the deadline, and stay.
    Reach,
    /// From inside: stay forever.
    Stay,
}

/// The filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Method {
    Rows,
    Plans,
    Tube,
    Gatekeeper,
    BackupBarrier,
}

impl Method {
    fn title(self) -> &'static str {
        match self {
            Self::Rows => "rows alone (ours)",
            Self::Plans => "plans (ours)",
            Self::Tube => "constricting tube",
            Self::Gatekeeper => "gatekeeper",
            Self::BackupBarrier => "backup CBF",
        }
    }
}

/// The vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Body {
    /// A point whose velocity is the input.
    Point,
    /// A vehicle of the paper.
    Of(Vehicle),
}

impl Body {
    fn title(self) -> &'static str {
        match self {
            Self::Point => "moved point",
            Self::Of(vehicle) => vehicle.title(),
        }
    }

    fn bounds(self) -> [f64; 2] {
        match self {
            Self::Point | Self::Of(Vehicle::PointMass) => [BOUND; 2],
            Self::Of(_) => [BOUND, TURN],
        }
    }
}

/// The result of one closed loop.
#[derive(Clone, Debug, Default)]
struct Run {
    accepted: bool,
    on_time: bool,
    kept: bool,
    /// Number of samples, of samples whose input is not u_ref, and the sum over samples of the change
    /// relative to the bounds.
    samples: usize,
    changed: usize,
    distance: f64,
    /// Time and h at every sample.
    trajectory: Vec<[f64; 2]>,
}

/// A filter in a loop. For time, state and u_ref within the bounds, it returns the input and whether the
/// promise is accepted.
type Law<const NX: usize> = Box<dyn FnMut(f64, &[f64; NX], &[f64; 2]) -> Step>;
type Step = Result<([f64; 2], bool), punctual_core::Error>;

/// A plant with its brake, and its u_ref.
struct Case<'a, P, const NX: usize> {
    plant: P,
    bounds: [f64; 2],
    period: f64,
    nominal: &'a dyn Fn(&[f64; NX]) -> [f64; 2],
}

fn disc() -> Result<DistanceDisc, punctual_core::Error> {
    DistanceDisc::new(CENTRE, RADIUS, SMOOTHING)
}

fn limits(bounds: [f64; 2]) -> Bounds {
    let mut limits = Bounds::NONE;
    for (i, b) in bounds.into_iter().enumerate() {
        (limits.min[i], limits.max[i]) = (-b, b);
    }
    limits
}

impl<P: ControlAffine<NX, 2>, const NX: usize> Case<'_, P, NX> {
    /// Runs `filter` from `x`.
    fn run(&self, task: Task, mut filter: Law<NX>, mut x: [f64; NX]) -> Result<Run, Error> {
        let (disc, limits) = (disc().map_err(Error::from)?, limits(self.bounds));
        let (period, substep) = (self.period, self.period / CHECKS as f64);
        let steps = (END / period).round() as usize;
        let mut run = Run { kept: true, ..Run::default() };
        for k in 0..steps {
            let t = k as f64 * period;
            let wanted = (self.nominal)(&x);
            let wanted = from_fn(|i| limits.clamp(i, wanted[i]));
            let (u, accepted) = filter(t, &x, &wanted).map_err(Error::from)?;
            run.accepted = if k == 0 { accepted } else { run.accepted };
            run.samples += 1;
            let change: f64 = (0..2).map(|i| (u[i] - wanted[i]).abs() / self.bounds[i] / 2.0).sum();
            run.changed += usize::from(change > LEAST_CHANGE);
            run.distance += change;
            run.trajectory.push([t, disc.value(t, &x)]);
            for part in 0..CHECKS {
                let at = t + substep * part as f64;
                let is_inside = disc.value(at, &x) >= 0.0;
                // Compares half a step early, so that round-off in the time does not matter.
                run.on_time |= is_inside && at < DEADLINE + substep / 2.0;
                let is_due = task == Task::Stay || at > DEADLINE - substep / 2.0;
                run.kept &= is_inside || !is_due;
                x = rk4_step(&self.plant, &x, &u, substep);
            }
        }
        run.kept &= run.on_time;
        Ok(run)
    }
}

/// `filter` in a loop, with or without backup plans.
fn ours<const NX: usize>(method: Method, mut filter: Filter) -> Result<Law<NX>, Error> {
    if method == Method::Plans {
        let mut filter = filter.with_plans(PERIOD).map_err(Error::from)?;
        return Ok(Box::new(move |t, x, u_ref| {
            let mut u = *u_ref;
            let assured = filter.step(t, x, u_ref, &mut u)?.is_assured();
            Ok((u, assured))
        }));
    }
    Ok(Box::new(move |t, x, u_ref| {
        let mut u = *u_ref;
        let report = filter.step(t, x, u_ref, &mut u)?;
        let accepted = report.barriers[0].on_course;
        Ok((u, accepted))
    }))
}

/// A run of a vehicle of the paper; `speeds` are the states that its first inputs change.
fn vehicle_run<P, const M: usize>(
    plant: P,
    vehicle: Vehicle,
    speeds: [usize; M],
    asked: (Task, Method, Nominal),
    x0: [f64; 4],
) -> Result<Run, Error>
where
    P: ControlAffine<4, 2> + Copy + 'static,
{
    let (task, method, nominal) = asked;
    let bounds = Body::Of(vehicle).bounds();
    let u_ref = move |x: &[f64; 4]| vehicle.reference(nominal, x);
    let case = Case { plant, bounds, period: PERIOD, nominal: &u_ref };
    let filter: Law<4> = match method {
        Method::Gatekeeper => {
            let mut gatekeeper = Gatekeeper::new(backup(plant, bounds, speeds)?, LEAD);
            Box::new(move |t, x, _| {
                let found = gatekeeper.step(t, x, |_, x| u_ref(x));
                Ok((found.unwrap_or_default(), found.is_some()))
            })
        }
        Method::BackupBarrier => {
            let backup = backup(plant, bounds, speeds)?;
            let mut filter = BackupBarrier::new(backup, RATE).map_err(Error::from)?;
            Box::new(move |t, x, u_ref| {
                let step = filter.step(t, x, u_ref);
                Ok((step.input, step.met && step.least >= 0.0))
            })
        }
        Method::Rows | Method::Plans | Method::Tube => {
            let setup = Setup { bounds: Some(bounds), nominal, ..Setup::advised(DEADLINE, PERIOD) };
            let source = vehicle.source(setup.shape)?;
            ours(method, Baseline::Profile.filter(source, &setup).map_err(Error::from)?)?
        }
    };
    case.run(task, filter, x0)
}

/// A braking backup that keeps the disc.
fn backup<P, const M: usize>(
    plant: P,
    bounds: [f64; 2],
    speeds: [usize; M],
) -> Result<Backup<P, Brake<M>, DistanceDisc, Stoppable<DistanceDisc, M>>, Error> {
    let safe = disc().map_err(Error::from)?;
    // Half of the largest gain that does not oscillate with a held input.
    let brake = Brake { speeds, gain: 0.5 / PERIOD, limit: bounds[0] };
    let terminal = Stoppable { set: safe, brake };
    let (bounds, horizon) = (limits(bounds), HORIZON);
    let backup = Backup { plant, law: brake, safe, terminal, bounds, period: PERIOD, horizon };
    backup.validated().map_err(Error::from)
}

/// A run of a point whose velocity is the input.
fn point_run((task, method, nominal): (Task, Method, Nominal), x0: [f64; 4]) -> Result<Run, Error> {
    let bounds = Body::Point.bounds();
    let u_ref = move |x: &[f64; 2]| Vehicle::PointMass.reference(nominal, &[x[0], x[1], 0.0, 0.0]);
    let x0 = [x0[0], x0[1]];
    let tube = |rate: f64| Tube::new(1, 1, rate);
    let filter = || {
        let disc = disc()?;
        let settings = BarrierSettings::within(DEADLINE).margin(0.02);
        let builder = Filter::from_sources(2, 2);
        let builder = builder.source("goal", lie::along(Arc::new(MovedPoint), disc, 1)?, settings)?;
        let builder = builder.bounds(&bounds.map(|b| -b), &bounds)?;
        let builder = match method {
            Method::Tube => builder.condition(tube(BarrierSettings::default_rate(DEADLINE, 0.0))?)?,
            _ => builder.sampling(Sampling::Measured { first: Some(PERIOD) })?,
        };
        builder.build()
    };
    let filter = filter().map_err(Error::from)?;
    let mut filter: Law<2> = ours(method, filter)?;
    if method == Method::Tube {
        let h0 = disc().map_err(Error::from)?.value(0.0, &x0);
        // The gradient is shortest at the edge, and the box of inputs contains the disc of that radius.
        let authority = bounds[0] * RADIUS / elementary::hypot(RADIUS, SMOOTHING);
        let least = tube(1.0).map_err(Error::from)?.least_deadline(h0, authority);
        let accepted = least.is_some_and(|least| least <= DEADLINE);
        let mut inner = filter;
        filter = Box::new(move |t, x, u_ref| inner(t, x, u_ref).map(|(u, _)| (u, accepted)));
    }
    let period = if method == Method::Tube { FINE } else { PERIOD };
    Case { plant: MovedPoint, bounds, period, nominal: &u_ref }.run(task, filter, x0)
}

fn run(body: Body, asked: (Task, Method, Nominal), x0: [f64; 4]) -> Result<Run, Error> {
    match body {
        Body::Point => point_run(asked, x0),
        Body::Of(vehicle @ Vehicle::PointMass) => vehicle_run(PointMass, vehicle, [2, 3], asked, x0),
        Body::Of(vehicle @ Vehicle::Unicycle) => vehicle_run(Unicycle, vehicle, [3], asked, x0),
        Body::Of(vehicle @ Vehicle::Bicycle) => {
            vehicle_run(Bicycle::new(REAR).map_err(Error::from)?, vehicle, [3], asked, x0)
        }
    }
}

/// Random starts inside the disc from which a brake stays inside. Position, angle and speed up to 4 m/s are
/// uniform; starts from which it leaves are rejected.
fn inside(body: Body, count: usize) -> Result<Vec<[f64; 4]>, Error> {
    let mut uniform = uniform(SEED);
    // Only the magnitude of the velocity matters, whichever states represent it.
    let terminal = backup(PointMass, body.bounds(), [2, 3])?.terminal;
    let mut starts = Vec::new();
    while starts.len() < count {
        let [p, q, angle, speed] = from_fn(|_| uniform());
        let position = [p, q].map(|c| RADIUS * (2.0 * c - 1.0));
        let (angle, speed) = (std::f64::consts::TAU * angle, 4.0 * speed);
        let at = [CENTRE[0] + position[0], CENTRE[1] + position[1]];
        let (sin, cos) = elementary::sin_cos(angle);
        let velocity = [speed * cos, speed * sin];
        let as_point = [at[0], at[1], velocity[0], velocity[1]];
        if terminal.value(0.0, &as_point) < 0.0 {
            continue;
        }
        starts.push(match body {
            Body::Point | Body::Of(Vehicle::PointMass) => as_point,
            Body::Of(_) => [at[0], at[1], angle, speed],
        });
    }
    Ok(starts)
}

/// Cells of the table: task, body, methods, and the choices of u_ref by name.
type Cells = (Task, Body, Vec<Method>, Vec<(&'static str, Nominal)>);

/// The runs of the table.
fn plan() -> Vec<Cells> {
    let all = vec![("0", Nominal::Coast), ("damping", Nominal::Damping), ("outwards", Nominal::Away(PUSH))];
    // If the velocity is the input, there is nothing to damp.
    let point = vec![all[0], all[2]];
    let mut plan = vec![];
    for vehicle in Vehicle::ALL {
        plan.push((Task::Reach, Body::Of(vehicle), vec![Method::Rows, Method::Plans], all.clone()));
    }
    plan.push((Task::Reach, Body::Point, vec![Method::Rows, Method::Tube, Method::Plans], point));
    for vehicle in Vehicle::ALL {
        let methods = vec![Method::Rows, Method::BackupBarrier, Method::Gatekeeper, Method::Plans];
        plan.push((Task::Stay, Body::Of(vehicle), methods, all.clone()));
    }
    plan
}

/// Number of random starts in each cell of the table.
fn starts(options: &Options) -> usize {
    options.runs.min(20)
}

/// Number of closed loops in [`table`].
pub(super) fn loops(options: &Options) -> usize {
    plan().iter().map(|(_, _, methods, nominals)| methods.len() * nominals.len()).sum::<usize>()
        * starts(options)
}

/// The table, and whether every promise with a plan was kept.
///
/// # Errors
///
/// None in practice, since all parameters are constants.
pub(super) fn table(options: &Options, watch: &Watch) -> Result<(Table, bool), Error> {
    let mut table = Table::new(
        "always",
        "Will it always? Bounds and u_ref against promises",
        &[
            "asked",
            "vehicle",
            "u_ref",
            "method",
            "starts",
            "accepted",
            "on time",
            "kept",
            "accepted, not kept",
            "steps changed (%)",
            "mean change (% of the bounds)",
        ],
    )
    .note(format!(
        "Bounds: |u_i| ≤ {BOUND} m/s² (m/s for the moved point), |ω| ≤ {TURN} rad/s, |β| ≤ {TURN} rad. T = {DEADLINE} s, \
         to {END} s, step {PERIOD} s (the tube {FINE} s). Outwards: {PUSH} m/s² (m/s) away from the disc."
    ))
    .note("Reach and stay: the first of the hundred starts, margin 0.02 m. Stay: random starts inside from which braking stays inside.")
    .note("Accepted: promised at the first sample. Rows: their conditions held there, which promises nothing. Plans: assured. Tube: T is no shorter than its least deadline.")
    .note("gatekeeper and backup CBF brake as their backup; accepted where it stays inside. They cannot be asked to reach a set, or to be on time.")
    .note("Changed: the input is not u_ref within its bounds, by more than a millionth of them. Mean change: |u_i − u_ref,i| over its bound, over all inputs, steps and runs.");
    let mut all_kept = true;
    for (task, body, methods, nominals) in plan() {
        let starts = match task {
            Task::Reach => hundred(starts(options)),
            Task::Stay => inside(body, starts(options))?,
        };
        for (name, nominal) in nominals {
            for &method in &methods {
                let one = |x0: &[f64; 4]| {
                    let run = run(body, (task, method, nominal), *x0);
                    watch.done(1);
                    run
                };
                let runs = starts.par_iter().map(one).collect::<Result<Vec<_>, Error>>()?;
                let count = |f: fn(&Run) -> bool| runs.iter().filter(|run| f(run)).count();
                let broken = count(|run| run.accepted && !run.kept);
                all_kept &= method != Method::Plans || broken == 0;
                let samples = runs.iter().map(|run| run.samples).sum::<usize>() as f64;
                let changed = runs.iter().map(|run| run.changed).sum::<usize>() as f64;
                let distance = runs.iter().map(|run| run.distance).sum::<f64>();
                table.rows.push(vec![
                    if task == Task::Reach { "reach and stay" } else { "stay" }.into(),
                    body.title().into(),
                    name.into(),
                    method.title().into(),
                    Cell::count(runs.len()),
                    Cell::count(count(|run| run.accepted)),
                    match task {
                        Task::Reach => Cell::count(count(|run| run.on_time)),
                        Task::Stay => Cell::Nothing("-"),
                    },
                    Cell::count(count(|run| run.kept)),
                    Cell::count(broken),
                    Cell::Number(100.0 * changed / samples, 1),
                    Cell::Number(100.0 * distance / samples, 1),
                ]);
            }
        }
    }
    Ok((table, all_kept))
}

/// The table with the choices of u_ref side by side, for the guide.
pub(super) fn side_by_side(table: &Table) -> Table {
    const MEASURES: [usize; 6] = [5, 6, 7, 8, 9, 10];
    let mut header = vec!["asked", "vehicle", "method", "starts"];
    header.extend(MEASURES.map(|c| table.header[c].as_str()));
    let mut out = Table::new(table.key, &table.title, &header);
    for row in &table.rows {
        let shown = |c: usize| row[c].shown();
        let head = [0, 1, 3, 4].map(shown);
        let same = |other: &&mut Vec<Cell>| (0..4).all(|c| other[c].shown() == head[c]);
        match out.rows.iter_mut().find(same) {
            Some(other) => {
                let measured = |c: &usize| !matches!(row[*c], Cell::Nothing(_));
                for (cell, c) in other[4..].iter_mut().zip(MEASURES).filter(|(_, c)| measured(c)) {
                    *cell = format!("{} / {}", cell.shown(), shown(c)).into();
                }
            }
            None => out.rows.push(head.into_iter().chain(MEASURES.map(shown)).map(Cell::from).collect()),
        }
    }
    out
}

/// The pictures, of a point mass whose u_ref leads outwards.
///
/// # Errors
///
/// None in practice, since all parameters are constants.
pub(super) fn figures() -> Result<Vec<Figure>, Error> {
    const X0: [f64; 4] = [0.0, 0.0, -10.0, 0.0];
    /// At the centre, moving outwards.
    const INSIDE: [f64; 4] = [CENTRE[0], CENTRE[1], 2.0, 0.0];
    let body = Body::Of(Vehicle::PointMass);
    let curve = |task, method: Method, (name, nominal): (&str, Nominal), x0, colour, style| {
        let run = run(body, (task, method, nominal), x0)?;
        let (x, y) = run.trajectory.into_iter().map(|[t, h]| (t, h)).unzip();
        let label = format!("{}{name}", method.title());
        Ok::<_, Error>(Curve { label, x, y, style, colour, ..Curve::default() }.thinned(POINTS))
    };
    let [coast, outwards] = [(", u_ref = 0", Nominal::Coast), (", u_ref outwards", Nominal::Away(PUSH))];
    let reach = |method, nominal, colour, style| curve(Task::Reach, method, nominal, X0, colour, style);
    let stay =
        |method, colour, style| curve(Task::Stay, method, ("", Nominal::Away(PUSH)), INSIDE, colour, style);
    let chart = |title: &str, x: Scaling, y: Scaling, curves, verticals| Chart {
        title: title.into(),
        x,
        y,
        curves,
        verticals,
        horizontals: vec![Mark { label: String::new(), at: 0.0 }],
        ..Chart::default()
    };
    Ok(vec![
        Figure {
            key: "always-reach".into(),
            caption: format!(
                "Point mass from {X0:?}, T = {DEADLINE} s, |u_i| ≤ {BOUND} m/s², step {PERIOD} s; u_ref = 0, or {PUSH} m/s² away from the disc."
            ),
            chart: chart(
                "point mass with bounds: h by rows alone, and with a plan",
                Scaling::linear("time (s)"),
                Scaling::linear("h (m)").over(-80.0, 5.0),
                vec![
                    reach(Method::Plans, outwards, 0, Style::Solid)?,
                    reach(Method::Plans, coast, 5, Style::Solid)?,
                    reach(Method::Rows, outwards, 1, Style::Dashed)?,
                    reach(Method::Rows, coast, 4, Style::Dashed)?,
                ],
                vec![Mark { label: format!("deadline {DEADLINE} s"), at: DEADLINE }],
            ),
        },
        Figure {
            key: "always-stay".into(),
            caption: format!(
                "Point mass from the centre at 2 m/s, |u_i| ≤ {BOUND} m/s², step {PERIOD} s, u_ref = {PUSH} m/s² away from the centre."
            ),
            chart: chart(
                "point mass inside, u_ref outwards: how near the edge",
                Scaling::linear("time (s)").over(0.0, 4.0),
                Scaling::linear("h (m)").over(-0.05, 0.9),
                vec![
                    stay(Method::Plans, 0, Style::Solid)?,
                    stay(Method::Rows, 1, Style::Dashed)?,
                    stay(Method::Gatekeeper, 2, Style::Dashed)?,
                    stay(Method::BackupBarrier, 3, Style::Dashed)?,
                ],
                vec![],
            ),
        },
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One run of each kind: plans keep what rows lose, and methods with a braking backup stay inside.
    #[test]
    fn a_start_of_every_kind() {
        let outwards = Nominal::Away(PUSH);
        let mass = Body::Of(Vehicle::PointMass);
        let x0 = hundred(1)[0];
        let rows = run(mass, (Task::Reach, Method::Rows, outwards), x0).expect("a run");
        let plans = run(mass, (Task::Reach, Method::Plans, outwards), x0).expect("a run");
        assert!(rows.accepted && !rows.kept);
        assert!(plans.accepted && plans.kept);
        let start = inside(mass, 1).expect("a start")[0];
        for method in [Method::Gatekeeper, Method::BackupBarrier] {
            let run = run(mass, (Task::Stay, method, outwards), start).expect("a run");
            assert!(run.accepted && run.kept && run.changed > 0, "{method:?}");
        }
    }

    #[test]
    fn choices_of_u_ref_are_side_by_side() {
        let mut table = Table::new("t", "", &["a", "v", "u", "m", "n", "1", "2", "3", "4", "5", "6"]);
        for (u_ref, value) in [("0", 1.0), ("outwards", 2.5)] {
            let mut row: Vec<Cell> = ["reach", "mass", u_ref, "rows"].map(Cell::from).into();
            row.extend([Cell::count(3), Cell::Nothing("-")]);
            row.extend((0..5).map(|_| Cell::Number(value, 1)));
            table.rows.push(row);
        }
        let found = side_by_side(&table).rows;
        assert_eq!(found.len(), 1);
        let shown: Vec<String> = found[0].iter().map(Cell::shown).collect();
        assert_eq!(shown[..4], ["reach", "mass", "rows", "3"]);
        assert_eq!(shown[4..6], ["-", "1.0 / 2.5"]);
    }
}
