//! The formulas of the documentation, which are code blocks of the language `math`, are LaTeX that KaTeX can
//! render.

use crate::sources::{TEXTS, Text};

const ENVIRONMENTS: &[&str] = &["align", "aligned", "cases"];

/// Commands that the formulas use. KaTeX supports all of them; look up a new one before adding it here.
const COMMANDS: &[&str] = &[
    "begin",
    "end",
    "tag",
    "text",
    "operatorname",
    "mathtt",
    "left",
    "right",
    "qquad",
    "mu",
    "dot",
    "quad",
    "Gamma",
    "bar",
    "underline",
    "pi",
    "nabla",
    "frac",
    "binom",
    "partial",
    "sum",
    "prod",
    "max",
    "min",
    "cos",
    "exp",
    "dots",
    "pm",
    "ge",
    "le",
    "alpha",
    "delta",
    "rho",
    "gamma",
    "Lambda",
    "tau",
    "psi",
    "varphi",
    "sigma",
    "omega",
    "Delta",
    "eta",
    "hat",
    "infty",
    "int",
    "lambda",
    "sqrt",
    "top",
    "varepsilon",
    "vartheta",
    "zeta",
];

/// A block: the line after its fence, and its text.
struct Block<'a> {
    path: &'a str,
    line: usize,
    lines: Vec<&'a str>,
}

/// The blocks of a Rust or Markdown file; in Rust, those of its documentation.
fn blocks(text: &Text) -> Vec<Block<'_>> {
    let rust = text.path.ends_with(".rs");
    let mut blocks: Vec<Block<'_>> = Vec::new();
    let mut inside = false;
    for (i, line) in text.text.lines().enumerate() {
        let content = match line.trim_start() {
            doc if rust => doc.strip_prefix("//!").or_else(|| doc.strip_prefix("///")),
            line => Some(line),
        };
        match (content.map(str::trim), inside) {
            (Some("```math"), false) => {
                blocks.push(Block { path: &text.path, line: i + 2, lines: Vec::new() });
                inside = true;
            }
            (Some("```") | None, true) => inside = false,
            (Some(line), true) => blocks.last_mut().expect("one is open").lines.push(line),
            _ => {}
        }
    }
    blocks
}

/// The defect of a formula, if it has one.
fn defect(formula: &str) -> Option<String> {
    if formula.trim().is_empty() {
        return Some("nothing in it".to_owned());
    }
    if let Some(c) = formula.chars().find(|c| !c.is_ascii() || *c == '%') {
        return Some(format!("{c:?}, for which LaTeX has a name"));
    }
    // Open groups: "{", "left", or an environment.
    let mut open: Vec<&str> = Vec::new();
    let mut rest = formula;
    while let Some(at) = rest.find(['{', '}', '\\']) {
        let (found, after) = (rest.as_bytes()[at], &rest[at + 1..]);
        rest = after;
        if found == b'{' {
            open.push("{");
            continue;
        }
        if found == b'}' {
            if open.pop() != Some("{") {
                return Some("a brace that closes nothing".to_owned());
            }
            continue;
        }
        let length = after.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(after.len());
        let command = &after[..length];
        // A command of one character, such as a space.
        rest = if length == 0 { after.get(1..).unwrap_or_default() } else { &after[length..] };
        let argument = rest.strip_prefix('{').and_then(|a| a.split('}').next()).unwrap_or_default();
        match command {
            "begin" if ENVIRONMENTS.contains(&argument) => open.push(argument),
            "begin" => return Some(format!("the environment {argument:?}")),
            "end" if open.pop() != Some(argument) => {
                return Some(format!("\\end{{{argument}}} without its begin"));
            }
            "left" => open.push("left"),
            "right" if open.pop() != Some("left") => return Some("\\right without \\left".to_owned()),
            "tag" if !matches!(open[..], [] | ["align"]) => {
                return Some("\\tag inside of something".to_owned());
            }
            "" | "end" | "right" | "tag" => {}
            known if COMMANDS.contains(&known) => {}
            unknown => return Some(format!("\\{unknown}")),
        }
        if matches!(command, "begin" | "end") {
            rest = &rest[argument.len() + 2..];
        }
    }
    open.last().map(|open| format!("{open:?} is not closed"))
}

#[test]
fn every_formula_can_be_set() {
    let mut modules = 0;
    for text in TEXTS.iter().filter(|t| [".rs", ".md"].iter().any(|end| t.path.ends_with(end))) {
        for Block { path, line, lines } in blocks(text) {
            modules += usize::from(path.starts_with("core/src/"));
            let defect = defect(&lines.join("\n"));
            assert!(defect.is_none(), "{path}:{line}: {}", defect.unwrap_or_default());
        }
    }
    assert!(modules >= 10, "{modules} formulas found in the core");
}

#[test]
fn defects_are_found() {
    for good in
        [r"e \ge e^{-a\tau}\, P, \tag{L}", r"\begin{aligned} a &= \left(b\right) \\ c &= \{d\} \end{aligned}"]
    {
        assert_eq!(defect(good), None, "{good}");
    }
    for bad in [
        " ",
        "e^{-a",
        "e}",
        "e ≥ 0",
        "e % 2",
        r"\begin{table} \end{table}",
        r"\begin{aligned} a",
        r"\greater",
        r"\begin{aligned} {a \end{aligned} }",
        r"\left( a",
        r"a \right)",
        r"\begin{aligned} a \tag{L} \end{aligned}",
    ] {
        assert!(defect(bad).is_some(), "{bad}");
    }
    let text = Text {
        path: "a.rs".to_owned(),
        text: "//! ```math\n//! a\n//! ```\n/// ```math\n/// b\nfn c() {}".to_owned(),
    };
    let found: Vec<_> = blocks(&text).iter().map(|b| (b.line, b.lines.concat())).collect();
    assert_eq!(found, [(2, "a".to_owned()), (5, "b".to_owned())]);
}

/// The header that renders them is the one that docs.rs and docs/rustdoc pass to rustdoc, and what it loads
/// is pinned.
#[test]
fn the_header_is_named_and_pinned() {
    let text =
        |path: &str| &*TEXTS.iter().find(|t| t.path == path).unwrap_or_else(|| panic!("no {path}")).text;
    let header = text("core/docs/katex.html");
    assert!(text("core/Cargo.toml").contains(r#"rustdoc-args = ["--html-in-header", "docs/katex.html"]"#));
    assert!(text("docs/rustdoc").contains("--html-in-header core/docs/katex.html"));
    let loaded: Vec<_> = header.split("https://").skip(1).collect();
    assert!(!loaded.is_empty(), "core/docs/katex.html loads nothing");
    for element in loaded {
        let element = element.split('>').next().unwrap_or_default();
        assert!(element.contains("integrity=\"sha384-"), "core/docs/katex.html: {element}");
    }
}
