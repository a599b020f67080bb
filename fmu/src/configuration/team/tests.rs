//! Teams as their joint model, and the shapes on models without a name.

use super::super::{Configuration, FilterConfiguration, Shape};

const TEAM: &str = r#"
kind = "filter"
plant = { model = "bicycle", l_r = 2.0 }
bounds = { a = [-3.0, 3.0], blue_a = [-2.0, 1.0], beta = [-0.4, 0.4] }
keep_apart = 1.5
x0 = { v = 1.0 }
u_ref = { a = "1 - v", beta = "-sin(theta)/l_r" }
experiment = { stop_time = 5.0, step_size = 0.05 }
[[agent]]
name = "red"
x0 = { x_p = -6.0 }
[[agent]]
name = "blue"
x0 = { y_p = 5.0, v = 0.5 }
u_ref = { a = "red_v - v" }
[[barrier]]
name = "goal"
agent = "red"
centre = [6.0, 0.0]
radius = 1.0
deadline = 9.0
[[barrier]]
name = "rock"
shape = "obstacle"
centre = [0.0, 1.0]
radius = 1.0
[[barrier]]
name = "slow"
shape = "speed_limit"
bound = 3.0
[[barrier]]
name = "behind"
expression = "blue_y_p - red_y_p + 20"
"#;

fn filter(text: &str) -> FilterConfiguration {
    match Configuration::parse(text) {
        Ok(Configuration::Filter(filter)) => filter,
        other => panic!("{other:?} of {text}"),
    }
}

fn refusal(text: &str) -> String {
    Configuration::parse(text).expect_err(text).to_string()
}

/// Values of h at `x`.
fn values(filter: &FilterConfiguration, t: f64, x: &[f64]) -> Vec<f64> {
    let mut h = vec![0.0; filter.barrier.len()];
    filter.build().expect("a filter").barrier_values(t, x, &mut h).expect("right dimensions");
    h
}

#[test]
fn a_team_is_its_joint_model() {
    let team = filter(TEAM);
    let names =
        |variables: Vec<super::VariableSection>| variables.into_iter().map(|v| v.name).collect::<Vec<_>>();
    assert_eq!(
        names(team.plant.states()),
        ["red_x_p", "red_y_p", "red_theta", "red_v", "blue_x_p", "blue_y_p", "blue_theta", "blue_v"]
    );
    assert_eq!(names(team.plant.inputs()), ["red_a", "red_beta", "blue_a", "blue_beta"]);
    assert_eq!(
        [team.bounds["red_a"], team.bounds["blue_a"], team.bounds["blue_beta"]],
        [[-3.0, 3.0], [-2.0, 1.0], [-0.4, 0.4]]
    );
    let barriers: Vec<&str> = team.barrier.iter().map(|b| b.name.as_str()).collect();
    assert_eq!(
        barriers,
        ["red_goal", "red_rock", "blue_rock", "red_slow", "blue_slow", "behind", "apart_red_blue"]
    );
    let u_ref = team.run.u_ref.as_ref().expect("some");
    assert_eq!(
        [&u_ref["red_a"], &u_ref["blue_a"], &u_ref["blue_beta"]],
        ["1 - red_v", "red_v - blue_v", "-sin(blue_theta)/l_r"]
    );
    let x0 = &team.run.x0;
    assert_eq!([x0["red_x_p"], x0["red_v"], x0["blue_v"], x0["blue_y_p"]], [-6.0, 1.0, 0.5, 5.0]);
    // h of each is that of one alone, and that of the pair is 0 at the distance.
    let alone = filter(
        &TEAM[..TEAM.find("[[agent]]").unwrap_or_default()]
            .replace("keep_apart = 1.5\n", "")
            .replace("blue_a = [-2.0, 1.0], ", "")
            .replace("x0 = { v = 1.0 }", "")
            .replace(TEAM.lines().find(|line| line.starts_with("u_ref")).unwrap_or_default(), "")
            .chars()
            .chain(
                "[[barrier]]\nname = \"goal\"\ncentre = [6.0, 0.0]\nradius = 1.0\ndeadline = 9.0\n[[barrier]]\nname = \"rock\"\n\
                 shape = \"obstacle\"\ncentre = [0.0, 1.0]\nradius = 1.0\n[[barrier]]\nname = \"slow\"\nshape = \"speed_limit\"\n\
                 bound = 3.0\n"
                    .chars(),
            )
            .collect::<String>(),
    );
    let (red, blue) = ([4.0, 2.5, 0.3, 1.5], [4.9, 1.3, -0.2, 0.7]);
    let h = values(&team, 0.0, &[red, blue].concat());
    let [of_red, of_blue] = [red, blue].map(|x| values(&alone, 0.0, &x));
    // Only round-off differs.
    for (found, wanted) in
        [(h[0], of_red[0]), (h[1], of_red[1]), (h[2], of_blue[1]), (h[3], of_red[2]), (h[4], of_blue[2])]
    {
        assert!((found - wanted).abs() < 1e-13, "{found} {wanted}");
    }
    assert!(h[6].abs() < 1e-14, "1.5 m apart: {}", h[6]);
    // The team is complete in the file inside an FMU.
    let text = Configuration::Filter(team.clone()).canonical().expect("text");
    let again = filter(&text);
    assert_eq!((again.plant, again.barrier), (team.plant, team.barrier));
}

#[test]
fn what_is_no_team_is_refused() {
    for (from, to, wanted) in [
        ("name = \"blue\"", "name = \"red\"", "agent[1].name: is \"red\", which is another agent's"),
        ("agent = \"red\"", "agent = \"green\"", "barrier[0].agent: is \"green\", must be one of red, blue"),
        ("keep_apart = 1.5", "keep_apart = -1.5", "keep_apart: is -1.5, must be finite and >= 1e-9"),
        (
            "x0 = { x_p = -6.0 }",
            "x0 = { x = -6.0 }",
            "agent[0].x0.x: unknown state, must be one of x_p, y_p, theta, v",
        ),
        (
            "x0 = { x_p = -6.0 }",
            "parameters = { m = 2.0 }",
            "agent[0].parameters.m: is no parameter of the model, must be one of them: l_r",
        ),
        (
            "kind = \"filter\"",
            "kind = \"filter\"\ndisturbance = {}",
            "disturbance: stands beside `[[agent]]`, must be left out: a team has none",
        ),
        (
            "\"bicycle\"",
            "\"bicycle_kinematic_slip\"",
            "plant.model: is \"bicycle_kinematic_slip\", which is a plant only: ",
        ),
        (
            "blue_a = [-2.0, 1.0]",
            "green_a = [-2.0, 1.0]",
            "bounds.green_a: unknown input (did you mean red_a?)",
        ),
    ] {
        let refused = refusal(&TEAM.replacen(from, to, 1));
        assert!(refused.starts_with(wanted), "{refused}");
    }
    let many: String = (0..17).map(|i| format!("[[agent]]\nname = \"a{i}\"\n")).collect();
    let of_many = TEAM.replacen("[[barrier]]", &format!("{many}[[barrier]]"), 1);
    assert_eq!(
        refusal(&of_many),
        "agent: has 19 entries with 4 states each, must have at most 64 states in all"
    );
    let alone = "kind = \"filter\"\nplant.model = \"unicycle\"\nkeep_apart = 1.0\n[[barrier]]\nname = \"goal\"\ncentre = [1.0, 2.0]\n\
                 radius = 1.0\ndeadline = 5.0\n";
    assert_eq!(refusal(alone), "keep_apart: is for a team: it needs `[[agent]]`");
    let of_nobody = alone.replace("keep_apart = 1.0\n", "").replace("radius", "agent = \"red\"\nradius");
    assert_eq!(refusal(&of_nobody), "barrier[0].agent: is for a team: it needs `[[agent]]`");
}

/// What each has is meant of the same agent, and its own constants are its own.
#[test]
fn references_and_constants_are_those_of_the_agent() {
    let text = "kind = \"filter\"\nplant.states = [{ name = \"x\" }, { name = \"v\" }]\nplant.inputs = [{ name = \"u\", min = -1, max = 1 }]\n\
                plant.parameters = [{ name = \"m\", start = 1.0 }, { name = \"goal\", start = 3.0 }]\n\
                plant.derivatives = { x = \"v\", v = \"u/m\" }\nexperiment.step_size = 0.05\n\
                [[agent]]\nname = \"a\"\nparameters = { m = 2.0 }\n[[agent]]\nname = \"b\"\nparameters = { goal = -3.0 }\n\
                [[barrier]]\nname = \"first\"\nexpression = \"1 - abs(x - goal)\"\ndeadline = 6.0\nuntil_arrival = true\n\
                [[barrier]]\nname = \"then\"\nexpression = \"1 - abs(x)\"\ndeadline = 12.0\nafter = \"first\"\n\
                [[barrier]]\nname = \"last\"\nagent = \"b\"\nexpression = \"1 - abs(x - 2)\"\ndeadline = 20.0\nafter = \"a_then\"\n";
    let team = filter(text);
    let derivatives = team.plant.derivatives();
    assert_eq!(derivatives, ["a_v", "a_u/a_m", "b_v", "b_u/m"]);
    let of = |name: &str| team.barrier.iter().find(|b| b.name == name).expect("a barrier");
    assert_eq!(of("b_then").after.as_deref(), Some("b_first"));
    assert_eq!(of("b_last").after.as_deref(), Some("a_then"));
    assert_eq!(values(&team, 0.0, &[3.0, 0.0, -3.0, 0.0])[..2], [1.0, 1.0]);
    assert!(
        matches!(&of("b_first").shape, Shape::Expression { expression, .. } if expression == "1 - abs(b_x - b_goal)")
    );
}

/// Shapes on the unicycle as a model of one's own have the h that they have on the one with a name.
#[test]
fn shapes_on_a_model_without_a_name_are_the_same() {
    let own = "plant.states = [{ name = \"p_x\" }, { name = \"p_y\" }, { name = \"theta\" }, { name = \"v\" }]\n\
               plant.inputs = [{ name = \"a\" }, { name = \"omega\" }]\n\
               plant.derivatives = { p_x = \"v*cos(theta)\", p_y = \"v*sin(theta)\", theta = \"omega\", v = \"a\" }\n";
    let shapes = [
        "radius = 2.0\nvelocity = [0.5, -0.25]",
        "shape = \"obstacle\"\nradius = 2.0\nsmoothing = 0.5",
        "shape = \"quadratic_disc\"\nradius = 2.0",
        "shape = \"ellipse\"\nhalf_axes = [2.0, 1.0]\nangle = 0.4",
        "shape = \"elliptic_obstacle\"\nhalf_axes = [2.0, 1.0]",
        "shape = \"rectangle\"\nhalf_sides = [2.0, 3.0]\nangle = -1.0",
        "shape = \"rectangular_obstacle\"\nhalf_sides = [2.0, 3.0]\nangle = 2.0",
        "shape = \"half_plane\"\nnormal = [2.0, -3.0]",
    ];
    for shape in shapes {
        let rest = format!(
            "experiment.step_size = 0.01\n[[barrier]]\nname = \"set\"\ncentre = [1.5, -2.0]\n{shape}\n"
        );
        let named = filter(&format!("kind = \"filter\"\nplant.model = \"unicycle\"\n{rest}"));
        let own = filter(&format!("kind = \"filter\"\n{own}{rest}"));
        assert_eq!(own.barrier[0].position, ["p_x", "p_y"]);
        for (t, x) in [(0.0, [0.0; 4]), (2.0, [1.0, -3.0, 0.4, 2.0]), (5.0, [-7.0, 4.0, 2.0, -1.0])] {
            let [h, wanted] = [&own, &named].map(|filter| values(filter, t, &x)[0]);
            assert!((h - wanted).abs() <= 1e-12 * wanted.abs().max(1.0), "{shape}: {h} {wanted}");
        }
    }
}

#[test]
fn spheres_and_boxes_are_in_space() {
    let drone = "kind = \"filter\"\nplant.states = [{ name = \"x\" }, { name = \"y\" }, { name = \"z\" }]\n\
                 plant.inputs = [{ name = \"u\" }, { name = \"v\" }, { name = \"w\" }]\n\
                 plant.derivatives = { x = \"u\", y = \"v\", z = \"w\" }\nexperiment.step_size = 0.01\n[[barrier]]\nname = \"set\"\n";
    let h = |shape: &str, x: [f64; 3]| values(&filter(&format!("{drone}{shape}\n")), 0.0, &x)[0];
    let sphere = "shape = \"sphere\"\ncentre = [1.0, 2.0, 3.0]\nradius = 2.0";
    assert!(h(sphere, [1.0, 2.0, 5.0]).abs() < 1e-14 && h(sphere, [1.0, 2.0, 4.9]) > 0.0);
    assert!(h(&sphere.replace("sphere", "spherical_obstacle"), [1.0, 2.0, 4.9]) < 0.0);
    // Within the true box, and around it up to its corners.
    let cuboid =
        "shape = \"box\"\ncentre = [1.0, 0.0, 3.0]\nhalf_sides = [2.0, 1.0, 0.5]\nangle = 1.5707963267948966";
    assert!(h(cuboid, [1.0, 1.99, 3.0]) > 0.0 && h(cuboid, [1.0, 2.01, 3.0]) < 0.0);
    assert!(h(cuboid, [1.0, 0.0, 3.51]) < 0.0 && h(cuboid, [1.9, 1.9, 3.4]) < 0.0);
    let corner = [1.0 - 1.0, 2.0, 3.5];
    assert!(h(&cuboid.replace("box", "box_obstacle"), corner).abs() < 1e-12);
    // A disc is a cylinder.
    assert_eq!(
        h("centre = [1.0, 2.0]\nradius = 1.0", [1.0, 2.0, 99.0]),
        h("centre = [1.0, 2.0]\nradius = 1.0", [1.0, 2.0, 0.0])
    );
    for (shape, wanted) in [
        (
            "shape = \"sphere\"\ncentre = [1.0, 2.0]\nradius = 2.0",
            "barrier[0].centre: has 2 entries, must have 3, along x, y and z for sphere",
        ),
        (
            "centre = [1.0, 2.0, 3.0]\nradius = 2.0",
            "barrier[0].centre: has 3 entries, must have 2, along x and y for disc",
        ),
        ("centre = [1.0]\nradius = 2.0", "barrier[0].centre: has 1 entry, must have 2 or 3 (line 8)"),
        (
            "position = [\"x\", \"q\"]\ncentre = [1.0, 2.0]\nradius = 2.0",
            "barrier[0].position: has \"q\", which is no state, must be of x, y, z",
        ),
        (
            "position = [\"x\", \"x\"]\ncentre = [1.0, 2.0]\nradius = 2.0",
            "barrier[0].position: has \"x\" twice, must be different states",
        ),
        (
            "position = [\"x\"]\ncentre = [1.0, 2.0]\nradius = 2.0",
            "barrier[0].position: has 1 entry, must have 2 or 3: states along x, y and z",
        ),
        (
            "shape = \"apart\"\nfrom = [\"y\", \"z\"]\ndistance = 1.0",
            "barrier[0].from: has a state of `position` (x, y), must be another one",
        ),
        (
            "centre = [1.0, 2.0]\nradius = 2.0\ncentre_input = true",
            "barrier[0].centre_input: is for the plants that have a name; make the centre two states of the model",
        ),
    ] {
        assert_eq!(refusal(&format!("{drone}{shape}\n")), wanted);
    }
    let named = "kind = \"filter\"\nplant.model = \"unicycle\"\n[[barrier]]\nname = \"set\"\nradius = 1.0\n";
    let refused = refusal(&format!("{named}shape = \"sphere\"\ncentre = [1.0, 2.0, 3.0]\n"));
    assert!(
        refused.starts_with("barrier[0].shape: is \"sphere\", which is for models of your own"),
        "{refused}"
    );
    let refused = refusal(&format!("{named}centre = [1.0, 2.0]\nposition = [\"x_p\", \"y_p\"]\n"));
    assert!(refused.starts_with("barrier[0].position: is for models of your own"), "{refused}");
}
