//! Moving goals, obstacles, and the more exact bicycles, from configuration to CSV.

use std::fs;

use punctual_reference::nominal::Heading;

use crate::table::Table;
use crate::workshop::{Workshop, examples};

const DEADLINE: f64 = 5.0;

/// Builds filter and plant, couples them for 10 s with u_ref as in `connections`, and returns the CSV.
fn coupled(model: &str, barriers: &str, x0: &str, connections: &str) -> Table {
    let workshop = Workshop::with_library();
    let experiment = "[experiment]\nstop_time = 10.0\n";
    workshop.write("f.toml", format!("kind = \"filter\"\nplant.model = \"{model}\"\n{barriers}{experiment}"));
    workshop.write("p.toml", format!("kind = \"plant\"\nplant.model = \"{model}\"\nx0 = {x0}\n{experiment}"));
    for name in ["f", "p"] {
        workshop.punctual(["build", &format!("{name}.toml"), "-o", &format!("{name}.fmu")]).success();
    }
    let system = "[experiment]\nstop_time = 10.0\nstep = 0.001\n[[component]]\nname = \"f\"\nfmu = \"f.fmu\"\n\
                  [[component]]\nname = \"p\"\nfmu = \"p.fmu\"\n[[connect_by_name]]\ncomponents = [\"f\", \"p\"]\n";
    workshop.write("s.toml", format!("{system}{connections}"));
    workshop.punctual(["run", "s.toml", "--out", "out"]).success();
    Table::parse(&workshop.text("out/s.csv"))
}

fn damping(from: &str, to: &str) -> String {
    format!("[[connection]]\nfrom = \"p.x.{from}\"\nto = \"f.u_ref.{to}\"\nfactor = -1.0\n")
}

#[track_caller]
fn every_step_is_satisfied(table: &Table) {
    assert!(table.column("f.status").iter().all(|s| *s <= 1.0), "a constraint was not satisfied");
}

/// The position of the disc is computed from the time, not taken from the filter's outputs.
#[test]
fn a_point_mass_meets_a_moving_disc_and_rides_along() {
    let goal = "[[barrier]]\nname = \"goal\"\ncentre = [20.0, 5.0]\nvelocity = [3.0, 1.0]\nradius = 2.0\n\
                deadline = 5.0\n";
    let damping = damping("v_x", "u_x") + &damping("v_y", "u_y");
    let table = coupled("point_mass", goal, "{ v_x = -2.0, v_y = 1.0 }", &damping);
    every_step_is_satisfied(&table);
    let (time, x, y) = (table.column("time"), table.column("p.x.x_p"), table.column("p.x.y_p"));
    for k in 0..time.len() {
        let t = time[k];
        let distance = (x[k] - 20.0 - 3.0 * t).hypot(y[k] - 5.0 - t);
        assert!(t < DEADLINE || distance <= 2.0, "{distance} m from the centre at {t} s");
    }
}

/// Without the rock, the path to the goal leads through it.
#[test]
fn a_goal_behind_an_obstacle_that_comes_closer() {
    let goal = "[[barrier]]\nname = \"goal\"\ncentre = [20.0, 1.0]\nradius = 2.0\ndeadline = 5.0\n";
    let rock = "[[barrier]]\nname = \"rock\"\nshape = \"obstacle\"\ncentre = [12.0, 0.0]\n\
                velocity = [-0.5, 0.05]\nradius = 1.0\ndeadline = 5.0\n";
    let damping = damping("v_x", "u_x") + &damping("v_y", "u_y");
    let mut closest = [f64::INFINITY; 2];
    for (closest, barriers) in closest.iter_mut().zip([goal.to_owned(), goal.to_owned() + rock]) {
        let table = coupled("point_mass", &barriers, "{ v_x = 1.0 }", &damping);
        every_step_is_satisfied(&table);
        let (time, h) = (table.column("time"), table.column("f.goal.h"));
        assert!((0..time.len()).all(|k| time[k] < DEADLINE || h[k] >= 0.0), "late, or left again");
        let (x, y) = (table.column("p.x.x_p"), table.column("p.x.y_p"));
        for k in 0..time.len() {
            let distance = (x[k] - 12.0 + 0.5 * time[k]).hypot(y[k] - 0.05 * time[k]);
            *closest = closest.min(distance);
        }
    }
    assert!(closest[0] < 0.5 && closest[1] >= 1.0, "without and with the rock {closest:?} m from its centre");
}

#[test]
fn bicycles_steered_by_rates_keep_the_deadline() {
    for (model, angle) in [("bicycle_kinematic", "delta"), ("bicycle_small_slip_rate", "beta")] {
        let goal = "[[barrier]]\nname = \"goal\"\ncentre = [20.0, 10.0]\nradius = 2.0\ndeadline = 5.0\n";
        let damping = damping("v", "a") + &damping(angle, &format!("{angle}_rate"));
        let table = coupled(model, goal, "{ theta = 0.4, v = 3.0 }", &damping);
        every_step_is_satisfied(&table);
        let (time, h) = (table.column("time"), table.column("f.goal.h"));
        assert!((0..time.len()).all(|k| time[k] < DEADLINE || h[k] >= 0.0), "{model}: late, or left again");
    }
}

/// The example of a car steered by an integrated angle, and the same with a small-slip bicycle and exact
/// measurements. Their positions follow from the angle that the plant received, which stays within its limits
/// and rate limits.
#[test]
fn bicycles_steered_by_angles_keep_the_deadline() {
    let edits: [&[(&str, &str)]; 2] = [
        &[],
        &[
            ("bicycle_kinematic_angle", "bicycle_small_slip"),
            ("bicycle_kinematic", "bicycle_small_slip_rate"),
            ("delta", "beta"),
            ("l_f = 1.5", ""),
            ("x_p = 0.02", "x_p = 0.0"),
            ("y_p = 0.02", "y_p = 0.0"),
            ("v = 0.05", "v = 0.0"),
            // The row of a bicycle vanishes perpendicular to the line of sight.
            ("theta = -0.2", "theta = 0.4"),
        ],
    ];
    for (edits, angle) in edits.into_iter().zip(["delta", "beta"]) {
        let workshop = Workshop::with_library();
        for stem in ["car-filter", "car-plant", "car"] {
            let toml = format!("{stem}.toml");
            let text = fs::read_to_string(examples().join(&toml)).expect("an example");
            workshop.write(&toml, edits.iter().fold(text, |text, (from, to)| text.replace(from, to)));
            if stem != "car" {
                workshop.punctual(["build", &toml, "-o", &format!("{stem}.fmu")]).success();
            }
        }
        workshop.punctual(["run", "car.toml", "--out", "out", "--require", "kept"]).success();
        let table = Table::parse(&workshop.text("out/car.csv"));
        every_filter_step_is_satisfied(&table);
        let (time, x, y) = (table.column("time"), table.column("plant.x.x_p"), table.column("plant.x.y_p"));
        let error = if edits.is_empty() { 0.02 * 2.0_f64.sqrt() } else { 0.0 };
        for k in 0..time.len() {
            // The true distance is at least the measured one minus its error; the margin is 0.05 m.
            let distance = (x[k] - 20.0).hypot(y[k] - 10.0) - error;
            assert!(time[k] < DEADLINE || distance <= 2.0, "{angle}: {distance} m at {} s", time[k]);
        }
        let held = table.column(&format!("filter.u.{angle}"));
        let kept = table.column(&format!("filter.integrator.{angle}"));
        for k in 1..time.len() {
            // From mean to mean, the angle changes over half of one step and half of the next, at rates
            // within 1 rad/s.
            let change = (held[k] - held[k - 1]).abs();
            assert!(held[k].abs() <= 0.7 && change <= 0.01 + 1e-12, "{} rad at {} s", held[k], time[k]);
            assert!((kept[k] - 2.0 * held[k] + kept[k - 1]).abs() <= 1e-12, "the mean of a step");
        }
        assert!(held.iter().any(|angle| angle.abs() > 0.05), "never steered by {angle}");
    }
}

/// A goal whose position comes from another FMU, past an obstacle. The leader's position comes from its own
/// column. It does not keep its velocity, contrary to what the filter expects between samples.
#[test]
fn a_goal_that_is_another_fmu() {
    let workshop = Workshop::with_library();
    for stem in ["escort-filter", "escort-plant"] {
        let (toml, fmu) = (format!("{stem}.toml"), format!("{stem}.fmu"));
        workshop.write(&toml, fs::read(examples().join(&toml)).expect("an example"));
        workshop.punctual(["build", &toml, "-o", &fmu]).success();
    }
    workshop.write("escort.toml", fs::read(examples().join("escort.toml")).expect("an example"));
    workshop.punctual(["run", "escort.toml", "--out", "out"]).success();
    let table = Table::parse(&workshop.text("out/escort.csv"));
    assert!(table.column("filter.status").iter().all(|s| *s <= 1.0), "a constraint was not satisfied");
    let column = |name: &str| table.column(name);
    let (time, x, y) = (column("time"), column("plant.x.x_p"), column("plant.x.y_p"));
    let (lead_x, lead_y) = (column("leader.x.x_p"), column("leader.x.y_p"));
    for k in 0..time.len() {
        let t = time[k];
        let apart = (x[k] - lead_x[k]).hypot(y[k] - lead_y[k]);
        assert!(t < DEADLINE || apart <= 2.0, "{apart} m from the leader at {t} s");
        let clear = (x[k] - 12.0 + 0.5 * t).hypot(y[k] - 0.05 * t);
        assert!(clear >= 1.0, "{clear} m from the buoy at {t} s");
    }
    assert!(lead_x[time.len() - 1] < 20.0 + 3.0 * 20.0 - 15.0, "the leader brakes");
}

/// Three FMUs, connected by name alone: the controller visits its waypoints, the filter keeps the deadline.
#[test]
fn a_controller_a_filter_and_a_plant() {
    let workshop = Workshop::with_library();
    for stem in ["tour-controller", "unicycle-filter", "unicycle-plant"] {
        let (toml, fmu) = (format!("{stem}.toml"), format!("{stem}.fmu"));
        workshop.write(&toml, fs::read(examples().join(&toml)).expect("an example"));
        workshop.punctual(["build", &toml, "-o", &fmu]).success();
    }
    workshop.write("tour.toml", fs::read(examples().join("tour.toml")).expect("an example"));
    workshop.punctual(["run", "tour.toml", "--out", "out"]).success();
    let table = Table::parse(&workshop.text("out/tour.csv"));
    every_filter_step_is_satisfied(&table);
    let (time, h) = (table.column("time"), table.column("filter.goal.h"));
    assert!((0..time.len()).all(|k| time[k] < 10.0 || h[k] >= 0.0), "late, or left again");
    // The vehicle visited every waypoint in order, and the filter reads the controller's output.
    let waypoint = table.column("controller.waypoint");
    assert!(waypoint.windows(2).all(|w| w[0] <= w[1]) && waypoint[0] == 1.0);
    assert_eq!(waypoint.last(), Some(&3.0));
    let controller = Heading { speed_limit: 8.0, ..Heading::towards([0.0; 2]) };
    let points = [[12.0, 6.0], [30.0, 26.0], [44.0, 44.0]];
    let x = ["x_p", "y_p", "theta", "v"].map(|name| table.column(&format!("plant.x.{name}")));
    let read = ["a", "omega"].map(|name| table.column(&format!("filter.u_ref.{name}")));
    for k in 0..time.len() {
        let at = Heading { goal: points[waypoint[k] as usize - 1], ..controller };
        let wanted = at.unicycle(&[x[0][k], x[1][k], x[2][k], x[3][k]]);
        assert_eq!(wanted.map(f64::to_bits), [read[0][k], read[1][k]].map(f64::to_bits), "at {} s", time[k]);
    }
}

#[track_caller]
fn every_filter_step_is_satisfied(table: &Table) {
    assert!(table.column("filter.status").iter().all(|s| *s <= 1.0), "a constraint was not satisfied");
}
