//! The keys of `[[barrier]]`, and the parameters of the FMU that belong to their numbers.

use punctual_core::MAX_RELATIVE_DEGREE;

use super::super::key::{
    Key, Section,
    Unit::{self, Is, OfH, OfHighestDerivative},
    Value::{self, Count, Flag, Name, Names, Number, Numbers, Pair, Place, Text, Word},
};
use super::super::{FilterConfiguration, Parameter, PlantSection, Range};
use super::shape::NAMES;
use super::{BarrierSection, InfeasibleName, MethodName, ProfileName};

const S: Unit = Is("s");
const M: Unit = Is("m");

/// A key with its parameters.
struct Row {
    key: Key,
    /// The parameters, one for each component of its value. A barrier has those that reach a number in it.
    parameters: &'static [Part],
}

/// A number behind a key.
struct Part {
    /// Suffix to the key in the parameter's name, such as `[1]` of a first component.
    index: &'static str,
    /// Range of the part, where it is narrower than that of the key.
    range: Option<Range>,
    /// Meaning, as the FMU tells it.
    description: &'static str,
    access: fn(&mut BarrierSection) -> Option<&mut f64>,
}

/// The part that is the whole number.
const fn whole(description: &'static str, access: fn(&mut BarrierSection) -> Option<&mut f64>) -> Part {
    part("", description, access)
}

const fn part(
    index: &'static str,
    description: &'static str,
    access: fn(&mut BarrierSection) -> Option<&mut f64>,
) -> Part {
    Part { index, range: None, description, access }
}

/// A key without parameters.
const fn plain(
    name: &'static str,
    value: Value,
    default: Option<&'static str>,
    meaning: &'static str,
) -> Row {
    Row { key: Key::new(name, value, default, meaning), parameters: &[] }
}

static KEYS: [Row; 44] = [
    plain("name", Name, None, "unique; the prefix of its variables"),
    plain("agent", Name, Some("every one"), "of a [team](#teams): the agent that it is for"),
    plain(
        "shape",
        Word(&NAMES),
        Some("`disc`; `expression`, `plugin` or `external` as the plant and `expression` say"),
        "see the next table",
    ),
    Row {
        key: Key {
            name: "deadline",
            value: Number(S, Range::POSITIVE),
            default: Some("none"),
            meaning: "after the first step: to be inside from then on. Without one the barrier is to be kept from a start \
                      inside it; one outside is promised nothing, and `check` and `run` say so",
        },
        parameters: &[whole("time from the first step by which h >= 0, and stays so", |b| {
            b.deadline.as_mut()
        })],
    },
    plain(
        "method",
        Word(MethodName::WORDS),
        Some("`reference_profile`"),
        "`reference_profile` (ours) or `repeated_root` (the paper's, where it has an admissible rate)",
    ),
    plain(
        "profile",
        Word(ProfileName::WORDS),
        Some("`hermite`"),
        "`hermite`, or `low_peak`: least peak, 4d/T² from rest in place of 6d/T²",
    ),
    Row {
        key: Key {
            name: "rate",
            value: Number(Is("1/s"), Range::NON_NEGATIVE),
            default: Some("0"),
            meaning: "decay of an error against the profile; 0 means 20/`deadline`, without a deadline as fast as the \
                      bounds can still stop; at most 0.5/step",
        },
        parameters: &[
            whole("decay rate of an error against the profile; 0: 20 / deadline, at most 0.5 / step", |b| {
                b.deadline.map(|_| &mut b.rate.0)
            }),
            whole(
                "how fast h may approach the margin; 0: as fast as the bounds can still stop, at most 0.5 / step",
                |b| {
                    if b.deadline.is_none() { Some(&mut b.rate.0) } else { None }
                },
            ),
        ],
    },
    plain(
        "rates",
        Numbers(Is("1/s"), Range::POSITIVE),
        Some("none"),
        "as many rates as the relative degree, in place of `rate`",
    ),
    Row {
        key: Key {
            name: "stay_rate",
            value: Number(Is("1/s"), Range::NON_NEGATIVE),
            default: Some("0"),
            meaning: "after the deadline; 0 means as `rate`",
        },
        parameters: &[whole("rate of the constraint that keeps it inside; 0: as rate", |b| {
            Some(&mut b.stay_rate.0)
        })],
    },
    Row {
        key: Key {
            name: "margin",
            value: Number(OfH, Range::NON_NEGATIVE),
            default: Some(
                "a hundredth of the radius, half axis or half side; [of an expression](#expressions) a ten-thousandth of its \
                 constant term, or of the largest h if less, and at most 0.001; else 0",
            ),
            meaning: "less than the largest h: the target is h ≥ margin, and plans keep half of it in reserve for a plant that differs slightly from the model; the expected loss from held inputs is added",
        },
        parameters: &[whole("h to reach and to stay above", |b| Some(&mut b.margin))],
    },
    Row {
        key: Key {
            name: "recovery",
            value: Number(S, Range::NON_NEGATIVE),
            default: Some("0"),
            meaning: "a new deadline after leaving the set, once the first deadline has passed, which is not changed; 0: leaving is only reported",
        },
        parameters: &[whole("deadline for coming back after leaving; 0: none", |b| Some(&mut b.recovery.0))],
    },
    Row {
        key: Key {
            name: "disturbance",
            value: Number(OfHighestDerivative, Range::NON_NEGATIVE),
            default: Some("0"),
            meaning: "bound on the model's error in h⁽ⁿ⁾; the promise of the row holds for every error within it. It switches plans off: \
                      they account for `rates` of [`[uncertainty]`](#uncertainty) instead",
        },
        parameters: &[whole(
            "bound on the model's error in the derivative of h that the inputs enter",
            |b| b.disturbance.as_mut(),
        )],
    },
    plain(
        "when_infeasible",
        Word(InfeasibleName::WORDS),
        Some("`report`"),
        "`report`, or `earliest`: replaces a deadline that the bounds certainly do not allow by a later one; with `assurance`, one \
         that no plan keeps by the earliest that a plan keeps",
    ),
    plain(
        "priority",
        Count(0, u32::MAX as u64),
        Some("0 where the start is inside, else 1"),
        "if not all can be met, smaller numbers come first, and among equal ones the barrier listed first",
    ),
    Row {
        key: Key {
            name: "penalty",
            value: Number(Is("1"), Range::NON_NEGATIVE),
            default: Some("0"),
            meaning: "makes it soft: it yields where it would cost more than this ‖u − u_ref‖; 0: hard",
        },
        parameters: &[Part {
            index: "",
            range: Some(Range::POSITIVE),
            description: "distance in u beyond which it yields",
            access: |b| b.penalty.as_mut(),
        }],
    },
    Row {
        key: Key {
            name: "begin",
            value: Number(S, Range::NON_NEGATIVE),
            default: Some("0"),
            meaning: "after the first step, before `deadline`: enforced from then on. Without a deadline the state must \
                      be inside then",
        },
        parameters: &[whole("time from the first step from which it is enforced", |b| b.begin.as_mut())],
    },
    plain(
        "after",
        Name,
        Some("none"),
        "the name of a barrier above: enforced once that has been reached. Without a deadline the state must be inside then",
    ),
    Row {
        key: Key {
            name: "end",
            value: Number(S, Range::NON_NEGATIVE),
            default: Some("0"),
            meaning: "after the first step, after `begin`, at or after `deadline`: released then; 0: never",
        },
        parameters: &[whole("time from the first step until it is released; 0: never", |b| b.end.as_mut())],
    },
    plain("until_arrival", Flag, Some("`false`"), "released once it has been reached"),
    Row {
        key: Key {
            name: "stay",
            value: Number(S, Range::NON_NEGATIVE),
            default: Some("0"),
            meaning: "released once it has been kept for this long; it is reached by `deadline`, and left after that; 0: no such end",
        },
        parameters: &[whole("how long it is kept before it is released", |b| b.stay.as_mut())],
    },
    plain(
        "until",
        Name,
        Some("none"),
        "the name of another barrier: released once that has been reached, as a door once the key is there",
    ),
    plain(
        "choice",
        Name,
        Some("none"),
        "a name that several barriers give: one of them is promised, which the first step decides, and the others are released. Needs plans",
    ),
    plain(
        "alternative",
        Name,
        Some("none: it is one by itself"),
        "barriers of a `choice` that give the same name here are promised together",
    ),
    Row {
        key: Key {
            name: "centre",
            value: Place(M, Range::FINITE),
            default: Some(""),
            meaning: "the centre, of a moving disc where it is at time 0; a point of the line of a half-plane; three numbers for a \
                      sphere or a box",
        },
        parameters: &[
            part("[1]", "x of a point of the line", |b| b.shape.line().map(|(centre, _)| &mut centre[0])),
            part("[2]", "y of a point of the line", |b| b.shape.line().map(|(centre, _)| &mut centre[1])),
            part("[1]", "centre along x, at time 0", |b| b.shape.centre().and_then(|c| c.get_mut(0))),
            part("[2]", "centre along y, at time 0", |b| b.shape.centre().and_then(|c| c.get_mut(1))),
            part("[3]", "centre along z", |b| b.shape.centre().and_then(|c| c.get_mut(2))),
        ],
    },
    plain(
        "position",
        Names,
        Some("`x`, `y` and `z` of the model, or `x_p`, `y_p`, `z_p`, or `p_x`, `p_y`, `p_z`"),
        "of a model of your own: the states that are the position which the shape is about, in m",
    ),
    plain("from", Names, Some(""), "`apart`: the states that are the other position"),
    Row {
        key: Key {
            name: "distance",
            value: Number(M, Range::POSITIVE),
            default: Some(""),
            meaning: "the least distance of the two positions",
        },
        parameters: &[whole("least distance of the two positions", |b| b.shape.distance())],
    },
    plain(
        "centre_input",
        Flag,
        Some("`false`"),
        "centre and velocity are inputs of the FMU, such as another FMU's outputs, that start with the values here \
         ([`escort.toml`](../examples/vehicles/escort.toml))",
    ),
    Row {
        key: Key {
            name: "velocity",
            value: Pair(Is("m/s"), Range::FINITE),
            default: Some("0"),
            meaning: "the velocity of the centre",
        },
        parameters: &[
            part("[1]", "velocity of the centre along x", |b| b.shape.point().map(|p| &mut p.velocity[0])),
            part("[2]", "velocity of the centre along y", |b| b.shape.point().map(|p| &mut p.velocity[1])),
        ],
    },
    Row {
        key: Key {
            name: "acceleration",
            value: Number(Is("m/s2"), Range::NON_NEGATIVE),
            default: Some("none: no plan predicts a centre that is an input"),
            meaning: "by how much the velocity of a centre that is an input may change, in any direction, for ever: then \
                      [plans account for it](#moving-centres)",
        },
        parameters: &[whole("bound on the acceleration of the centre, which plans account for", |b| {
            b.shape.disc()?.acceleration.as_mut()
        })],
    },
    Row {
        key: Key {
            name: "centre_error",
            value: Number(M, Range::NON_NEGATIVE),
            default: Some("0"),
            meaning: "how far the centre may be from that input",
        },
        parameters: &[whole("how far the centre may be from its input", |b| {
            b.shape.disc()?.centre_error.as_mut()
        })],
    },
    Row {
        key: Key {
            name: "velocity_error",
            value: Number(Is("m/s"), Range::NON_NEGATIVE),
            default: Some("0"),
            meaning: "how far its velocity may be from that input",
        },
        parameters: &[whole("how far the velocity of the centre may be from its input", |b| {
            b.shape.disc()?.velocity_error.as_mut()
        })],
    },
    Row {
        key: Key {
            name: "radius",
            value: Number(M, Range::POSITIVE),
            default: Some(""),
            meaning: "the radius of the disc",
        },
        parameters: &[whole("radius of the disc", |b| b.shape.radius())],
    },
    Row {
        key: Key {
            name: "smoothing",
            value: Number(M, Range::NON_NEGATIVE),
            default: Some("0"),
            meaning: "rounding of the distance at the centre; 0: the radius",
        },
        parameters: &[whole("rounding of the distance at the centre; 0: the radius", |b| {
            b.shape.smoothing()
        })],
    },
    Row {
        key: Key {
            name: "half_axes",
            value: Pair(M, Range::POSITIVE),
            default: Some(""),
            meaning: "the one at the angle, and the one across",
        },
        parameters: &[
            part("[1]", "half axis at the angle", |b| b.shape.half_axes().map(|a| &mut a[0])),
            part("[2]", "half axis across", |b| b.shape.half_axes().map(|a| &mut a[1])),
        ],
    },
    Row {
        key: Key {
            name: "half_sides",
            value: Place(M, Range::POSITIVE),
            default: Some(""),
            meaning: "the one at the angle, and the one across; of a box also the vertical one",
        },
        parameters: &[
            part("[1]", "half side at the angle", |b| b.shape.half_sides().and_then(|a| a.get_mut(0))),
            part("[2]", "half side across", |b| b.shape.half_sides().and_then(|a| a.get_mut(1))),
            part("[3]", "vertical half side", |b| b.shape.half_sides().and_then(|a| a.get_mut(2))),
        ],
    },
    Row {
        key: Key {
            name: "angle",
            value: Number(Is("rad"), Range::FINITE),
            default: Some("0"),
            meaning: "the angle from the x axis, of a box about the vertical",
        },
        parameters: &[whole("from the x axis", |b| b.shape.angle())],
    },
    Row {
        key: Key {
            name: "normal",
            value: Pair(Is("1"), Range::FINITE),
            default: Some(""),
            meaning: "a vector into the half-plane, of any length but 0",
        },
        parameters: &[
            part("[1]", "x of a vector into the half-plane", |b| b.shape.line().map(|(_, n)| &mut n[0])),
            part("[2]", "y of a vector into the half-plane", |b| b.shape.line().map(|(_, n)| &mut n[1])),
        ],
    },
    plain("state", Name, Some(""), "the state that is bounded"),
    Row {
        key: Key {
            name: "bound",
            value: Number(OfH, Range::FINITE),
            default: Some(""),
            meaning: "the bound; of a `speed_limit` > 0",
        },
        parameters: &[
            whole("the bound", |b| b.shape.bound()),
            Part {
                index: "",
                range: Some(Range::POSITIVE),
                description: "the bound",
                access: |b| b.shape.speed(),
            },
        ],
    },
    plain("expression", Text, Some(""), "h, of states, parameters of the plant and the time `t`"),
    plain("output", Name, Some("the barrier's name"), "its name in the plug-in"),
    plain("unit", Text, Some("`1`; that of the plug-in"), "the unit of h, such as `m/s2`"),
    plain(
        "relative_degree",
        Count(1, MAX_RELATIVE_DEGREE as u64),
        Some(""),
        "the order of the derivative of h that the inputs enter; it is not checked",
    ),
];

/// The table `[[barrier]]`.
pub(in super::super) static SECTION: Section =
    Section { name: "barrier", keys: || KEYS.iter().map(|row| &row.key).collect() };

impl BarrierSection {
    /// Numbers of the barrier that are parameters of the FMU: barrier `index` of a filter for `plant`, of
    /// relative degree `degree` where that is known.
    pub(in super::super) fn parameters(
        &self,
        index: usize,
        plant: &PlantSection,
        degree: Option<usize>,
    ) -> Vec<Parameter<FilterConfiguration>> {
        let mut reached = self.clone();
        let mut parameters = Vec::new();
        for row in &KEYS {
            let (Number(unit, range) | Pair(unit, range) | Place(unit, range)) = row.key.value else {
                continue;
            };
            let unit = unit.of_barrier(&self.unit(plant), degree.unwrap_or_default());
            for part in row.parameters.iter().filter(|part| (part.access)(&mut reached).is_some()) {
                // Files count barriers from 0, as the error messages of serde do; FMI counts the components
                // of a vector from 1.
                let name = format!("{}{}", row.key.name, part.index);
                let names = (format!("{}.{name}", self.name), format!("barrier[{index}].{name}"));
                let range = part.range.unwrap_or(range);
                parameters.push(Parameter::new(
                    names,
                    unit.clone(),
                    range,
                    part.description,
                    move |c: &mut FilterConfiguration| c.barrier.get_mut(index).and_then(part.access),
                ));
            }
        }
        parameters
    }
}
