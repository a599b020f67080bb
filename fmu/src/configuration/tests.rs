//! Every defect of a configuration with its message, and the canonical form.

use std::collections::BTreeSet;

use super::names::check_identifier;
use super::*;

const FILTER: &str = r#"
kind = "filter"
plant = { model = "unicycle" }
bounds = { a = [-9.0, 8.0] }
[[barrier]]
name = "goal"
centre = [45.0, 44.0]
radius = 2.0
deadline = 10.0
"#;

const PLANT: &str = r#"
kind = "plant"
plant = { model = "bicycle", l_r = 3.0 }
x0 = { v = 1.5 }
[integration]
inner_step = 0.01
"#;

const UNCERTAIN: &str = r#"
kind = "filter"
plant = { model = "unicycle" }
bounds = { a = [-9.0, 8.0], omega = [-2.0, 2.0] }
uncertainty = { rates = { v = 0.1 }, inputs = { a = { gain = [0.9, 1.0] } } }
[[barrier]]
name = "goal"
centre = [45.0, 44.0]
radius = 2.0
deadline = 10.0
"#;

const STEERED: &str = r#"
kind = "filter"
plant = { model = "bicycle_small_slip_rate", l_r = 1.5 }
integrator = { state = "beta", gain = 4.0, min = -0.5, max = 0.5 }
bounds = { beta_rate = [-4.0, 4.0] }
[[barrier]]
name = "goal"
centre = [45.0, 44.0]
radius = 2.0
deadline = 10.0
"#;

const MISSION: &str = r#"
kind = "filter"
mission = "F[0,5] A & G !C"
plant = { model = "unicycle" }
bounds = { a = [-9.0, 8.0], omega = [-2.0, 2.0] }
[[barrier]]
name = "A"
centre = [1.0, 2.0]
radius = 1.0
[[barrier]]
name = "C"
shape = "rectangle"
centre = [8.0, 2.0]
half_sides = [1.0, 2.0]
[[barrier]]
name = "rest"
shape = "speed_limit"
bound = 3.0
"#;

const HEADING: &str = r#"
kind = "controller"
controller = "heading"
goal = [4.0, 3.0]
plant = { model = "unicycle" }
"#;

const WAYPOINTS: &str = r#"
kind = "controller"
controller = "waypoints"
points = [[4.0, 3.0], [5.0, 6.0]]
plant = { model = "bicycle" }
"#;

/// The message that refuses the defective file; `from` stands exactly once in `valid`.
fn refusal(valid: &str, from: &str, to: &str) -> String {
    assert_eq!(valid.matches(from).count(), 1, "{from:?} in {valid}");
    Configuration::parse(valid).expect("the file without the defect");
    match Configuration::parse(&valid.replace(from, to)) {
        Ok(configuration) => panic!("{to:?} was taken: {configuration:?}"),
        Err(error) => error.to_string(),
    }
}

macro_rules! defects {
    ($($test:ident: $valid:ident, $from:literal => $to:literal, $message:literal;)*) => {$(
        #[test]
        fn $test() {
            assert_eq!(refusal($valid, $from, $to), $message);
        }
    )*};
}

defects! {
    negative_deadline: FILTER, "deadline = 10.0" => "deadline = -1.0",
        "barrier[0].deadline: is -1, must be finite and >= 1e-9";
    zero_deadline: FILTER, "deadline = 10.0" => "deadline = 0.0",
        "barrier[0].deadline: is 0, must be finite and >= 1e-9";
    nan_deadline: FILTER, "deadline = 10.0" => "deadline = nan",
        "barrier[0].deadline: is NaN, must be finite and >= 1e-9";
    radius_zero: FILTER, "radius = 2.0" => "radius = 0.0", "barrier[0].radius: is 0, must be finite and >= 1e-9";
    negative_margin: FILTER, "radius = 2.0" => "radius = 2.0\nmargin = -0.1",
        "barrier[0].margin: is -0.1, must be finite and >= 0";
    negative_disturbance: FILTER, "radius = 2.0" => "radius = 2.0\ndisturbance = -0.1",
        "barrier[0].disturbance: is -0.1, must be finite and >= 0";
    negative_measurement_error: FILTER, "bounds =" => "measurement_errors = { v = -0.1 }\nbounds =",
        "measurement_errors.v: is -0.1, must be finite and >= 0";
    measurement_error_of_no_state: FILTER, "bounds =" => "measurement_errors = { w = 0.1 }\nbounds =",
        "measurement_errors.w: unknown measured state, must be one of x_p, y_p, theta, v";
    measurement_error_of_an_integrated_state: STEERED, "bounds =" => "measurement_errors = { beta = 0.1 }\nbounds =",
        "measurement_errors.beta: unknown measured state (did you mean theta?), must be one of x_p, y_p, theta, v";
    measurement_error_of_a_pointwise_row: FILTER,
        "bounds =" => "sampling = \"pointwise\"\nmeasurement_errors = { v = 0.1 }\nbounds =",
        "measurement_errors: needs the prediction over the period, the sampling is pointwise";
    measurement_error_of_the_repeated_root: FILTER,
        "bounds = { a = [-9.0, 8.0] }\n[[barrier]]" =>
        "measurement_errors = { v = 0.1 }\n[[barrier]]\nmethod = \"repeated_root\"",
        "goal.measurement_errors: needs a method that allows for errors, such as the reference profile";
    measurement_error_of_a_delayed_filter: FILTER,
        "bounds =" => "assurance = \"off\"\nactuation_delay = 0.001\nmeasurement_errors = { v = 0.1 }\nbounds =",
        "measurement_errors: needs an actuation_delay of 0, it is 0.001";
    negative_uncertain_rate: UNCERTAIN, "v = 0.1" => "v = -0.1",
        "uncertainty.rates.v: is -0.1, must be finite and >= 0";
    infinite_uncertain_rate: UNCERTAIN, "v = 0.1" => "v = inf",
        "uncertainty.rates.v: is inf, must be finite and >= 0";
    uncertain_rate_of_no_state: UNCERTAIN, "v = 0.1" => "thetha = 0.1",
        "uncertainty.rates.thetha: unknown state (did you mean theta?), must be one of x_p, y_p, theta, v";
    uncertain_input_of_another_plant: UNCERTAIN, "a = { gain" => "beta = { gain",
        "uncertainty.inputs.beta: unknown input, must be one of a, omega";
    gain_of_nothing: UNCERTAIN, "[0.9, 1.0]" => "[0.0, 1.0]",
        "uncertainty.inputs.a.gain[1]: is 0, must be finite and >= 1e-9";
    gain_that_turns_an_input_around: UNCERTAIN, "[0.9, 1.0]" => "[-0.9, 1.0]",
        "uncertainty.inputs.a.gain[1]: is -0.9, must be finite and >= 1e-9";
    gain_that_is_no_number: UNCERTAIN, "[0.9, 1.0]" => "[0.9, nan]",
        "uncertainty.inputs.a.gain[2]: is NaN, must be finite and >= 1e-9";
    gain_from_more_to_less: UNCERTAIN, "[0.9, 1.0]" => "[1.1, 0.9]",
        "uncertainty.inputs.a.gain: is [1.1, 0.9], must be [least, largest] with least <= largest (in an FMU: \
         uncertainty.gain_min.a, uncertainty.gain_max.a)";
    gain_with_one_end: UNCERTAIN, "[0.9, 1.0]" => "[0.9]", "uncertainty.inputs.a.gain: has 1 entry, must have 2 (line 5)";
    lag_before_its_time: UNCERTAIN, "gain = [0.9, 1.0]" => "lag = [-0.1, 0.1]",
        "uncertainty.inputs.a.lag[1]: is -0.1, must be finite and >= 0";
    lag_from_more_to_less: UNCERTAIN, "gain = [0.9, 1.0]" => "lag = [0.1, 0.0]",
        "uncertainty.inputs.a.lag: is [0.1, 0], must be [least, largest] with least <= largest (in an FMU: \
         uncertainty.lag_min.a, uncertainty.lag_max.a)";
    uncertain_delay: UNCERTAIN, "gain = [0.9, 1.0]" => "delay = 0.1",
        "uncertainty.inputs.a.delay: is an unknown key; the keys are gain, lag (line 5)";
    uncertain_parameters: UNCERTAIN, "rates = { v = 0.1 }" => "parameters = { mass = [1.0, 2.0] }",
        "uncertainty.parameters: is an unknown key (did you mean rates?) (line 5)";
    uncertainty_without_plans: UNCERTAIN, "uncertainty =" => "assurance = \"off\"\nuncertainty =",
        "uncertainty: only plans account for it, and none are followed: assurance is \"off\". Change that, or leave `[uncertainty]` out";
    uncertainty_without_bounds: UNCERTAIN, ", omega = [-2.0, 2.0]" => "",
        "uncertainty: only plans account for it, and none are followed: omega has no bounds. Change that, or leave `[uncertainty]` out";
    uncertainty_beside_a_delay: UNCERTAIN, "uncertainty =" => "actuation_delay = 0.3\nuncertainty =",
        "uncertainty: only plans account for it, and none are followed: actuation_delay is 0.3, must be <= 250 times period = 0.001 \
         for a plan. Change that, or leave `[uncertainty]` out";
    an_acceleration_of_a_centre_that_is_no_input: UNCERTAIN, "radius = 2.0" => "radius = 2.0\nacceleration = 0.3",
        "barrier[0].acceleration: is for a centre that is measured: it needs `centre_input = true`";
    an_error_of_a_centre_without_its_acceleration: UNCERTAIN,
        "radius = 2.0" => "radius = 2.0\ncentre_input = true\nvelocity_error = 0.3",
        "barrier[0].velocity_error: needs `acceleration` beside it: only plans account for it";
    a_negative_acceleration_of_a_centre: UNCERTAIN,
        "radius = 2.0" => "radius = 2.0\ncentre_input = true\nacceleration = -0.3",
        "barrier[0].acceleration: is -0.3, must be finite and >= 0";
    uncertainty_beside_a_disturbance: UNCERTAIN, "radius = 2.0" => "radius = 2.0\ndisturbance = 0.2",
        "uncertainty: only plans account for it, and none are followed: goal.disturbance is 0.2, must be 0 for a plan; plans account \
         for `rates` of [uncertainty] in its place. Change that, or leave `[uncertainty]` out";
    uncertainty_beside_an_input_of_a_barrier: UNCERTAIN, "radius = 2.0" => "radius = 2.0\ncentre_input = true",
        "uncertainty: only plans account for it, and none are followed: goal follows a centre that is moved from outside, and no \
         plan can predict it without its `acceleration`, by how much its velocity may change. Change that, or leave `[uncertainty]` out";
    uncertainty_behind_an_integrator: STEERED,
        "bounds = { beta_rate = [-4.0, 4.0] }" =>
        "bounds = { a = [-4.0, 4.0], beta_rate = [-4.0, 4.0] }\nuncertainty = { rates = { v = 0.1 } }",
        "uncertainty: only plans account for it, and none are followed: no plan accounts yet for [uncertainty] behind an \
         [integrator]. Change that, or leave `[uncertainty]` out";
    barrier_called_uncertainty: UNCERTAIN, "name = \"goal\"" => "name = \"uncertainty\"",
        "barrier[0].name: is \"uncertainty\", which is already the name of something else";
    disturbance_of_no_input: PLANT, "[integration]" => "[disturbance]\ninputs = { omega = 1.0 }\n[integration]",
        "disturbance.inputs.omega: unknown input, must be one of a, beta";
    disturbance_of_no_state: PLANT, "[integration]" => "[disturbance]\nmeasurements = { w = 1.0 }\n[integration]",
        "disturbance.measurements.w: unknown state, must be one of x_p, y_p, theta, v";
    negative_bound_of_a_disturbance: PLANT,
        "[integration]" => "[disturbance]\ninputs = { a = -1.0 }\n[integration]",
        "disturbance.inputs.a: is -1, must be finite and >= 0";
    negative_noise: PLANT, "[integration]" => "[disturbance]\nmeasurements = { v = -1.0 }\n[integration]",
        "disturbance.measurements.v: is -1, must be finite and >= 0";
    seed_that_is_none: PLANT, "[integration]" => "[disturbance]\nseed = inf\n[integration]",
        "disturbance.seed: is inf, must be finite and >= 0";
    disturbance_that_does_not_last: PLANT, "[integration]" => "[disturbance]\nperiod = 0.0\n[integration]",
        "disturbance.period: is 0, must be finite and >= 1e-9";
    negative_rate: FILTER, "radius = 2.0" => "radius = 2.0\nrate = -1.0",
        "barrier[0].rate: is -1, must be finite and >= 0";
    negative_stay_rate: FILTER, "radius = 2.0" => "radius = 2.0\nstay_rate = -1.0",
        "barrier[0].stay_rate: is -1, must be finite and >= 0";
    negative_smoothing: FILTER, "radius = 2.0" => "radius = 2.0\nsmoothing = -1.0",
        "barrier[0].smoothing: is -1, must be finite and >= 0";
    infinite_velocity: FILTER, "radius = 2.0" => "radius = 2.0\nvelocity = [0.0, -inf]",
        "barrier[0].velocity[2]: is -inf, must be finite";
    mixed_relative_degree: FILTER, "model = \"unicycle\"" => "model = \"bicycle_small_slip\"",
        "barrier[0]: its relative degree along bicycle_small_slip is mixed: beta enters derivative 1, a enters \
         derivative 2 of h; one row cannot use them all. Plans can, but none are followed: beta has no bounds. Mend \
         that, or take the model bicycle_small_slip_rate or bicycle_kinematic, with `[integrator]` where the plant is steered by the angle itself";
    an_output_twice: PLANT, "[integration]" => "output = [{ name = \"a\", expression = \"v\", unit = \"m/s\" }, { name = \"a\", expression = \"v\", unit = \"m/s\" }]\n[integration]",
        "output[1].name: is \"a\", which is already the name of something else";
    an_output_of_an_input: PLANT, "[integration]" => "output = [{ name = \"a\", expression = \"a\" }]\n[integration]",
        "output[0].expression: names a, an input, which it does not depend on";
    an_output_in_another_unit: PLANT, "[integration]" => "output = [{ name = \"a\", expression = \"v * cos(theta)\", unit = \"km/h\" }]\n[integration]",
        "output[0].unit: is \"km/h\", but \"v * cos(theta)\" is in m/s";
    a_filter_that_is_not_affine_in_the_steering_angle: FILTER, "model = \"unicycle\"" => "model = \"bicycle_kinematic_angle\"",
        "plant.model: is \"bicycle_kinematic_angle\", which is a plant only: delta does not enter linearly, as a \
         filter needs it; take the model bicycle_kinematic with `[integrator] state = \"delta\"`";
    a_filter_that_is_not_affine_in_the_slip_angle: FILTER, "model = \"unicycle\"" => "model = \"bicycle_kinematic_slip\"",
        "plant.model: is \"bicycle_kinematic_slip\", which is a plant only: beta does not enter linearly, as a \
         filter needs it; take bicycle, or bicycle_small_slip_rate with `[integrator] state = \"beta\"`, which \
         nearly are it";
    front_length_of_a_slip_angle: PLANT, "\"bicycle\", l_r = 3.0" => "\"bicycle_kinematic_slip\", l_f = 3.0",
        "plant.l_f: is a constant of bicycle_kinematic; this model has none";
    integrator_of_no_state: STEERED, "state = \"beta\"" => "state = \"v_x\"",
        "integrator.state: is \"v_x\", must be a state whose derivative is an input that moves nothing else: v, beta";
    integrator_of_a_state_that_is_no_integral: STEERED, "state = \"beta\"" => "state = \"theta\"",
        "integrator.state: is \"theta\", must be a state whose derivative is an input that moves nothing else: v, beta";
    gain_of_an_integrator: STEERED, "gain = 4.0" => "gain = 0.0",
        "integrator.gain: is 0, must be finite and >= 1e-9";
    limits_of_an_integrator: STEERED, "min = -0.5" => "min = 0.6",
        "integrator.min, integrator.max: is [0.6, 0.5], must be [min, max] with min <= max";
    limit_that_is_no_number: STEERED, "min = -0.5" => "min = nan",
        "integrator.min: is NaN, must be finite and >= -1e30 and <= 1e30";
    rates_without_zero: STEERED, "[-4.0, 4.0]" => "[1.0, 4.0]",
        "bounds: is [1, 4] for the rate, must contain 0";
    integrator_of_a_delayed_filter: STEERED, "kind" => "actuation_delay = 0.001\nkind",
        "actuation_delay: is 0.001, must be 0 with an integrator";
    front_length_of_another_model: PLANT, "l_r = 3.0" => "l_f = 3.0",
        "plant.l_f: is a constant of bicycle_kinematic; this model has none";
    infinite_centre: FILTER, "[45.0, 44.0]" => "[45.0, inf]", "barrier[0].centre[2]: is inf, must be finite";
    smoothing_of_a_quadratic_disc: FILTER,
        "radius = 2.0" => "radius = 2.0\nshape = \"quadratic_disc\"\nsmoothing = 1.0",
        "barrier[0].smoothing: quadratic_disc has none";
    a_field_of_another_shape: FILTER, "radius = 2.0" => "radius = 2.0\nnormal = [1.0, 0.0]",
        "barrier[0].normal: disc has none";
    an_ellipse_without_axes: FILTER, "radius = 2.0" => "shape = \"ellipse\"",
        "barrier[0].half_axes: missing, ellipse needs it";
    a_negative_half_side: FILTER, "radius = 2.0" => "shape = \"rectangle\"\nhalf_sides = [1.0, -1.0]",
        "barrier[0].half_sides[2]: is -1, must be finite and >= 1e-9";
    a_normal_without_direction: FILTER, "radius = 2.0" => "shape = \"half_plane\"\nnormal = [0.0, 0.0]",
        "barrier[0].normal: is [0, 0], must have a direction";
    a_centre_input_of_an_ellipse: FILTER,
        "radius = 2.0" => "shape = \"ellipse\"\nhalf_axes = [1.0, 2.0]\ncentre_input = true",
        "barrier[0].centre_input: ellipse has none";
    a_centre_that_is_nowhere: FILTER, "centre = [45.0, 44.0]" => "centre = [45.0, 1e300]",
        "barrier[0]: its relative degree along unicycle is not known: model or barrier is not finite at any sample state; its numbers are too large";
    an_unknown_state: FILTER,
        "centre = [45.0, 44.0]\nradius = 2.0" => "shape = \"at_most\"\nstate = \"w\"\nbound = 1.0",
        "barrier[0].state: is \"w\", must be one of x_p, y_p, theta, v";
    a_priority_of_a_soft_barrier: FILTER, "radius = 2.0" => "radius = 2.0\npriority = 1\npenalty = 2.0",
        "barrier[0].priority: belongs to hard barriers, this one has a penalty";
    a_negative_penalty: FILTER, "radius = 2.0" => "radius = 2.0\npenalty = -2.0",
        "barrier[0].penalty: is -2, must be finite and >= 1e-9";
    after_an_unknown_barrier: FILTER, "radius = 2.0" => "radius = 2.0\nafter = \"A\"",
        "barrier[0].after: is \"A\", must be the name of a barrier above";
    begin_after_the_deadline: FILTER, "radius = 2.0" => "radius = 2.0\nbegin = 10.0",
        "barrier[0].begin: is 10, must be < deadline = 10";
    end_before_the_begin: FILTER, "radius = 2.0" => "radius = 2.0\nbegin = 5.0\nend = 4.0",
        "barrier[0].end: is 4, must be > begin = 5";
    end_before_the_deadline: FILTER, "radius = 2.0" => "radius = 2.0\nend = 4.0",
        "barrier[0].end: is 4, must be >= deadline = 10, the promise to keep";
    two_ends: FILTER, "radius = 2.0" => "radius = 2.0\nuntil_arrival = true\nend = 4.0",
        "barrier[0].end: is 4, must be 0 beside `until_arrival`";
    a_stay_beside_an_end: FILTER, "radius = 2.0" => "radius = 2.0\nstay = 2.0\nend = 14.0",
        "barrier[0].end: is 14, must be 0 beside `stay`";
    a_stay_beside_an_arrival: FILTER, "radius = 2.0" => "radius = 2.0\nstay = 2.0\nuntil_arrival = true",
        "barrier[0].stay: given beside `until_arrival`, must be without: each is an end";
    a_negative_stay: FILTER, "radius = 2.0" => "radius = 2.0\nstay = -2.0",
        "barrier[0].stay: is -2, must be finite and >= 0";
    until_itself: FILTER, "radius = 2.0" => "radius = 2.0\nuntil = \"goal\"",
        "barrier[0].until: is \"goal\", must be the name of another barrier";
    a_choice_without_plans: MISSION, "G !C" => "(G !C | F[0,9] A)\"\nassurance = \"off",
        "barrier[1].choice: only plans can choose, and none are followed: assurance is \"off\". Change that, or leave the choice out";
    a_mission_of_a_place_that_is_nowhere: MISSION, "G !C" => "G !D",
        "mission: has D, which is no barrier, must be one of A, C, rest";
    a_mission_that_forgets_a_place: MISSION, "F[0,5] A & G !C" => "G !C",
        "barrier[0].name: is \"A\", which the mission does not name, so that it had to be kept at all times: name it (`G A`), give it \
         times of its own, or leave it out";
    a_mission_beside_times: MISSION, "centre = [1.0, 2.0]" => "centre = [1.0, 2.0]\ndeadline = 3.0",
        "barrier[0].deadline: stands beside a mission that says when: leave it out, or A out of the mission";
    a_mission_to_be_in_two_places: MISSION, "G !C" => "F[0,4] (A & !C)",
        "mission: has a visit of A & !C at the same time, must be of one: give a barrier that is all of them, such as an \
         `expression` with min";
    a_mission_outside_of_a_limit: MISSION, "G !C" => "G !C & G !rest",
        "mission: has !rest, a speed_limit, of which there is no outside: give a barrier that is it";
    a_visit_that_waits_too_long: MISSION, "F[0,5] A" => "F[0,5] (A & F[2,3] C)",
        "mission: has a visit 2 to 3 s after that of A, which may be 0 to 5 s from the start: that leaves no time that suits all \
         of them; make the window of A narrower, or this one longer";
    rates_of_another_number: FILTER, "radius = 2.0" => "radius = 2.0\nrates = [1.0, 2.0, 3.0]",
        "barrier[0].rates: has 3 components, must have 2, the relative degree";
    a_rate_beside_rates: FILTER, "radius = 2.0" => "radius = 2.0\nrates = [1.0, 2.0]\nrate = 1.0",
        "barrier[0].rates: given beside `rate`, which it replaces";
    unknown_input: FILTER, "a = [-9.0, 8.0]" => "b = [-9.0, 8.0]",
        "bounds.b: unknown input, must be one of a, omega";
    nan_bound: FILTER, "[-9.0, 8.0]" => "[nan, 8.0]",
        "bounds.a: is NaN, must be finite and >= -1e30 and <= 1e30";
    inverted_bounds: FILTER, "[-9.0, 8.0]" => "[9.0, 8.0]",
        "bounds.a: is [9, 8], must be [min, max] with min <= max (in an FMU: u_min.a, u_max.a)";
    lower_bound_plus_infinity: FILTER, "[-9.0, 8.0]" => "[inf, inf]",
        "bounds.a: is inf, must be finite and >= -1e30 and <= 1e30";
    negative_delay: FILTER, "kind = \"filter\"" => "kind = \"filter\"\nactuation_delay = -0.1",
        "actuation_delay: is -0.1, must be finite and >= 0";
    delay_above_the_step: FILTER,
        "kind = \"filter\"" => "kind = \"filter\"\nactuation_delay = 0.5\nsampling = \"step_size\"",
        "actuation_delay: is 0.5, must be <= 250 times sampling_period = 0.001";
    zero_correction_limit: FILTER, "kind = \"filter\"" => "kind = \"filter\"\ncorrection_limit = 0.0",
        "correction_limit: is 0, must be finite and > 0";
    name_with_a_blank: FILTER, "kind = \"filter\"" => "kind = \"filter\"\nname = \"my filter\"",
        "name: is \"my filter\", must be letters, digits and underscores, not starting with a digit (1 to 64)";
    reserved_barrier_name: FILTER, "\"goal\"" => "\"u_ref\"",
        "barrier[0].name: is \"u_ref\", which is already the name of something else";
    empty_barrier_name: FILTER, "\"goal\"" => "\"\"",
        "barrier[0].name: is \"\", must be letters, digits and underscores, not starting with a digit (1 to 64)";
    constant_of_another_model: FILTER, "\"unicycle\" }" => "\"unicycle\", l_r = 1.0 }",
        "plant.l_r: is a constant of the bicycle; this model has none";
    step_size_zero: FILTER, "[[barrier]]" => "[experiment]\nstep_size = 0.0\n[[barrier]]",
        "experiment.step_size: is 0, must be finite and >= 1e-9";
    stop_before_start: FILTER, "[[barrier]]" => "[experiment]\nstart_time = 20.0\n[[barrier]]",
        "experiment.stop_time: is 10 (its default), must be > start_time = 20";
    stop_at_start: FILTER, "[[barrier]]" => "[experiment]\nstart_time = 20.0\nstop_time = 20.0\n[[barrier]]",
        "experiment.stop_time: is 20, must be > start_time = 20";
    nan_start_value: PLANT, "v = 1.5" => "v = nan", "x0.v: is NaN, must be finite";
    unknown_state: PLANT, "v = 1.5" => "w = 1.5", "x0.w: unknown state, must be one of x_p, y_p, theta, v";
    zero_length: PLANT, "l_r = 3.0" => "l_r = 0.0", "plant.l_r: is 0, must be finite and >= 1e-9";
    heading_without_a_goal: HEADING, "goal = [4.0, 3.0]" => "", "goal: missing, heading needs it";
    infinite_goal: HEADING, "[4.0, 3.0]" => "[4.0, inf]", "goal[2]: is inf, must be finite";
    infinite_goal_that_is_an_input: HEADING, "[4.0, 3.0]" => "[nan, 3.0]\ngoal_input = true",
        "goal[1]: is NaN, must be finite";
    points_of_a_heading: HEADING, "goal = [4.0, 3.0]" => "goal = [4.0, 3.0]\npoints = [[1.0, 2.0]]",
        "points: heading has none";
    gain_of_a_heading: HEADING, "goal = [4.0, 3.0]" => "goal = [4.0, 3.0]\ngain = 1.0",
        "gain: heading of unicycle has none";
    zero_speed_gain: HEADING, "goal = [4.0, 3.0]" => "goal = [4.0, 3.0]\nspeed_gain = 0.0",
        "speed_gain: is 0, must be finite and >= 1e-9";
    slip_limit_of_a_unicycle: HEADING, "goal = [4.0, 3.0]" => "goal = [4.0, 3.0]\nslip_limit = 1.0",
        "slip_limit: heading of unicycle has none";
    turn_limit_of_a_point_mass: HEADING, "\"unicycle\" }" => "\"point_mass\" }\nturn_limit = 1.0",
        "turn_limit: heading of point_mass has none";
    heading_of_a_bicycle_steered_by_a_rate: HEADING, "\"unicycle\"" => "\"bicycle_kinematic\"",
        "controller: is \"heading\", which bicycle_kinematic has none of; must be \"damping\" or \"expressions\"";
    no_points: WAYPOINTS, "points = [[4.0, 3.0], [5.0, 6.0]]" => "points = []",
        "points: missing, waypoints needs it";
    infinite_point: WAYPOINTS, "[5.0, 6.0]" => "[5.0, inf]", "points[1][2]: is inf, must be finite";
    goal_of_waypoints: WAYPOINTS, "points = [[4" => "goal = [1.0, 2.0]\npoints = [[4", "goal: waypoints has none";
    goal_input_of_waypoints: WAYPOINTS, "points = [[4" => "goal_input = true\npoints = [[4",
        "goal_input: waypoints has none";
    zero_acceptance_radius: WAYPOINTS, "points = [[4" => "acceptance_radius = 0.0\npoints = [[4",
        "acceptance_radius: is 0, must be finite and >= 1e-9";
    negative_slip_limit: WAYPOINTS, "points = [[4" => "slip_limit = -1.0\npoints = [[4",
        "slip_limit: is -1, must be finite and >= 1e-9";
    zero_inner_step: PLANT, "0.01" => "0.0", "integration.inner_step: is 0, must be finite and >= 1e-9";
}

#[test]
fn duplicate_barrier_name() {
    let barrier = &FILTER[FILTER.find("[[barrier]]").unwrap()..];
    let error = Configuration::parse(&format!("{FILTER}{barrier}")).unwrap_err().to_string();
    assert_eq!(error, "barrier[1].name: is \"goal\", which is already the name of something else");
}

/// A mission is short for barriers with times.
#[test]
fn a_mission_is_its_barriers() {
    let barriers = |text: &str| match Configuration::parse(text).expect("a filter") {
        Configuration::Filter(filter) => filter.barrier,
        other => panic!("{other:?}"),
    };
    let mission = |tasks: &str| barriers(&MISSION.replace("F[0,5] A & G !C", tasks));
    let closed = |keys: &str| {
        format!(
            "[[barrier]]\nname = \"C\"\nshape = \"rectangular_obstacle\"\ncentre = [8.0, 2.0]\nhalf_sides = [1.0, 2.0]\n{keys}"
        )
    };
    let of_a = |tasks: &str, a: &str, c: &str| {
        let wanted = barriers(&format!(
            "kind = \"filter\"\nplant = {{ model = \"unicycle\" }}\nbounds = {{ a = [-9.0, 8.0], omega = [-2.0, 2.0] }}\n\
             [[barrier]]\nname = \"A\"\ncentre = [1.0, 2.0]\nradius = 1.0\n{a}\n{}\n\
             [[barrier]]\nname = \"rest\"\nshape = \"speed_limit\"\nbound = 3.0\n",
            closed(c)
        ));
        assert_eq!(mission(tasks), wanted, "{tasks}");
    };
    of_a("F[0,5] A & G !C", "deadline = 5.0\nuntil_arrival = true", "");
    of_a(
        "F[2,5] A & G[3,4] !C",
        "begin = 2.0\ndeadline = 5.0\nuntil_arrival = true",
        "begin = 3.0\nend = 4.0",
    );
    of_a("F[2,5] G[0,1.5] A & G !C", "begin = 2.0\ndeadline = 5.0\nstay = 1.5", "");
    // Where it is reached at first, it may be left before its deadline.
    of_a("F[0,5] G A & G !C", "begin = 0.001\ndeadline = 5.0", "");
    of_a("!C U[1,5] A", "begin = 1.0\ndeadline = 5.0\nuntil_arrival = true", "until = \"A\"");
    of_a(
        "F[0,5] A | G !C",
        "deadline = 5.0\nuntil_arrival = true\nchoice = \"choice_1\"\nalternative = \"alternative_1\"",
        "choice = \"choice_1\"\nalternative = \"alternative_2\"",
    );
    // One after the other, and a place twice.
    let both = mission("F[1,4] (A & F[0,6] C) & G !C");
    let times: Vec<_> =
        both.iter().map(|b| (b.name.as_str(), b.begin, b.deadline, b.after.as_deref())).collect();
    assert_eq!(
        times,
        [
            ("A", Some(1.0), Some(4.0), None),
            ("C", None, Some(7.0), Some("A")),
            ("C_2", None, None, None),
            ("rest", None, None, None)
        ]
    );
}

#[test]
fn no_barrier() {
    let text = "kind = \"filter\"\nbarrier = []\nplant = { model = \"unicycle\" }";
    let error = Configuration::parse(text).unwrap_err().to_string();
    assert_eq!(error, "barrier: is empty, must have at least 1");
}

/// Unknown and missing keys, unknown words and lists of another length, each with its whole message.
#[test]
fn unknown_and_missing_keys_and_wrong_types() {
    for (valid, from, to, wanted) in [
        (
            FILTER,
            "radius = 2.0",
            "radius = 2.0\nradus = 1.0",
            "barrier[0].radus: is an unknown key (did you mean radius?) (line 9)",
        ),
        (
            FILTER,
            "[[barrier]]",
            "[experiment]\nstep = 1.0\n[[barrier]]",
            "experiment.step: is an unknown key (did you mean step_size?) (line 6)",
        ),
        (
            FILTER,
            "[[barrier]]",
            "[experiment]\nwhen = 1.0\n[[barrier]]",
            "experiment.when: is an unknown key; the keys are start_time, stop_time, step_size, fmi, arrays (line 6)",
        ),
        (FILTER, "radius = 2.0", "", "barrier[0].radius: missing, disc needs it"),
        (FILTER, "name = \"goal\"", "", "barrier[0].name: missing, it must be given (line 5)"),
        (FILTER, "plant = { model = \"unicycle\" }", "", "plant: missing, it must be given"),
        (FILTER, "radius = 2.0", "radius = \"2\"", "barrier[0].radius: is \"2\", must be a number (line 8)"),
        (FILTER, "[45.0, 44.0]", "[45.0]", "barrier[0].centre: has 1 entry, must have 2 or 3 (line 7)"),
        (
            FILTER,
            "[45.0, 44.0]",
            "[45.0, 44.0, 7.0]",
            "barrier[0].centre: has 3 entries, must have 2, along x and y for disc",
        ),
        (
            FILTER,
            "[45.0, 44.0]",
            "[45.0, \"44\"]",
            "barrier[0].centre[2]: is \"44\", must be a number (line 7)",
        ),
        (
            FILTER,
            "[45.0, 44.0]",
            "45.0",
            "barrier[0].centre: is 45.0, must be a list with 2 or 3 entries (line 7)",
        ),
        (FILTER, "[-9.0, 8.0]", "[-9.0, 8.0, 7.0]", "bounds.a: has 3 entries, must have 2 (line 4)"),
        (FILTER, "[-9.0, 8.0]", "8.0", "bounds.a: is 8.0, must be a list with 2 entries (line 4)"),
        (
            FILTER,
            "deadline = 10.0",
            "deadline = 1e999",
            "barrier[0].deadline: is 1e999, must be at most 1.7976931348623157e308 in size (line 9)",
        ),
        (
            FILTER,
            "deadline = 10.0",
            "deadline = 99999999999999999999",
            "barrier[0].deadline: is 99999999999999999999, which is too large for a whole number; write it with a decimal point \
             (line 9)",
        ),
        (
            FILTER,
            "deadline = 10.0",
            "deadline = 10.0\npriority = -1",
            "barrier[0].priority: is -1, must be a whole number >= 0 (line 10)",
        ),
        (
            FILTER,
            "deadline = 10.0",
            "deadline = 10.0\npriority = 1.5",
            "barrier[0].priority: is 1.5, must be a whole number >= 0 (line 10)",
        ),
        (
            FILTER,
            "deadline = 10.0",
            "deadline = 2026-01-31",
            "barrier[0].deadline: is a date or time, must be a number (line 9)",
        ),
        (
            FILTER,
            "\"unicycle\"",
            "\"unicicle\"",
            "plant.model: is \"unicicle\", must be \"point_mass\", \"unicycle\", \"bicycle\", \"bicycle_small_slip\", \
             \"bicycle_small_slip_rate\", \"bicycle_kinematic\", \"bicycle_kinematic_angle\" or \
             \"bicycle_kinematic_slip\" (did you mean unicycle?) (line 3)",
        ),
        (
            FILTER,
            "radius = 2.0",
            "radius = 2.0\nmethod = \"x\"",
            "barrier[0].method: is \"x\", must be \"reference_profile\" or \"repeated_root\" (line 9)",
        ),
        (
            FILTER,
            "\"filter\"",
            "\"Filter\"",
            "kind: is \"Filter\", must be \"filter\", \"plant\" or \"controller\" (did you mean filter?) (line 2)",
        ),
        (
            FILTER,
            "[[barrier]]",
            "[barrier]",
            "barrier: is a table, must be a list; a list of tables is written [[barrier]] (line 5)",
        ),
        (
            PLANT,
            "[integration]",
            "[[integration]]",
            "integration: is a list, must be a table; one table is written [integration] (line 5)",
        ),
        (
            FILTER,
            "\"unicycle\" }",
            "\"unicycle\", inputs = { a = 1 } }",
            "plant.inputs: is a table, must be a list; a list of tables is written [[plant.inputs]] (line 3)",
        ),
        (
            PLANT,
            "inner_step = 0.01",
            "inner_stpe = 0.01",
            "integration.inner_stpe: is an unknown key (did you mean inner_step?) (line 6)",
        ),
        (
            HEADING,
            "\"heading\"",
            "\"headng\"",
            "controller: is \"headng\", must be \"damping\", \"heading\", \"waypoints\" or \"expressions\" (did you mean heading?) (line 3)",
        ),
        (HEADING, "[4.0, 3.0]", "[4.0]", "goal: has 1 entry, must have 2 (line 4)"),
        (
            WAYPOINTS,
            "points = [[4.0, 3.0]",
            "points = [[4.0, 3.0, 1.0]",
            "points[0]: has 3 entries, must have 2 (line 4)",
        ),
        (
            WAYPOINTS,
            "points = [[4",
            "pionts = [[4",
            "pionts: is an unknown key (did you mean points?) (line 4)",
        ),
        (PLANT, "kind", "knd", "kind: missing, must be \"filter\", \"plant\" or \"controller\""),
    ] {
        assert_eq!(refusal(valid, from, to), wanted, "{to:?}");
    }
    let message = refusal(FILTER, "radius = 2.0", "radius = = 2.0");
    assert!(["line 8", "radius"].iter().all(|part| message.contains(part)), "{message:?}");
}

/// Words of Rust and of its libraries, which mean nothing to the writer of a file.
const FOREIGN_WORDS: [&str; 26] = [
    "array",
    "bool",
    "char",
    "deserialize",
    "enum",
    "expected",
    "f32",
    "f64",
    "field",
    "float",
    "floating",
    "i64",
    "integer",
    "invalid",
    "map",
    "None",
    "sequence",
    "serde",
    "Some",
    "str",
    "string",
    "struct",
    "u32",
    "u64",
    "usize",
    "variant",
];

/// A value of the wrong type for each key of each table is refused by its path, in plain words.
#[test]
fn every_key_refuses_other_types_in_plain_words() {
    let model = "kind = \"plant\"\n[plant]\nstates = [{ name = \"x\" }]\ninputs = [{ name = \"u\" }]\n\
                 parameters = [{ name = \"p\", start = 1.0 }]\nderivatives = { x = \"p*u\" }\n";
    let full = format!("{PLANT}[disturbance]\n[experiment]\n");
    let values: toml::Table = "text = \"a b\"\nnumber = 2.5\nwhole = -3\nflag = true\nempty = []\ntexts = [\"a b\"]\n\
                               numbers = [1.5, 2.5]\npairs = [[1.5, 2.5]]\ntables = [{ zz = 1 }]\ntable = { zz = [\"a\"] }\ndate = 2026-01-31\n"
        .parse()
        .unwrap();
    let mut refused = 0;
    for (text, place, table) in [
        (FILTER, "filter", &[][..]),
        (FILTER, "barrier", &["barrier"]),
        (PLANT, "model", &["plant"]),
        (model, "variable", &["plant", "states"]),
        (model, "variable", &["plant", "inputs"]),
        (model, "parameter", &["plant", "parameters"]),
        (STEERED, "integrator", &["integrator"]),
        (UNCERTAIN, "uncertainty", &["uncertainty"]),
        (UNCERTAIN, "uncertain_input", &["uncertainty", "inputs", "a"]),
        (PLANT, "plant", &[]),
        (PLANT, "integration", &["integration"]),
        (&full, "disturbance", &["disturbance"]),
        (HEADING, "controller", &[]),
        (&full, "experiment", &["experiment"]),
    ] {
        Configuration::parse(text).unwrap_or_else(|e| panic!("{e} in {text}"));
        let section = SECTIONS.iter().find(|section| section.name == place).expect("its section");
        for key in (section.keys)() {
            for (kind, value) in &values {
                let fits = match key.value {
                    Value::Number(..) => &["number", "whole"][..],
                    Value::Count(..) => &["whole"],
                    Value::Pair(..) | Value::Place(..) => &["numbers"],
                    Value::Names => &["texts", "empty"],
                    Value::Numbers(..) => &["numbers", "empty"],
                    Value::Pairs(..) => &["pairs", "empty"],
                    Value::Flag => &["flag"],
                    Value::Text | Value::Name | Value::Word(_) => &["text"],
                    Value::TextOrByName => &["text", "table"],
                    Value::NumberByName(..)
                    | Value::PairByName(_)
                    | Value::TextByName
                    | Value::Table(_)
                    | Value::TableByName(_) => &["table"],
                    Value::Tables(_) => &["tables", "empty"],
                };
                // What has the right type is the business of the checks of values.
                if fits.contains(&kind.as_str()) {
                    continue;
                }
                let mut file: toml::Table = text.parse().unwrap();
                let mut at = &mut file;
                for step in table {
                    at = match &mut at[*step] {
                        toml::Value::Array(list) => list[0].as_table_mut().expect("a table"),
                        value => value.as_table_mut().expect("a table"),
                    };
                }
                at.insert(key.name.to_owned(), value.clone());
                let text = file.to_string();
                let Err(error) = Configuration::parse(&text) else {
                    panic!("{place}.{} takes {value}", key.name)
                };
                let (field, message) = (error.field(), error.message());
                assert!(field.contains(key.name), "{place}.{}: {error}", key.name);
                assert!(["must", "has", "no key"].iter().any(|word| message.contains(word)), "{error}");
                let foreign =
                    message.split(|c: char| !c.is_alphanumeric()).find(|word| FOREIGN_WORDS.contains(word));
                assert_eq!(foreign, None, "{place}.{}: {error}", key.name);
                refused += 1;
            }
        }
    }
    assert!(refused > 500, "{refused}");
}

/// A controller of expressions.
const EXPRESSIONS: &str = "kind = \"controller\"\ncontroller = \"expressions\"\nplant.model = \"bicycle\"\nplant.l_r = 2.0\n\
                           u_ref.a = \"-v\"\nu_ref.beta = \"l_r * sin(t - theta)\"\n";

/// A filter with a policy.
const POLICY: &str = "kind = \"filter\"\nplant.model = \"unicycle\"\npolicy.a = \"-v\"\npolicy.omega = \"2 - theta\"\n\
                      bounds = { a = [-4.0, 4.0], omega = [-2.0, 2.0] }\n\
                      [[barrier]]\nname = \"goal\"\ncentre = [1.0, 2.0]\nradius = 1.0\ndeadline = 5.0\n";

#[test]
fn expressions_of_inputs_are_checked() {
    for (valid, from, to, wanted) in [
        (EXPRESSIONS, "u_ref.a", "u_ref.b", "u_ref.b: unknown input, must be one of a, beta"),
        (EXPRESSIONS, "u_ref.a = \"-v\"", "", "u_ref.a: missing, every input needs one; \"0\" is one"),
        (
            EXPRESSIONS,
            "\"-v\"",
            "\"-v + beta\"",
            "u_ref.a: names beta, an input, which it does not depend on",
        ),
        (EXPRESSIONS, "\"expressions\"", "\"damping\"", "u_ref: damping has none"),
        (EXPRESSIONS, "u_ref.a =", "gain = 2.0\nu_ref.a =", "gain: expressions of bicycle has none"),
        (
            EXPRESSIONS,
            "plant.model = \"bicycle\"",
            "plant.plugin = \"arm\"",
            "plant.plugin: is for filters and plants; give `model`, or `states`, `inputs` and `derivatives`",
        ),
        (POLICY, "policy.a", "policy.b", "policy.b: unknown input, must be one of a, omega"),
        (
            POLICY,
            "\"2 - theta\"",
            "\"2 - thta\"",
            "policy.omega: names thta, which is unknown (did you mean theta?); the names are x_p, y_p, theta, v",
        ),
        (
            POLICY,
            "policy.a",
            "assurance = \"off\"\npolicy.a",
            "policy: is for plans, of which there are none: assurance is \"off\"",
        ),
        (
            POLICY,
            ", omega = [-2.0, 2.0] }",
            " }",
            "policy: is for plans, of which there are none: omega has no bounds",
        ),
        (
            POLICY,
            "omega = [-2.0,",
            "omega = [-inf,",
            "policy: is for plans, of which there are none: omega has no lower bound",
        ),
    ] {
        assert_eq!(refusal(valid, from, to), wanted, "{to}");
    }
}

/// A filter for an uncertain plant follows plans, which cover what the file declares, and no more.
#[test]
fn what_plans_cover_is_what_the_file_declares() {
    let read = |text: &str| match Configuration::parse(text) {
        Ok(Configuration::Filter(filter)) => filter,
        other => panic!("{other:?}"),
    };
    let errors = "measurement_errors = { x_p = 0.02, theta = 0.01 }\n";
    let filter = read(&UNCERTAIN.replace("uncertainty =", &format!("{errors}uncertainty =")));
    assert!(filter.is_assured() && filter.ends_plans() && filter.warning().is_none());
    let wanted = ["rates v 0.1 m/s2", "measurement errors x_p 0.02 m, theta 0.01 rad", "gain of a 0.9 to 1"];
    assert_eq!(filter.covered(), wanted);
    // A centre that is measured belongs to its barrier.
    let centre = "radius = 2.0\ncentre_input = true\nacceleration = 0.3\ncentre_error = 0.02";
    let follows = read(&UNCERTAIN.replace("radius = 2.0", centre));
    assert!(follows.is_assured() && follows.ends_plans());
    let wanted = ["acceleration of the centre of goal 0.3 m/s2, errors 0.02 m"];
    assert_eq!(follows.covered_points(), wanted);
    assert!(follows.parameters().iter().any(|row| row.name == "goal.acceleration"));
    // Nothing is nothing, but the FMU has its parameters, and its output of the end.
    let nothing = read(&UNCERTAIN.replace("0.1", "0.0").replace("[0.9, 1.0]", "[1.0, 1.0]"));
    assert!(nothing.covered().is_empty() && nothing.ends_plans());
    let names: Vec<_> = nothing.parameters().into_iter().map(|row| row.name).collect();
    for name in ["uncertainty.rate.v", "uncertainty.gain_min.a", "uncertainty.gain_max.a"] {
        assert!(names.iter().any(|own| own == name), "{name}: {names:?}");
    }
    // A barrier's disturbance, and errors without plans, are the business of the rows.
    let rows = read(&FILTER.replace("bounds =", &format!("{errors}bounds =")));
    assert!(!rows.is_assured() && !rows.ends_plans());
}

/// Inputs and states have their names and units in the message of a failure.
#[test]
fn failures_of_an_uncertain_plant_have_names() {
    let Ok(Configuration::Filter(filter)) = Configuration::parse(UNCERTAIN) else { panic!("a filter") };
    let of = |failure| filter.failure(failure);
    let reserve = of(punctual_core::plan::Failure::NoReserve { input: 1, missing: 0.1 + 0.2 });
    let wanted =
        "the bounds of omega leave too little to hold the uncertain plant near the plan, by 0.3 rad/s";
    assert_eq!(reserve, wanted);
    let beyond = of(punctual_core::plan::Failure::Undeclared { state: 3, beyond: 0.25 });
    assert_eq!(beyond, "v is 0.25 m/s farther from the plan than the declared uncertainty allows");
}

/// Every model.
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

/// Valid configurations of every kind: models × shapes × methods, and some with everything stated.
fn every_kind() -> Vec<String> {
    let mut texts = vec![FILTER.to_owned(), PLANT.to_owned(), HEADING.to_owned(), WAYPOINTS.to_owned()];
    texts.push(STEERED.to_owned());
    texts.push(EXPRESSIONS.to_owned());
    texts.push(POLICY.to_owned());
    texts.push(FILTER.replace("bounds =", "measurement_errors = { y_p = 0.1, v = 0.2 }\nbounds ="));
    texts.push(UNCERTAIN.to_owned());
    texts.push(UNCERTAIN.replace("gain = [0.9, 1.0]", ""));
    texts.push(format!("{FILTER}disturbance = 0.5\n"));
    texts.push(format!("{PLANT}[disturbance]\nseed = 3\ninputs = {{ a = 0.5 }}\nmeasurements.v = 0.1\n"));
    for model in MODELS {
        texts.push(format!("kind = \"controller\"\ncontroller = \"damping\"\nplant.model = \"{model}\""));
        texts.push(format!("kind = \"plant\"\nname = \"p\"\nplant.model = \"{model}\"\nx0.x_p = 1e-300"));
        if ["bicycle_small_slip", "bicycle_kinematic_angle", "bicycle_kinematic_slip"].contains(&model) {
            continue;
        }
        for (shape, keys) in [
            ("ellipse", "half_axes = [3.0, 2.0]"),
            ("rectangular_obstacle", "half_sides = [3.0, 2.0]\nangle = 0.3"),
            ("half_plane", "normal = [3.0, 2.0]"),
        ] {
            texts.push(format!(
                "kind = \"filter\"\nplant.model = \"{model}\"\n[[barrier]]\nname = \"a\"\nshape = \"{shape}\"\n\
                 centre = [1.0, 2.0]\npenalty = 3.0\nbegin = 1.0\nend = 4.0\n{keys}\n"
            ));
        }
        for shape in ["disc", "quadratic_disc", "obstacle"] {
            for method in ["reference_profile", "repeated_root"] {
                texts.push(format!(
                    "kind = \"filter\"\ndirect_feedthrough = false\nplant.model = \"{model}\"\n\
                     [[barrier]]\nname = \"a\"\nshape = \"{shape}\"\nmethod = \"{method}\"\n\
                     centre = [0.1, -3e20]\nvelocity = [-2.0, 0.3]\nradius = 0.3\ndeadline = 7.0\nmargin = 0.05\n\
                     [[barrier]]\nname = \"b\"\nshape = \"{shape}\"\ncentre = [1, 2]\nradius = 1\n\
                     deadline = 3\nrate = 0.7\nstay_rate = 0.9\n"
                ));
            }
        }
    }
    texts
}

#[test]
fn the_canonical_form_is_the_same_configuration() {
    for text in every_kind() {
        let configuration = Configuration::parse(&text).unwrap_or_else(|e| panic!("{e} in {text}"));
        let canonical = configuration.canonical().unwrap();
        let again = Configuration::parse(&canonical).unwrap_or_else(|e| panic!("{e} in {canonical}"));
        assert_eq!(again, configuration, "{canonical}");
        assert_eq!(again.canonical().unwrap(), canonical);
    }
}

#[test]
fn infinite_bounds_become_the_number_that_means_none() {
    let text = FILTER.replace("[-9.0, 8.0]", "[-inf, inf]");
    let Configuration::Filter(c) = Configuration::parse(&text).unwrap() else { panic!("not a filter") };
    assert_eq!(c.bounds["a"], [-UNBOUNDED, UNBOUNDED]);
    assert_eq!(c.bounds["omega"], [-UNBOUNDED, UNBOUNDED], "an input without bounds");
}

#[test]
fn models_and_shapes_are_named_as_in_the_file() {
    for text in every_kind() {
        let canonical = Configuration::parse(&text).and_then(|c| c.canonical()).unwrap();
        match Configuration::parse(&text).unwrap() {
            Configuration::Filter(c) => {
                assert!(canonical.contains(&format!("model = \"{}\"", c.plant.name())), "{canonical}");
                assert!(
                    canonical.contains(&format!("shape = \"{}\"", c.barrier[0].shape.name())),
                    "{canonical}"
                );
            }
            Configuration::Plant(c) => {
                assert!(canonical.contains(&format!("model = \"{}\"", c.plant.name())), "{canonical}");
            }
            Configuration::Controller(c) => {
                assert!(
                    canonical.contains(&format!("controller = \"{}\"", c.controller.name())),
                    "{canonical}"
                );
            }
        }
    }
}

/// The margin of the first barrier of a filter for a tank with the level z, the temperature T and the lid `p` = 4, where its
/// keys are `barrier`.
fn tank_margin(barrier: &str) -> f64 {
    let text = format!(
        "kind = \"filter\"\n[plant]\nstates = [{{ name = \"z\", unit = \"m\", max = 6.0 }}, {{ name = \"T\", unit = \"K\" }}]\n\
         inputs = [{{ name = \"u\", unit = \"m/s\" }}, {{ name = \"q\", unit = \"K/s\" }}]\n\
         parameters = [{{ name = \"p\", start = 4.0, unit = \"m\" }}]\nderivatives = {{ z = \"u\", T = \"q\" }}\n\
         [[barrier]]\nname = \"set\"\n{barrier}\n"
    );
    match Configuration::parse(&text) {
        Ok(Configuration::Filter(c)) => c.barrier[0].margin,
        other => panic!("{text}: {other:?}"),
    }
}

#[test]
fn the_default_margin_of_an_expression_is_a_ten_thousandth_of_its_scale() {
    for (expression, unit, wanted) in [
        ("5 - z", "m", 0.0005),
        ("p - z", "m", 0.0004),
        ("z - 0.01", "m", 1e-6),
        ("0.001 - z^2", "m2", 1e-7),
        // The largest level is 6 m.
        ("z - 5.99", "m", 1e-6),
        // At most a thousandth.
        ("T - 293.15", "K", 0.001),
        ("120 - sqrt(z^2 + 0.01)", "m", 0.001),
        ("z", "m", 0.0),
        ("z * T", "m.K", 0.0),
        ("z + 2 * t", "m", 0.0),
    ] {
        let found = tank_margin(&format!("expression = \"{expression}\"\nunit = \"{unit}\""));
        assert!((found - wanted).abs() <= 1e-12 * wanted, "{expression}: {found}");
    }
    assert_eq!(tank_margin("expression = \"5 - z\"\nmargin = 0.0"), 0.0, "given");
    assert_eq!(tank_margin("expression = \"5 - z\"\nmargin = 0.2"), 0.2, "given");
    assert_eq!(tank_margin("shape = \"at_most\"\nstate = \"z\"\nbound = 5.0"), 0.0, "no expression");
}

#[test]
fn defaults_are_those_of_the_documentation() {
    let Configuration::Filter(c) = Configuration::parse(FILTER).unwrap() else { panic!("not a filter") };
    let barrier = &c.barrier[0];
    assert_eq!((barrier.rate, barrier.stay_rate), (Automatic(0.0), Automatic(0.0)), "by default");
    assert_eq!(barrier.margin, 0.02, "a hundredth of the radius");
    let at = Point::at([45.0, 44.0]);
    let disc = Shape::Disc { at, radius: 2.0, smoothing: Automatic(0.0) };
    assert_eq!(barrier.shape, disc, "at rest, rounded by its radius");
    assert_eq!((c.name.as_str(), c.direct_feedthrough, c.correction_limit), ("filter", true, 1e6));
    let Configuration::Plant(c) =
        Configuration::parse("kind = \"plant\"\nplant.model = \"bicycle\"").unwrap()
    else {
        panic!("not a plant")
    };
    let reference = |c: &PlantConfiguration| *c.plant.reference().expect("a plant by name");
    assert_eq!((c.name.as_str(), c.integration.inner_step), ("bicycle", 0.001));
    assert_eq!((reference(&c).l_r(), reference(&c).l_f()), (Some(10.0), None));
    let kinematic = Configuration::parse("kind = \"plant\"\nplant.model = \"bicycle_kinematic\"").unwrap();
    let Configuration::Plant(kinematic) = kinematic else { panic!("not a plant") };
    assert_eq!((reference(&kinematic).l_f(), reference(&kinematic).l_r()), (Some(10.0), Some(10.0)));
    assert_eq!(c.x0.values().copied().collect::<Vec<_>>(), [0.0; 4]);
}

/// The default of a key as TOML, where the table gives a value.
fn default_value(key: &Key) -> Option<toml::Value> {
    let text = key.default?.trim_matches('`');
    match key.value {
        Value::Number(..) => text.parse().ok().map(toml::Value::Float),
        Value::Count(..) => text.parse().ok().map(toml::Value::Integer),
        Value::Flag => text.parse().ok().map(toml::Value::Boolean),
        Value::Word(words) if words.contains(&text) => Some(text.into()),
        _ => None,
    }
}

/// A key with its stated default changes nothing.
#[test]
fn defaults_of_the_tables_are_those_of_the_files() {
    let heading = HEADING.replace("unicycle", "bicycle_small_slip");
    let steered = "kind = \"filter\"\nplant.model = \"bicycle_kinematic\"\nintegrator.state = \"delta\"\n\
                   [[barrier]]\nname = \"goal\"\ncentre = [1.0, 2.0]\nradius = 1.0\n";
    let ellipse =
        format!("{}shape = \"ellipse\"\n", steered.replace("radius = 1.0", "half_axes = [1.0, 1.0]"));
    let plant = "kind = \"plant\"\nplant.model = \"bicycle_kinematic\"\nintegration = {}\ndisturbance = {}\nexperiment = {}\n";
    let controller = "kind = \"controller\"\ncontroller = \"damping\"\nplant.model = \"bicycle_kinematic\"\n";
    let mut compared = BTreeSet::new();
    for (text, place) in [
        (steered, "filter"),
        (steered, "barrier"),
        (&ellipse, "barrier"),
        (steered, "integrator"),
        (plant, "plant"),
        (plant, "integration"),
        (plant, "disturbance"),
        (plant, "experiment"),
        (plant, "model"),
        (controller, "controller"),
        (&heading, "controller"),
        (WAYPOINTS, "controller"),
    ] {
        let short = Configuration::parse(text).unwrap_or_else(|e| panic!("{e} in {text}"));
        let section = SECTIONS.iter().find(|section| section.name == place).unwrap();
        for key in (section.keys)() {
            let Some(value) = default_value(key) else { continue };
            let mut file: toml::Table = text.parse().unwrap();
            let table = match place {
                "filter" | "plant" | "controller" => &mut file,
                "barrier" => file["barrier"][0].as_table_mut().unwrap(),
                "model" => file["plant"].as_table_mut().unwrap(),
                place => file[place].as_table_mut().unwrap(),
            };
            table.insert(key.name.to_owned(), value);
            match Configuration::parse(&file.to_string()) {
                Ok(long) => assert_eq!(long, short, "{place}: {}", key.name),
                Err(e) => assert!(e.to_string().ends_with("has none"), "{place}: {}: {e}", key.name),
            }
            compared.insert((place, key.name));
        }
    }
    let valued = |section: &&'static Section| {
        let keys = (section.keys)().into_iter().filter(|key| default_value(key).is_some());
        keys.map(|key| (section.name, key.name)).collect::<Vec<_>>()
    };
    assert_eq!(compared, SECTIONS.iter().flat_map(valued).collect());
}

/// A value of every key that only some shapes have.
const SHAPE_VALUES: [(&str, &str); 20] = [
    ("centre", "[1.0, 2.0]"),
    ("radius", "1.0"),
    ("half_axes", "[2.0, 1.0]"),
    ("half_sides", "[2.0, 1.0]"),
    ("normal", "[1.0, 0.0]"),
    ("state", "\"v\""),
    ("bound", "1.0"),
    ("expression", "\"x_p\""),
    ("relative_degree", "1"),
    ("smoothing", "0.5"),
    ("velocity", "[1.0, 0.0]"),
    ("centre_input", "true"),
    ("acceleration", "0.3"),
    ("centre_error", "0.1"),
    ("velocity_error", "0.1"),
    ("angle", "0.5"),
    ("unit", "\"m\""),
    ("position", "[\"x\", \"y\", \"z\"]"),
    ("from", "[\"p\", \"q\", \"r\"]"),
    ("distance", "1.0"),
];

/// Whether a shape is for models without a name.
fn is_for_own(row: &ShapeRow) -> bool {
    ["sphere", "spherical_obstacle", "box", "box_obstacle", "apart"].contains(&row.name)
}

/// The line that gives `key` to a shape.
fn line_of(row: &ShapeRow, key: &str) -> String {
    let value = SHAPE_VALUES.iter().find(|v| v.0 == key).unwrap_or_else(|| panic!("no value of {key}")).1;
    let in_space = is_for_own(row) && ["centre", "half_sides"].contains(&key);
    format!("{key} = {}\n", if in_space { "[2.0, 1.0, 0.5]" } else { value })
}

/// A file up to the keys of a shape, with a plant that it is for.
fn head_of(row: &ShapeRow) -> String {
    let named =
        |names: &str| names.split(' ').map(|name| format!("{{ name = \"{name}\" }}, ")).collect::<String>();
    let plant = match is_for_own(row) {
        false => "plant.model = \"unicycle\"".to_owned(),
        true => format!(
            "plant.states = [{}]\nplant.inputs = [{}]\n\
             plant.derivatives = {{ x = \"u\", y = \"v\", z = \"w\", p = \"0\", q = \"0\", r = \"0\" }}",
            named("x y z p q r"),
            named("u v w")
        ),
    };
    let name = row.name;
    format!(
        "kind = \"filter\"\n{plant}\nsampling = \"pointwise\"\n[[barrier]]\nname = \"b\"\nshape = \"{name}\"\n"
    )
}

/// A file with each shape, named b, with the keys that it needs.
fn every_shape() -> Vec<(String, &'static ShapeRow)> {
    // A plug-in has to exist.
    let rows = SHAPES.iter().filter(|row| row.name != "plugin");
    rows.map(|row| {
        let keys: String = row.required.iter().map(|key| line_of(row, key)).collect();
        (head_of(row) + &keys, row)
    })
    .collect()
}

/// The keys that a shape needs by its row in the table are enough, and none is too many.
#[test]
fn shapes_need_what_their_row_says() {
    // A plug-in has to exist, which tests/cli sees to.
    for row in SHAPES.iter().filter(|row| row.name != "plugin") {
        let (head, line) = (head_of(row), |key: &&str| line_of(row, key));
        let needed: String = row.required.iter().map(line).collect();
        // The position of a vehicle with a name is its own.
        let optional = row.optional.iter().filter(|key| is_for_own(row) || **key != "position");
        for text in [needed.clone(), needed.clone() + &optional.map(line).collect::<String>()] {
            let Configuration::Filter(c) = Configuration::parse(&(head.clone() + &text))
                .unwrap_or_else(|e| panic!("{e} in {head}{text}"))
            else {
                panic!("not a filter")
            };
            assert_eq!(c.barrier[0].shape.name(), row.name);
        }
        for key in row.required {
            let error = Configuration::parse(&(head.clone() + &needed.replace(&line(key), ""))).unwrap_err();
            assert_eq!(error.to_string(), format!("barrier[0].{key}: missing, {} needs it", row.name));
        }
        // A key of another shape is no key of this one.
        let known = |key: &str| row.required.contains(&key) || row.optional.contains(&key);
        for (key, _) in SHAPE_VALUES.iter().filter(|(key, _)| !known(key)) {
            let text = format!("{head}{needed}{}", line(key));
            let error = Configuration::parse(&text).map(|_| text.clone()).unwrap_err();
            assert_eq!(error.field(), format!("barrier[0].{key}"), "{error}");
        }
    }
}

/// Every number that a shape needs is a parameter, but for the relative degree, which decides on the code that runs.
#[test]
fn the_numbers_of_shapes_are_parameters() {
    for (kind, row) in every_shape() {
        let Configuration::Filter(c) = Configuration::parse(&kind).unwrap() else { panic!("not a filter") };
        let names: BTreeSet<_> = c.parameters().into_iter().map(|row| row.name).collect();
        let numbers = row
            .required
            .iter()
            .filter(|key| !["state", "expression", "relative_degree", "from"].contains(key));
        for key in numbers {
            let (one, first) = (format!("b.{key}"), format!("b.{key}[1]"));
            assert!(names.contains(&one) || names.contains(&first), "{} of {}: {names:?}", key, row.name);
        }
    }
}

/// The words that the tables list are those that the parser takes.
#[test]
fn the_words_of_the_tables_are_those_of_the_parser() {
    let words =
        |text: &str| -> BTreeSet<String> { text.split('"').skip(1).step_by(2).map(str::to_owned).collect() };
    let mut compared = 0;
    let section = SECTIONS.iter().find(|section| section.name == "barrier").expect("its section");
    for key in (section.keys)() {
        let Value::Word(listed) = key.value else { continue };
        let text = FILTER.replace("radius = 2.0", &format!("radius = 2.0\n{} = \"none of them\"", key.name));
        let error = Configuration::parse(&text).unwrap_err().to_string();
        let (_, expected) = error.split_once("must be ").unwrap_or_else(|| panic!("{}: {error}", key.name));
        assert_eq!(
            words(expected),
            listed.iter().map(|w| (*w).to_owned()).collect(),
            "{}: {error}",
            key.name
        );
        compared += 1;
    }
    assert!(compared >= 4, "{compared} keys have words");
}

#[test]
fn parameter_rows_have_own_names_and_reach_their_own_number() {
    for text in every_kind() {
        fn walk<C: Clone>(configuration: &C, rows: &[Parameter<C>]) {
            let names: BTreeSet<_> = rows.iter().map(|r| r.name.as_str()).collect();
            assert_eq!(names.len(), rows.len(), "{names:?}");
            let mut values: Vec<_> = rows.iter().map(|r| r.get(&mut configuration.clone())).collect();
            for (i, row) in rows.iter().enumerate() {
                values[i] += 0.125 + i as f64;
                let mut changed = updated(configuration, rows, &values).unwrap();
                assert_eq!(row.get(&mut changed), values[i], "{}", row.name);
                let error = {
                    let mut bad = values.clone();
                    bad[i] = f64::NAN;
                    updated(configuration, rows, &bad).err().unwrap().to_string()
                };
                assert_eq!(error, format!("{}: is NaN, must be {}", row.name, row.range.describe()));
            }
        }
        match Configuration::parse(&text).unwrap() {
            Configuration::Filter(c) => walk(&c, &c.parameters()),
            Configuration::Plant(c) => walk(&c, &c.parameters()),
            Configuration::Controller(c) => walk(&c, &c.parameters()),
        }
    }
}

#[test]
fn names_are_c_identifiers() {
    let long = "a".repeat(64);
    for good in ["a", "_", "A9_b", &long] {
        assert_eq!(check_identifier("name", good), Ok(()), "{good}");
    }
    for bad in ["", "9a", "a-b", "a b", "\u{e4}", "a.b", "a/b", &format!("{long}a")] {
        assert!(check_identifier("name", bad).is_err(), "{bad}");
    }
}
