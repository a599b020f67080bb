//! Missions: where to be and when, in one line beside the tables of places.

use serde_json::Value;

use crate::workshop::Workshop;

/// A vehicle among places, all of them 1 m in radius but the pillar.
fn file(mission: &str, u_ref: &str) -> String {
    let mut text = format!(
        "kind = \"filter\"\nmission = \"{mission}\"\nplant.model = \"point_mass\"\nx0 = {{ v_x = 0.0 }}\n{u_ref}\n\
         bounds = {{ u_x = [-2.0, 2.0], u_y = [-2.0, 2.0] }}\nexperiment = {{ stop_time = 26.0, step_size = 0.05 }}\n"
    );
    let places = [
        ("A", [10.0, 0.0], 1.0),
        ("B", [10.0, 12.0], 1.0),
        ("home", [0.0, 0.0], 1.0),
        ("pillar", [5.0, 0.5], 1.5),
    ];
    for (name, [x, y], radius) in places.into_iter().filter(|(name, ..)| mission.contains(name)) {
        text += &format!("[[barrier]]\nname = \"{name}\"\ncentre = [{x:?}, {y:?}]\nradius = {radius:?}\n");
    }
    text
}

/// Promised and done, whatever the controller wants; the plan decides on order and times.
#[test]
fn missions_are_promised_and_done() {
    let workshop = Workshop::new();
    for (mission, u_ref) in [
        ("F[0,8] A & F[8,16] B & F[0,25] G home & G !pillar", "u_ref = { u_x = \"-v_x\", u_y = \"-v_y\" }"),
        // Both by the same time: in some order.
        ("F[0,20] B & F[0,20] A & G !pillar", "u_ref = { u_x = \"-1\", u_y = \"sin(t)\" }"),
        ("F[0,9] G[0,3] A & (F[0,14] B | F[0,14] G home) & G !pillar", ""),
        ("!B U[0,12] A & F[0,20] G B & G[3,6] !pillar", "u_ref = { u_x = \"2\", u_y = \"2\" }"),
        ("F[0,9] (A & F[0,12] B) & G !pillar", ""),
    ] {
        workshop.write("tour.toml", file(mission, u_ref));
        let run = workshop.punctual(["run", "tour.toml", "--require", "guaranteed", "--json"]);
        let report: Value = serde_json::from_str(&run.success()).expect("JSON");
        let promises = report["promises"].as_array().expect("a list");
        assert!(promises.len() >= 3, "{mission}: {report}");
    }
    // What cannot be done is refused, with the place that is missed.
    workshop.write("tour.toml", file("F[0,3] B", ""));
    let refused = workshop.punctual(["check", "tour.toml"]);
    assert!(
        refused.code == 1 && refused.stdout.contains("in the closest attempt, B is not met at 3 s"),
        "{refused:#?}"
    );
}
