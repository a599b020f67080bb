//! The moving parts of the page: vehicles, the outlines of barriers, and the status of filters over time.

use punctual_core::filter::Status;
use punctual_cosim::recording::Recording;
use punctual_fmu::configuration::{BarrierSection, Point, Shape};
use serde::Serialize;

use crate::drawing::{Part, Position};
use crate::outlines;
use crate::plot::{self, POINTS};

/// A vehicle that moves in a plane.
#[derive(Serialize)]
pub(super) struct Vehicle {
    pub(super) label: String,
    /// The names of x and y in the recording.
    #[serde(skip)]
    pub(super) place: [String; 2],
    time: Vec<f64>,
    x: Vec<f64>,
    y: Vec<f64>,
    /// Its height; empty if it moves in the plane alone.
    pub(super) z: Vec<f64>,
    /// Its heading in rad; empty if it has none.
    heading: Vec<f64>,
}

impl Vehicle {
    /// All vehicles of `part` whose signals are recorded.
    pub(super) fn all(part: &Part<'_>, recording: &Recording) -> Vec<Self> {
        let vehicle = |Position { label, place, height, heading }: Position| {
            let (x, y) = (recording.series(&place[0])?, recording.series(&place[1])?);
            let heading = recording.series(&heading).unwrap_or_default();
            let z = height.and_then(|height| recording.series(&height)).unwrap_or_default();
            let mut channels = vec![&x[..], &y];
            channels.extend([&heading[..], &z].into_iter().filter(|channel| !channel.is_empty()));
            let kept = plot::decimate(&channels, POINTS);
            let [time, x, y, z, heading] =
                [recording.times(), &x, &y, &z, &heading].map(|all| chosen(all, &kept));
            Some(Self { label, place, time, x, y, z, heading })
        };
        part.places().into_iter().filter_map(vehicle).collect()
    }

    /// The least and the greatest x and y.
    pub(super) fn extent(&self) -> [Option<(f64, f64)>; 2] {
        [&self.x, &self.y].map(|values| plot::extent(values.iter().copied()))
    }

    /// Its position at `time`, or at the next point in time.
    pub(super) fn at(&self, time: f64) -> Option<[f64; 2]> {
        let i = self.time.iter().position(|t| *t >= time)?;
        Some([self.x[i], self.y[i]])
    }
}

/// The values at the indices `kept` that exist.
fn chosen(all: &[f64], kept: &[usize]) -> Vec<f64> {
    kept.iter().filter_map(|&k| all.get(k)).map(|&value| plot::seven_digits(value)).collect()
}

/// The boundary of a barrier in the plane.
#[derive(Serialize)]
pub(super) struct Outline {
    pub(super) label: String,
    /// Whether its outside is the safe set.
    obstacle: bool,
    /// Its closed lines, relative to its centre.
    rings: Vec<Vec<[f64; 2]>>,
    /// Times, and x and y of its centre at these times; only one of each if it does not move.
    centre: [Vec<f64>; 3],
    /// Whether it is unbounded, such as a half-plane.
    pub(super) endless: bool,
}

impl Outline {
    /// The outlines of the shapes of `part`. `size` is the size of everything else in the plane.
    pub(super) fn all(part: &Part<'_>, recording: &Recording, size: f64) -> Vec<Self> {
        let Some(filter) = part.filter() else { return Vec::new() };
        let outline = |section: &BarrierSection| {
            let number = |field: &str| part.number(&format!("{}.{field}", section.name));
            let shape = outlines::Outline::of_shape(section, number, size)?;
            Some(Self::at(shape, centre(part, section, recording)?))
        };
        filter.barrier.iter().filter_map(outline).collect()
    }

    /// The outline of an expression, which does not move.
    pub(super) fn still(outline: outlines::Outline) -> Self {
        Self::at(outline, [vec![0.0], vec![0.0], vec![0.0]])
    }

    fn at(outline: outlines::Outline, centre: [Vec<f64>; 3]) -> Self {
        let outlines::Outline { label, mut rings, obstacle, endless } = outline;
        rings.iter_mut().flatten().for_each(|corner| *corner = corner.map(plot::seven_digits));
        Self { label, obstacle, rings, centre, endless }
    }

    /// The least and the greatest x and y at all times; for an unbounded one, those of the point on its line.
    pub(super) fn extent(&self) -> [Option<(f64, f64)>; 2] {
        [0, 1].map(|axis| {
            let (low, high) = plot::extent(self.centre[axis + 1].iter().copied())?;
            let reach = plot::extent(self.rings.iter().flatten().map(|corner| corner[axis]));
            let reach = reach.filter(|_| !self.endless).unwrap_or_default();
            Some((low + reach.0, high + reach.1))
        })
    }
}

/// A set in space.
#[derive(Serialize)]
pub(super) struct Solid {
    label: String,
    /// Whether its outside is the safe set.
    obstacle: bool,
    /// How many of the axes it is round about as one: 3 of a sphere, 2 of a cylinder without ends, 0 of a box.
    round: usize,
    centre: [f64; 3],
    /// From the centre to its sides.
    size: [f64; 3],
    /// From the x axis, in rad.
    angle: f64,
}

impl Solid {
    /// The sets of `part` that are in space and stay where they are.
    pub(super) fn all(part: &Part<'_>) -> Vec<Self> {
        let Some(filter) = part.filter() else { return Vec::new() };
        let still = |at: &Point| at.velocity == [0.0; 2] && !at.centre_input;
        let solid = |section: &BarrierSection| {
            let (round, obstacle, centre, size, angle) = match section.shape {
                Shape::Sphere { centre, radius, .. } => (3, false, centre, [radius; 3], 0.0),
                Shape::SphericalObstacle { centre, radius, .. } => (3, true, centre, [radius; 3], 0.0),
                Shape::Box { centre, half_sides, angle } => (0, false, centre, half_sides, angle),
                Shape::BoxObstacle { centre, half_sides, angle } => (0, true, centre, half_sides, angle),
                Shape::Disc { at, radius, .. } | Shape::QuadraticDisc { at, radius } if still(&at) => {
                    (2, false, [at.centre[0], at.centre[1], 0.0], [radius; 3], 0.0)
                }
                Shape::Obstacle { at, radius, .. } if still(&at) => {
                    (2, true, [at.centre[0], at.centre[1], 0.0], [radius; 3], 0.0)
                }
                _ => return None,
            };
            Some(Self { label: section.name.clone(), obstacle, round, centre, size, angle })
        };
        filter.barrier.iter().filter_map(solid).collect()
    }
}

/// The trajectory of a barrier's centre during the run: as recorded if it is an input, else its own motion.
/// `None` if it is an input that was not recorded.
fn centre(part: &Part<'_>, section: &BarrierSection, recording: &Recording) -> Option<[Vec<f64>; 3]> {
    let name = |field: &str, axis: usize| format!("{}.{field}[{axis}]", section.name);
    let seen = [1, 2].map(|axis| recording.series(&part.signal(&name("centre", axis))));
    if let [Some(x), Some(y)] = seen {
        let kept = plot::decimate(&[&x, &y], POINTS);
        return Some([recording.times(), &x, &y].map(|all| chosen(all, &kept)));
    }
    let [x, y] = [part.number(&name("centre", 1))?, part.number(&name("centre", 2))?];
    let velocity = [1, 2].map(|axis| part.number(&name("velocity", axis)).unwrap_or(0.0));
    let followed = matches!(&section.shape, Shape::Disc { at, .. } | Shape::QuadraticDisc { at, .. } | Shape::Obstacle { at, .. } if at.centre_input);
    let (first, last) = (*recording.times().first()?, *recording.times().last()?);
    Some(match velocity {
        _ if followed => return None,
        [0.0, 0.0] => [vec![first], vec![x], vec![y]],
        [along, across] => [
            vec![first, last],
            [first, last].map(|t| x + along * t).into(),
            [first, last].map(|t| y + across * t).into(),
        ],
    })
}

/// A part of the tube of a first plan, as filled outlines in the units of a chart's axes.
#[derive(Serialize)]
pub(super) struct Area {
    rings: Vec<Vec<[f64; 2]>>,
    /// Its colour as an index into the palette.
    colour: usize,
}

impl Area {
    pub(super) fn new(mut rings: Vec<Vec<[f64; 2]>>, colour: usize) -> Self {
        rings.iter_mut().flatten().for_each(|corner| *corner = corner.map(plot::seven_digits));
        Self { rings, colour }
    }

    /// The least and the greatest y.
    pub(super) fn extent(&self) -> Option<(f64, f64)> {
        plot::extent(self.rings.iter().flatten().map(|corner| corner[1]))
    }
}

/// The status of a filter over time.
#[derive(Serialize)]
pub(super) struct Strip {
    label: String,
    /// The time from which each status lasts, and its index into `words`.
    parts: Vec<(f64, usize)>,
    /// The statuses that occur, and their colours as indices into the palette.
    words: Vec<(String, usize)>,
}

impl Strip {
    /// The strip of `part` with this `label`, if its status was recorded.
    pub(super) fn new(part: &Part<'_>, label: &str, recording: &Recording) -> Option<Self> {
        let description = part.model.description();
        let items = &description.variables[description.index_of("status")?].items;
        let seen = recording.series(&part.signal("status"))?;
        let mut strip = Self { label: label.to_owned(), parts: Vec::new(), words: Vec::new() };
        for (time, status) in changes(recording.times(), &seen) {
            let item = items.iter().find(|(_, value)| *value == i64::from(status));
            let word = item.map_or_else(|| status.to_string(), |(name, _)| name.clone());
            let known = strip.words.iter().position(|(other, _)| *other == word);
            let index = known.unwrap_or_else(|| {
                strip.words.push((word, colour(status)));
                strip.words.len() - 1
            });
            strip.parts.push((plot::seven_digits(time), index));
        }
        Some(strip)
    }
}

/// The times at which the status changes, with the new status. Of samples too close to distinguish in a
/// picture, the most serious one counts.
fn changes(times: &[f64], seen: &[f64]) -> Vec<(f64, i32)> {
    let together = seen.len().div_ceil(POINTS).max(1);
    let gravest =
        |chunk: &[f64]| chunk.iter().map(|&status| status as i32).max_by_key(|&status| gravity(status));
    let firsts = times.chunks(together).map(|chunk| chunk[0]);
    let mut changes: Vec<_> =
        firsts.zip(seen.chunks(together)).filter_map(|(time, chunk)| Some((time, gravest(chunk)?))).collect();
    changes.dedup_by_key(|(_, status)| *status);
    changes
}

/// How serious a status is for the reader: least if the filter changed nothing, more if it acted, most if it
/// could not act.
fn gravity(status: i32) -> i32 {
    match Status::from_number(status) {
        Some(Status::Unchanged) => 0,
        Some(Status::Filtered) => 1,
        Some(Status::Backup) => 2,
        Some(Status::NotArmed) => 3,
        _ => 3 + status,
    }
}

/// The colour of a status, an index into [`plot::PALETTE`].
fn colour(status: i32) -> usize {
    match Status::from_number(status) {
        Some(Status::Unchanged) => 2,
        Some(Status::Filtered) => 5,
        Some(Status::Backup) => 3,
        Some(Status::Infeasible) => 1,
        Some(Status::NoAuthority) => 4,
        Some(Status::SolverFailed) => 0,
        _ => 6,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_status_of_one_sample_is_seen_in_a_long_run() {
        let times: Vec<f64> = (0..100_000).map(f64::from).collect();
        let number = |status: Status| f64::from(status as u8);
        // The status alternates at every sample, as at the edge of a set.
        let mut seen: Vec<f64> =
            (0..times.len()).map(|k| number([Status::Unchanged, Status::Filtered][k % 2])).collect();
        assert_eq!(changes(&times, &seen), [(0.0, Status::Filtered as i32)]);
        seen[77_777] = number(Status::Infeasible);
        let found = changes(&times, &seen);
        let graver: Vec<_> =
            found.iter().filter(|(_, status)| *status == Status::Infeasible as i32).collect();
        // 50 samples merge into one.
        assert_eq!(graver, [&(77_750.0, Status::Infeasible as i32)]);
        assert_eq!(found.len(), 3);
        assert_eq!(changes(&times[..4], &seen[..4]).len(), 4, "a short run is drawn as it is");
    }
}
