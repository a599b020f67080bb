//! An arm with two links: ../models/arm-filter.toml as a plug-in, with the mass matrix written as it is and solved.
//!
//!     rustc --edition 2024 -O --crate-type cdylib -o libarm.so arm.rs

#[path = "../../fmu/src/abi/plugin/punctual_model.rs"]
mod punctual_model;

use punctual_model::{Model, Number, Output, Variable};

struct Arm;

impl Model for Arm {
    const STATES: &'static [Variable] = &[
        Variable::new(c"q_1", c"rad", c"angle of the shoulder").within(-3.2, 3.2),
        Variable::new(c"q_2", c"rad", c"angle of the elbow").within(-3.2, 3.2),
        Variable::new(c"w_1", c"rad/s", c"its rate"),
        Variable::new(c"w_2", c"rad/s", c"its rate"),
    ];
    const INPUTS: &'static [Variable] = &[
        Variable::new(c"tau_1", c"N.m", c"torque of the shoulder").within(-40.0, 40.0),
        Variable::new(c"tau_2", c"N.m", c"torque of the elbow").within(-25.0, 25.0),
    ];
    const PARAMETERS: &'static [Variable] = &[
        Variable::new(c"p_1", c"kg.m2", c"inertia of the first link, with the second as a point").start(3.2),
        Variable::new(c"p_2", c"kg.m2", c"inertia of the second link").start(0.9),
        Variable::new(c"p_3", c"kg.m2", c"coupling of the two; p_3^2 < p_1 p_2").start(1.1),
        Variable::new(c"q_1_max", c"rad", c"limit of the shoulder").start(1.5),
        Variable::new(c"q_2_max", c"rad", c"limit of the elbow").start(2.0),
    ];
    const BARRIERS: &'static [Variable] = &[
        Variable::new(c"shoulder", c"rad", c"shoulder within its limit"),
        Variable::new(c"elbow", c"rad", c"elbow within its limit"),
    ];

    fn plant<'c>(p: &[f64], x: &[Number<'c>], f: &mut Output<'_>, g: &mut Output<'_>) {
        let [q, w_1, w_2] = [x[1], x[2], x[3]];
        let (sin, cos) = (q.sin(), q.cos());
        // M(q) w' = tau - c(q, w).
        let coupled = p[2] * cos;
        let mass = [[p[0] + p[1] + 2.0 * coupled, p[1] + coupled], [p[1] + coupled, q.constant(p[1])]];
        let forces = [-(p[2] * sin * (2.0 * w_1 * w_2 + w_2 * w_2)), p[2] * sin * w_1 * w_1];
        let determinant = mass[0][0] * mass[1][1] - mass[0][1] * mass[1][0];
        let inverse = [
            [mass[1][1] / determinant, -mass[0][1] / determinant],
            [-mass[1][0] / determinant, mass[0][0] / determinant],
        ];
        for i in 0..2 {
            f.set(i, x[2 + i]);
            f.set(2 + i, -(inverse[i][0] * forces[0] + inverse[i][1] * forces[1]));
            for j in 0..2 {
                g.set_at(2 + i, j, inverse[i][j]);
            }
        }
    }

    fn barrier<'c>(index: usize, p: &[f64], _t: Number<'c>, x: &[Number<'c>]) -> Number<'c> {
        p[3 + index] - x[index]
    }
}

export!(Arm);
