//! Nominal controllers: a sensible u_ref, without any guarantee.
//!
//! A filter changes u_ref as little as its rows require, so the nominal controller determines the character
//! of a closed loop. With u_ref = 0, a point mass keeps its angular momentum about the goal. [`damping`] is
//! the minimum that every loop needs; [`Heading`] drives to a goal.

use punctual_core::elementary;
use punctual_core::error::{Error, finite, positive};
use punctual_core::scalar::Scalar;

/// Damping: −gain · v for a velocity or speed v (m/s), in m/s². `gain` is in 1/s, 1 in the figures of the
/// documentation. It applies to each component on the point mass, and to the acceleration on unicycle and
/// bicycle.
pub fn damping<S: Scalar>(v: S, gain: f64) -> S {
    v * -gain
}

/// Drives a vehicle to a goal in the plane. It turns towards the goal or, if that is the smaller turn, away
/// from it, and then reverses. Its speed is proportional to the distance, up to a limit.
///
/// With d the vector to the goal, φ the smaller angle from the heading to ±d and σ the sign chosen,
///
/// ```math
/// \begin{aligned}
/// v^* &= \min(\mathtt{speed\_gain}\,|d|,\ \mathtt{speed\_limit}), \\
/// \omega &= \operatorname{clamp}(\mathtt{turn\_gain}\,\varphi,\ \pm\mathtt{turn\_limit}), \\
/// a &= \operatorname{clamp}(\mathtt{acceleration\_gain}\,(\sigma v^* \cos\varphi - v),\ \pm\mathtt{acceleration\_limit}).
/// \end{aligned}
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heading {
    /// The goal in m.
    pub goal: [f64; 2],
    /// Speed per distance in 1/s, finite, > 0. Default 0.8.
    pub speed_gain: f64,
    /// Largest target speed in m/s, finite, > 0. Default 15.
    pub speed_limit: f64,
    /// Acceleration per speed error in 1/s, finite, > 0. Default 1.
    pub acceleration_gain: f64,
    /// Largest acceleration in m/s², finite, > 0. Default 10.
    pub acceleration_limit: f64,
    /// Turning rate per angle in 1/s, finite, > 0. Default 3.
    pub turn_gain: f64,
    /// Largest turning rate in rad/s, finite, > 0. Default 3.
    pub turn_limit: f64,
    /// Largest slip angle of the bicycle in rad, finite, > 0. Default 1.
    pub slip_limit: f64,
}

impl Heading {
    /// Distance to the goal in m within which the heading is no longer controlled.
    const NEAR: f64 = 0.5;

    /// The controller with default gains and limits, towards `goal` (m).
    pub fn towards(goal: [f64; 2]) -> Self {
        Self {
            goal,
            speed_gain: 0.8,
            speed_limit: 15.0,
            acceleration_gain: 1.0,
            acceleration_limit: 10.0,
            turn_gain: 3.0,
            turn_limit: 3.0,
            slip_limit: 1.0,
        }
    }

    /// The same controller, with its numbers checked.
    ///
    /// # Errors
    ///
    /// A number outside the range its field states.
    pub fn validated(self) -> Result<Self, Error> {
        finite("goal[1]", self.goal[0])?;
        finite("goal[2]", self.goal[1])?;
        positive("speed_gain", self.speed_gain)?;
        positive("speed_limit", self.speed_limit)?;
        positive("acceleration_gain", self.acceleration_gain)?;
        positive("acceleration_limit", self.acceleration_limit)?;
        positive("turn_gain", self.turn_gain)?;
        positive("turn_limit", self.turn_limit)?;
        positive("slip_limit", self.slip_limit)?;
        Ok(self)
    }

    /// The same controller towards a point from which the path to the goal is less obstructed. If the
    /// straight line from `position` passes within `clearance` (m) of one of the discs (centre and radius in
    /// m), that point leads past the first of them, on the side where the path is shorter. Within the
    /// clearance of that disc, the path follows its edge. If no disc is in the way, the point is the goal
    /// itself.
    ///
    /// This is no planner: it considers one disc after the other, and can alternate between overlapping
    /// discs.
    pub fn around(self, position: [f64; 2], discs: &[([f64; 2], f64)], clearance: f64) -> Self {
        let mut goal = self.goal;
        // The path around one disc can lead to another; each is passed at most once.
        for _ in discs {
            match first_on_the_line(position, goal, discs, clearance) {
                Some((to, wide)) => goal = past(position, goal, to, wide),
                None => break,
            }
        }
        Self { goal, ..self }
    }

    /// Acceleration (m/s²) of the point mass, x = (x_p, y_p, v_x, v_y).
    pub fn point_mass<S: Scalar>(&self, x: &[S; 4]) -> [S; 2] {
        let (d, distance) = self.offset(x);
        let far = distance.value();
        let per_distance = if self.speed_gain * far >= self.speed_limit {
            S::from(self.speed_limit) / distance
        } else if far > 0.0 {
            // The gain computed from speed and distance, with their round-off.
            S::from(self.speed_gain * far / far)
        } else {
            S::from(self.speed_gain)
        };
        let wanted = [0, 1].map(|i| (d[i] * per_distance - x[i + 2]) * self.acceleration_gain);
        let size = wanted[0].hypot(wanted[1]);
        if size.value() <= self.acceleration_limit {
            return wanted;
        }
        wanted.map(|a| a * (S::from(self.acceleration_limit) / size))
    }

    /// Acceleration (m/s²) and turning rate (rad/s) of the unicycle, x = (x_p, y_p, θ, v).
    pub fn unicycle<S: Scalar>(&self, x: &[S; 4]) -> [S; 2] {
        let (d, distance) = self.offset(x);
        let ((sin, cos), v) = (x[2].sin_cos(), x[3]);
        // The components of d along the heading and across it, to the left.
        let (along, across) = (d[0] * cos + d[1] * sin, d[1] * cos - d[0] * sin);
        let sign = if along.value() < 0.0 { -1.0 } else { 1.0 };
        let ahead = if along.value().is_sign_negative() { -along } else { along };
        let near = distance.value() < Self::NEAR;
        let angle = if near { S::zero() } else { (across * sign).atan2(ahead) };
        let speed = self.speed(distance) * sign * angle.cos();
        let acceleration = (speed - v) * self.acceleration_gain;
        [within(self.acceleration_limit, acceleration), within(self.turn_limit, angle * self.turn_gain)]
    }

    /// Acceleration (m/s²) and slip angle (rad) of the bicycle with θ̇ = vβ/l_r, x = (x_p, y_p, θ, v). `l_r` is positive, in
    /// m. At rest it cannot turn. The slip angle is then at its limit, on the side that turns the right way once it moves.
    pub fn bicycle<S: Scalar>(&self, x: &[S; 4], l_r: f64) -> [S; 2] {
        let [acceleration, turning] = self.unicycle(x);
        let at_rest = x[3].value() == 0.0;
        let v = if at_rest { S::from(f64::MIN_POSITIVE.copysign(acceleration.value())) } else { x[3] };
        if at_rest && turning.value() == 0.0 {
            return [acceleration, S::zero()];
        }
        // Adding 0.0 turns −0 into 0.
        [acceleration, within(self.slip_limit, turning * l_r / v + 0.0)]
    }

    fn offset<S: Scalar>(&self, x: &[S; 4]) -> ([S; 2], S) {
        let d = [0, 1].map(|i| S::from(self.goal[i]) - x[i]);
        (d, d[0].hypot(d[1]))
    }

    fn speed<S: Scalar>(&self, distance: S) -> S {
        within(self.speed_limit, distance * self.speed_gain)
    }
}

/// The first of the discs within `clearance` of the straight line from `position` to `goal`: the vector to
/// its centre, and its radius with the clearance.
fn first_on_the_line(
    position: [f64; 2],
    goal: [f64; 2],
    discs: &[([f64; 2], f64)],
    clearance: f64,
) -> Option<([f64; 2], f64)> {
    let line = [goal[0] - position[0], goal[1] - position[1]];
    let length = elementary::hypot(line[0], line[1]);
    let (mut first, mut found) = (f64::INFINITY, None);
    for &(centre, radius) in discs {
        let to = [centre[0] - position[0], centre[1] - position[1]];
        // Position of the centre along the line, and across it: > 0 to the left.
        let ahead = (line[0] * to[0] + line[1] * to[1]) / length;
        let across = (line[0] * to[1] - line[1] * to[0]) / length;
        let wide = radius + clearance;
        if ahead > 0.0 && ahead - wide < length && across.abs() < wide && ahead < first {
            (first, found) = (ahead, Some((to, wide)));
        }
    }
    found
}

/// A point past a disc whose centre is at `to` from `position`, on the side where the path to `goal` is
/// shorter. From outside, it is the point where a tangent from `position` touches the slightly enlarged disc
/// of radius `wide`. From inside, it is one radius further along the edge and slightly outwards.
fn past(position: [f64; 2], goal: [f64; 2], to: [f64; 2], wide: f64) -> [f64; 2] {
    /// Factor on the radius, so that a vehicle passing the disc is not blocked by it.
    const ENLARGED: f64 = 1.1;
    /// Sine of the outward angle from the edge for a path from inside the disc.
    const OUTWARDS: f64 = 0.3;
    let line = [goal[0] - position[0], goal[1] - position[1]];
    // A disc on the left is passed on the right.
    let side = if line[0] * to[1] - line[1] * to[0] > 0.0 { -1.0 } else { 1.0 };
    let (distance, out) = (elementary::hypot(to[0], to[1]), ENLARGED * wide);
    // The point in coordinates along the line to the centre and to the left of it.
    let [along, across] = if distance > out {
        let [sin, cos] = [out / distance, (1.0 - elementary::powi(out / distance, 2)).sqrt()];
        [distance * cos * cos, distance * cos * sin * side]
    } else {
        [-out * OUTWARDS, out * side]
    };
    let unit = if distance > 0.0 { to.map(|v| v / distance) } else { [1.0, 0.0] };
    [position[0] + along * unit[0] - across * unit[1], position[1] + along * unit[1] + across * unit[0]]
}

/// `value` clamped to ±`limit`.
fn within<S: Scalar>(limit: f64, value: S) -> S {
    match value.value() {
        v if v > limit => S::from(limit),
        v if v < -limit => S::from(-limit),
        _ => value,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_the_short_way_and_reverses() {
        let heading = Heading::towards([10.0, 0.0]).validated().expect("valid");
        // Facing the goal, facing away from it, and with the goal to the left and right.
        assert_eq!(heading.unicycle(&[0.0, 0.0, 0.0, 0.0]), [8.0, 0.0]);
        let [a, turn] = heading.unicycle(&[0.0, 0.0, std::f64::consts::PI, 0.0]);
        assert!(a < -7.9 && turn.abs() < 1e-12);
        assert!(heading.unicycle(&[0.0, 0.0, -0.5, 0.0])[1] > 0.0);
        assert!(heading.unicycle(&[0.0, 0.0, 0.5, 0.0])[1] < 0.0);
        // Reversing, the slip angle that turns left is negative.
        let x = [0.0, 0.0, 3.0, -4.0];
        let turn = heading.unicycle(&x)[1];
        let slip = heading.bicycle(&x, 10.0)[1];
        assert!(turn != 0.0 && slip.signum() == -turn.signum());
        assert_eq!(heading.point_mass(&[9.0, 0.0, 0.0, 0.0]), [0.8, 0.0]);
    }

    #[test]
    fn stays_within_its_limits() {
        let heading = Heading::towards([1e6, -1e6]);
        for x in [[0.0; 4], [5.0, 1.0, 2.0, -300.0], [1e6, -1e6, 1.0, 0.0]] {
            let [a, turn] = heading.unicycle(&x);
            assert!(a.abs() <= 10.0 && turn.abs() <= 3.0);
            let [a, slip] = heading.bicycle(&x, 2.0);
            assert!(a.abs() <= 10.0 && slip.abs() <= 1.0);
            let [a, b] = heading.point_mass(&x);
            assert!(a.hypot(b) <= 10.0 + 1e-9);
        }
    }

    /// In every quadrant, inside and beyond the limits, and for the point mass at the goal itself.
    #[test]
    fn derivatives_are_those_of_the_laws() {
        use punctual_core::jet::Tangent;
        let heading = Heading::towards([4.0, -3.0]);
        let direction = [0.3, -0.7, 0.4, 0.9];
        let states = [
            [1.0, 2.0, 0.3, 3.0],
            [9.0, 2.0, -2.5, 1.0],
            [3.0, -9.0, 1.0, -2.0],
            [40.0, -70.0, 2.0, 5.0],
            [4.2, -3.1, 0.5, 0.7],
            [4.0, -3.0, 0.1, 0.2],
        ];
        for (i, x) in states.into_iter().enumerate() {
            let laws = |x: &[f64; 4]| [heading.point_mass(x), heading.unicycle(x), heading.bicycle(x, 2.0)];
            let moved = |by: f64| std::array::from_fn(|k| x[k] + by * direction[k]);
            let x: [_; 4] = std::array::from_fn(|k| Tangent { value: x[k], directional: direction[k] });
            let found = [heading.point_mass(&x), heading.unicycle(&x), heading.bicycle(&x, 2.0)];
            let step = 1e-6;
            let (plus, minus) = (laws(&moved(step)), laws(&moved(-step)));
            // The speed of a vehicle with a heading has a kink at the goal.
            let compared = if i == 5 { 1 } else { 3 };
            for law in 0..compared {
                for k in 0..2 {
                    let wanted = (plus[law][k] - minus[law][k]) / (2.0 * step);
                    // Round-off of numbers of order 10, relative to the step.
                    let error = (found[law][k].directional - wanted).abs();
                    assert!(error < 1e-6 * (1.0 + wanted.abs()), "state {i}, law {law}: {found:?} {wanted}");
                }
            }
        }
    }

    /// From starts all around a disc, some within its clearance, the line to the point does not cross it.
    #[test]
    fn the_way_around_a_disc_is_free() {
        let (disc, clearance) = (([10.0, 1.0], 2.0), 1.0);
        let heading = Heading::towards([20.0, 0.0]);
        assert_eq!(heading.around([0.0, 9.0], &[([10.0, -9.0], 2.0)], clearance), heading);
        for k in 0..200 {
            let (angle, distance) = (f64::from(k) * 0.31, 2.05 + 0.04 * f64::from(k));
            let from = [disc.0[0] + distance * angle.cos(), disc.0[1] + distance * angle.sin()];
            let goal = heading.around(from, &[disc], clearance).goal;
            // The point of the line that is closest to the centre.
            let line = [goal[0] - from[0], goal[1] - from[1]];
            let to = [disc.0[0] - from[0], disc.0[1] - from[1]];
            let part = (line[0] * to[0] + line[1] * to[1]) / (line[0] * line[0] + line[1] * line[1]);
            let part = part.clamp(0.0, 1.0);
            let near = (to[0] - part * line[0]).hypot(to[1] - part * line[1]);
            let free = f64::min(distance, disc.1 + clearance);
            assert!(near >= free - 1e-9, "{near} from {from:?} to {goal:?}");
        }
    }

    #[test]
    fn numbers_are_checked() {
        let refused =
            Heading { turn_limit: -1.0, ..Heading::towards([0.0; 2]) }.validated().expect_err("range");
        assert_eq!(refused.to_string(), "turn_limit: is -1, must be finite and > 0");
    }
}
