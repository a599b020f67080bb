//! The goal of [`super`] with its derivatives from each kind of source.

use std::path::Path;
use std::process::Command;

use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder, Sampling};
use punctual_core::lie::{DerivativeSource, Derivatives, external};
use punctual_fmu::configuration::PluginLoader;
use punctual_fmu::{PluginFolder, plugin_file_name};
use punctual_models::Model;
use punctual_models::evaluated::{CodeModel, Dimensions};

use super::{DEADLINE, X};

/// A model that every source has, with its derivatives as expressions; the plug-in gets its index.
pub(crate) const MODELS: [(&str, [&str; 4]); 3] = [
    ("point mass", ["p", "q", "a", "b"]),
    ("unicycle", ["q*cos(p)", "q*sin(p)", "b", "a"]),
    ("bicycle", ["q*cos(p)", "q*sin(p)", "q*b/l_r", "a"]),
];

fn filter(states: usize, source: Box<dyn DerivativeSource>) -> FilterBuilder {
    Filter::from_sources(states, 2)
        .source("goal", source, BarrierSettings::within(DEADLINE))
        .and_then(|b| b.sampling(Sampling::Pointwise))
        .expect("valid settings")
}

fn expression(model: usize) -> Box<dyn DerivativeSource> {
    let derivatives = MODELS[model].1;
    let model =
        Model::new(&["x", "y", "p", "q"], &["a", "b"], &[("l_r", 10.0)], &derivatives).expect("a model");
    let barrier = model.barrier("sqrt(8) - sqrt((x - 45)^2 + (y - 45)^2 + 4)").expect("a barrier");
    barrier.source(2).expect("in range")
}

/// The goal along a plant of expressions.
pub(crate) fn expressed(model: usize) -> FilterBuilder {
    filter(4, expression(model))
}

/// The goal along a plant of a plug-in, which is compiled here.
pub(crate) fn plugged(model: usize) -> FilterBuilder {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    let done = Command::new(&compiler)
        .args(["-O2", "-shared", "-fPIC", &format!("-DMODEL={model}"), "-I"])
        .arg(root.join("fmu/include"))
        .arg("-o")
        .arg(folder.path().join(plugin_file_name("bench")))
        .arg(root.join("benches/support/plugin.c"))
        .status();
    assert!(done.is_ok_and(|status| status.success()), "{compiler} does not compile the plug-in");
    let plugin = PluginFolder::new(folder.path()).load("bench").expect("a plug-in");
    let dimensions = Dimensions { states: 4, inputs: 2, barriers: 1 };
    let ranges = [[f64::NEG_INFINITY, f64::INFINITY]; 4];
    let model = CodeModel::new(plugin.code, dimensions, Vec::new(), &ranges).expect("a model");
    filter(4, model.barrier(0).and_then(|b| b.source(2)).expect("in range"))
}

/// The goal with derivatives that are handed over.
pub(crate) fn given() -> FilterBuilder {
    filter(5, external(2, 2, 0).expect("in range"))
}

/// Derivatives handed over to [`given`] at the state `x` of a model.
pub(crate) fn derivatives(model: usize, x: &[f64; 4]) -> [f64; 5] {
    let mut out = Derivatives::ZERO;
    expression(model).evaluate(0.0, x, &mut out);
    [out.drift[0], out.drift[1], out.drift[2], out.row[0], out.row[1]]
}

/// [`derivatives`] at [`X`].
pub(crate) fn on_the_way(model: usize) -> [f64; 5] {
    derivatives(model, &X)
}
