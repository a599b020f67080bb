//! A filter as a file for the C library.

use punctual_core::filter::TabledPlan;
use punctual_embedded::{BarrierFile, FilterFile, Promise, Settings};

use super::{BarrierSection, ConfigurationError, FilterConfiguration, VariableSection};

/// What is not there, why, and what to do.
const NO_SEARCH: &str = "and a file of the C library searches for no plan: give the starts for which one is made in \
                         `[follower]`, or take the rows alone with `assurance = \"off\"`, whose promises hold as long as each step is met";

impl FilterConfiguration {
    /// The filter as a file of the [C library](punctual_embedded): its plant and its barriers as expressions, and the plan of
    /// `[follower]`, if it has one.
    ///
    /// # Errors
    ///
    /// What the library has not: a search for plans, an integrator, plug-ins, barriers and centres that are inputs; without a plan,
    /// uncertainty. Why no plan was found.
    pub fn embedded(&self) -> Result<(FilterFile, Option<TabledPlan>), ConfigurationError> {
        let refuse = |field: &str, message: &str| Err(ConfigurationError::new(field, message));
        if self.plant.plugin().is_some() || self.plant.is_external() {
            return refuse(
                "plant",
                "is no model of expressions, must be one, or a vehicle with a name, for a file of the C library",
            );
        }
        if self.is_assured() && self.run.follower.is_none() {
            return refuse("assurance", &format!("is on, {NO_SEARCH}"));
        }
        if self.integrator.is_some() {
            return refuse("integrator", "must be left out for a file of the C library, which has none");
        }
        if self.run.follower.is_none() && self.measurement_errors.values().any(|error| *error != 0.0) {
            let message = "must be left out for a file of the C library without a plan (`[follower]`): its rows account for none";
            return refuse("measurement_errors", message);
        }
        let table = self.tabled()?;
        let model = self.plant.expressions()?;
        let (mut plant, mut barriers) = (None, Vec::new());
        for (i, section) in self.barrier.iter().enumerate() {
            let named = |field: &str, message: &str| {
                ConfigurationError::new(format!("barrier[{i}].{field}"), message)
            };
            let Some(text) = self.text_of(section) else {
                let message = "is an input, must not be for a file of the C library";
                let field = if section.shape.followed().is_some() { "centre_input" } else { "shape" };
                return Err(named(field, message));
            };
            let barrier = model.barrier(&text).map_err(|e| named(e.field(), e.message()))?;
            let found = barrier.relative_degree(&self.plant.ranges());
            let degree = found.require(None).map_err(|e| self.refused(i, &e))?;
            let (of_plant, tape) = barrier.recorded();
            plant.get_or_insert(of_plant);
            let (begin, end) = self.window(i)?;
            let promise = Promise::of(&section.settings().map_err(|e| self.refused(i, &e))?);
            barriers.push(BarrierFile {
                tape,
                relative_degree: degree as u8,
                promise,
                begin,
                end,
                strictness: self.strictness(i)?,
                is_planned: table.as_ref().is_some_and(|table| table.promised[i]),
            });
        }
        let Some(plant) = plant else { return refuse("barrier", "is empty, must have at least 1") };
        let settings = Settings {
            bounds: self.input_bounds()?,
            sampling: self.sampling(self.experiment.step_size),
            correction_limit: self.correction_limit,
            brief_search: self.brief_search,
            actuation_delay: self.actuation_delay,
            period_max: self.period_max,
            arm_after: self.arm_after,
        };
        let plan = table.as_ref().map(|table| table.bytes.clone()).unwrap_or_default();
        Ok((FilterFile { settings, plant, barriers, plan }, table))
    }

    /// h of a barrier as an expression of the plant's states.
    fn text_of(&self, section: &BarrierSection) -> Option<String> {
        if section.shape.followed().is_some() {
            return None;
        }
        let Some(_) = self.plant.reference() else { return section.shape.expression(&section.position, &[]) };
        let states = self.plant.states();
        let named = |names: &[&'static str]| -> Vec<&'static str> {
            names.iter().copied().filter(|name| states.iter().any(|state| state.name == *name)).collect()
        };
        let position: Vec<String> = ["x_p", "y_p"].map(str::to_owned).into();
        section.shape.expression(&position, &named(&["v", "v_x", "v_y"]))
    }

    /// A C header for the `bytes` of its [file](Self::embedded): the numbers of states, inputs and barriers by their names, which
    /// begin with `name`, and the bytes themselves.
    pub fn embedded_header(&self, name: &str, bytes: &[u8]) -> String {
        let identifier = |text: &str| -> String {
            text.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
        };
        let digit = if name.starts_with(|c: char| c.is_ascii_digit()) { "_" } else { "" };
        let lower = format!("{digit}{}", identifier(name).to_lowercase());
        let upper = lower.to_uppercase();
        let variables = |variables: Vec<VariableSection>| -> Vec<[String; 2]> {
            let about = |v: &VariableSection| {
                let about = format!("{} [{}]", v.description, v.unit).replace("*/", "* /");
                about.trim_start().to_owned()
            };
            variables.into_iter().map(|v| [identifier(&v.name), about(&v)]).collect()
        };
        let barriers =
            self.barrier.iter().map(|b| [identifier(&b.name), b.shape.name().to_owned()]).collect();
        let mut text = format!(
            "/* The filter {}, made by punctual build. */\n#ifndef {upper}_H\n#define {upper}_H\n",
            self.name.replace("*/", "* /")
        );
        for (kind, names) in [
            ("STATE", variables(self.plant.states())),
            ("INPUT", variables(self.plant.inputs())),
            ("BARRIER", barriers),
        ] {
            text += "\nenum {\n";
            for (i, [name, about]) in names.iter().enumerate() {
                text += &format!("    {upper}_{kind}_{} = {i}, /* {about} */\n", name.to_uppercase());
            }
            text += &format!("    {upper}_{kind}S = {}\n}};\n", names.len());
        }
        text += &format!(
            "\n/* The file for punctual_load. */\nstatic const unsigned char {lower}_file[{}] = {{",
            bytes.len()
        );
        for (i, byte) in bytes.iter().enumerate() {
            text += &format!("{}{byte},", if i % 24 == 0 { "\n    " } else { "" });
        }
        text += "\n};\n\n#endif\n";
        text
    }
}
