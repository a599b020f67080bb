//! Writes `documentation/index.html` of an FMU: its purpose, its coupling, its variables.

use punctual_fmu::configuration::{Configuration, FmiVersion, SamplingName};
use punctual_fmu::product::Product;
use punctual_modeldescription::{Real, Variable, VariableKind, fmi3};

/// A variable for the reader: name, causality, unit, start, range, meaning.
pub(super) type Row = [String; 6];

/// A model description as the text of its file, and as rows of the page.
pub(super) struct Described {
    pub(super) xml: String,
    /// The file of the terminals, which only FMI 3.0 has.
    pub(super) terminals: Option<String>,
    pub(super) rows: Vec<Row>,
}

/// The range of a number, as text.
fn range(min: Option<f64>, max: Option<f64>) -> String {
    let text = |value: Option<f64>| value.map(shown).unwrap_or_default();
    match (min, max) {
        (None, None) => String::new(),
        _ => format!("{} … {}", text(min), text(max)),
    }
}

/// The row of a variable of FMI 2.0.
pub(super) fn row(v: &Variable) -> Row {
    let (unit, start, range) = match &v.kind {
        VariableKind::Real(Real { start, min, max, unit, .. }) => {
            (unit.clone().unwrap_or_default(), start.map(shown).unwrap_or_default(), range(*min, *max))
        }
        VariableKind::Enumeration(of) => {
            (String::new(), String::new(), of.declared_type.clone().unwrap_or_default())
        }
        VariableKind::Boolean(of) => {
            (String::new(), of.start.map(|s| s.to_string()).unwrap_or_default(), String::new())
        }
        _ => Default::default(),
    };
    [v.name.clone(), v.causality.as_str().to_owned(), unit, start, range, v.description.clone()]
}

/// The row of a variable of FMI 3.0; the sizes of an array follow its name.
pub(super) fn row_of_fmi3(v: &fmi3::Variable) -> Row {
    let sizes: Vec<_> = v.dimensions.iter().filter_map(|d| Some(d.start?.to_string())).collect();
    let name = if sizes.is_empty() { v.name.clone() } else { format!("{}[{}]", v.name, sizes.join(",")) };
    let (unit, start, range) = match &v.kind {
        fmi3::VariableKind::Float64(of) => {
            let start: Vec<_> = of.start.iter().map(|value| shown(*value)).collect();
            (of.unit.clone().unwrap_or_default(), start.join(" "), range(of.min, of.max))
        }
        fmi3::VariableKind::Boolean(of) => {
            let start: Vec<_> = of.start.iter().map(ToString::to_string).collect();
            (String::new(), start.join(" "), String::new())
        }
        _ => (String::new(), String::new(), v.declared_type.clone().unwrap_or_default()),
    };
    [name, v.causality.as_str().to_owned(), unit, start, range, v.description.clone()]
}

/// Writes the page.
pub(super) fn page(product: &Product, described: &Described, canonical: &str) -> String {
    let description = &product.model_description();
    // The rows of variables, and the enumerations.
    let mut rows = String::new();
    for row in &described.rows {
        let cells: String = row.iter().map(|cell| format!("<td>{}</td>", escape(cell))).collect();
        rows += &format!("<tr>{cells}</tr>\n");
    }
    let mut enumerations = String::new();
    for e in &description.types {
        let items: String = e
            .items
            .iter()
            .map(|i| {
                format!(
                    "<tr><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                    i.value,
                    i.name,
                    escape(&i.description)
                )
            })
            .collect();
        enumerations +=
            &format!("<h2>{}: {}</h2>\n<table>\n{items}</table>\n", e.name, escape(&e.description));
    }
    // The texts for this kind of FMU.
    let use_of = match &product.configuration {
        Configuration::Filter(_) => FILTER,
        Configuration::Plant(_) => PLANT,
        Configuration::Controller(_) => CONTROLLER,
    };
    let mut given = String::new();
    if let Configuration::Filter(c) = &product.configuration {
        given += match c.sampling {
            SamplingName::Pointwise => POINTWISE,
            SamplingName::Measured | SamplingName::StepSize => PREDICTED,
        };
        given += if c.is_assured() { ASSURED } else { ROWS };
        if c.actuation_delay > 0.0 {
            given += &late(c.actuation_delay);
        } else if c.may_be_late() {
            given += PROMPT;
        }
        given += if c.external().is_some() { EXTERNAL } else { "" };
    }
    let experiment = product.configuration.experiment();
    let step = experiment.step_size;
    let mut texts = format!("{use_of}{given}");
    if experiment.fmi == FmiVersion::Three && experiment.arrays {
        // An array is called by the part of the scalars' names before the dot.
        texts = texts.replace(".*</code>", "</code>");
    }
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{name}</title>\n<style>{STYLE}</style></head>\n\
         <body>\n<h1>{name}</h1>\n<p>{text}. Made for a communication step of {step} s.</p>\n{texts}\n\
         <h2>Variables</h2>\n<table>\n<tr><th>name</th><th>causality</th><th>unit</th><th>start</th><th>range</th>\
         <th>meaning</th></tr>\n{rows}</table>\n{enumerations}<h2>Configuration</h2>\n<pre>{canonical}</pre>\n\
         <p>{tool}</p>\n</body></html>\n",
        name = escape(&description.model_name),
        text = escape(&description.description),
        canonical = escape(canonical),
        tool = escape(&description.generation_tool),
    )
}

const STYLE: &str = "body{font:15px/1.45 sans-serif;max-width:70em;margin:2em auto;padding:0 1em}\
                     table{border-collapse:collapse}td,th{border:1px solid #ccc;padding:.2em .6em;text-align:left}";

const FILTER: &str = "<p>Connect the measured state to <code>x.*</code>, the wanted input to <code>u_ref.*</code>, and \
<code>u.*</code> to the plant. The first step with finite inputs is the anchor: every deadline counts from it. \
An output read after inputs were set belongs to those inputs at that communication point; after a step without new \
inputs it stays the sample taken at the step's start, which is the input to hold over the step. A master that \
exchanges all values before stepping (Jacobi) therefore delays <code>u.*</code> by one step.</p>\n\
<p><code>status</code> says what <code>u.*</code> means; only <code>unchanged</code>, <code>filtered</code> and \
<code>backup</code> satisfy every constraint.</p>";

const POINTWISE: &str = "\n<p>The promise is one of continuous time: between samples the input is held, and the margin has \
to cover what that costs.</p>";

const PREDICTED: &str = "\n<p>Between samples the input is held. The filter predicts the state over that time, and adds to \
the margin what the hold still costs.</p>";

const PROMPT: &str = "\n<p><code>actuation_delay</code> is 0: the promise holds where <code>u.*</code> acts in the step of its \
sample. For a Jacobi master set this parameter to the communication step, or build with <code>--master jacobi</code>.</p>";

/// What a filter with a delay says of it, in s.
fn late(delay: f64) -> String {
    format!(
        "\n<p>The promise holds where <code>u.*</code> acts {delay} s after its sample (<code>actuation_delay</code>), as with a \
         master that exchanges all values before a step of that length (Jacobi). Until the inputs of the first step are set, \
         <code>u.*</code> is what is assumed to act before: the admissible input nearest 0.</p>"
    )
}

const ASSURED: &str = "\n<p>The filter promises only what a plan within the bounds keeps, whatever <code>u_ref.*</code> is. \
<code>assurance</code> says whether it has one.</p>";

const ROWS: &str = "\n<p>No plan is followed: <code>on_course</code> says that the conditions of the promise have held so \
far, not that an input will exist later.</p>";

const EXTERNAL: &str = "\n<p>An external barrier has no model: set its inputs at every communication point. <code>lf0</code> \
is h, <code>lf1</code> and on are its time derivatives, the last of them where every input of the plant is 0, and \
<code>lg.*</code> what one unit of each input adds to that one. Nothing is predicted from them.</p>";

const PLANT: &str = "<p>Set the initial state through the parameters <code>x0.*</code>. Inputs are held over a step; the \
step is divided into equal Runge-Kutta steps of at most <code>inner_step</code>.</p>";

const CONTROLLER: &str = "<p>Connect the measured state to <code>x.*</code> and <code>u_ref.*</code> to the filter. \
It promises nothing; that is what the filter is for. A state that is not finite gives <code>u_ref.*</code> that are not a \
number, which the filter reports as <code>invalid_input</code>.</p>";

/// A number with all its digits, in exponent notation if there are many.
fn shown(value: f64) -> String {
    let text = value.to_string();
    if text.len() > 20 { format!("{value:e}") } else { text }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
