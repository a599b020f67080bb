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

/// What a mission keeps at all times is not promised to who starts outside of it, and `check` says that and fails.
#[test]
fn a_start_where_a_mission_forbids_it_is_named() {
    let workshop = Workshop::new();
    let text = file("F[0,20] A & G !home", "");
    workshop.write("tour.toml", text);
    let check = workshop.punctual(["check", "tour.toml"]);
    assert_eq!(check.code, 1, "{check:#?}");
    for line in [
        "backup plan: found; within the bounds, it keeps what is promised, whatever u_ref is",
        "not promised from there, and not in the plan: home",
        "warning: home: outside at the start and without a deadline: nothing is promised; give it a deadline",
    ] {
        assert!(check.stdout.contains(line) || check.stderr.contains(line), "{line}: {check:#?}");
    }
}

/// A mission of a team, in the names of its members, with the distance between them.
#[test]
fn a_team_does_its_mission() {
    let workshop = Workshop::new();
    let agents = "[[agent]]\nname = \"red\"\n[[agent]]\nname = \"blue\"\nx0 = { x_p = 8.0 }\n";
    let places = "[[barrier]]\nname = \"A\"\ncentre = [8.0, 0.0]\nradius = 1.0\n[[barrier]]\nname = \"B\"\ncentre = [0.0, 0.0]\nradius = 1.0\n";
    workshop.write(
        "team.toml",
        format!(
            "kind = \"filter\"\nmission = \"F[0,12] red_A & F[0,14] blue_B\"\nplant.model = \"point_mass\"\nkeep_apart = 1.5\n\
             u_ref = {{ u_x = \"-v_x\", u_y = \"-v_y\" }}\nbounds = {{ u_x = [-2.0, 2.0], u_y = [-2.0, 2.0] }}\n\
             experiment = {{ stop_time = 15.0, step_size = 0.05 }}\n{agents}{}",
            places.replace("name = \"A\"", "name = \"A\"\nagent = \"red\"").replace("name = \"B\"", "name = \"B\"\nagent = \"blue\"")
        ),
    );
    let run = workshop.punctual(["run", "team.toml", "--require", "guaranteed", "--json", "--report"]);
    let report: Value = serde_json::from_str(&run.success()).expect("JSON");
    let promises = report["promises"].as_array().expect("a list");
    let names: Vec<&str> = promises.iter().filter_map(|promise| promise["barrier"].as_str()).collect();
    assert_eq!(names, ["filter.red_A", "filter.blue_B", "filter.apart_red_blue"]);
    // The page moves each of them.
    let page = workshop.text("team/team.html");
    assert!(["\"label\":\"red\"", "\"label\":\"blue\""].iter().all(|label| page.contains(label)));
}
