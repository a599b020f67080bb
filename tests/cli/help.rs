//! `--help`, `--version` and wrong usage.

use punctual::codes::of;

use crate::workshop::{Workshop, assert_golden};

#[test]
fn help_of_the_program() {
    let workshop = Workshop::new();
    assert_golden("help.txt", &workshop.punctual(["--help"]).success());
}

#[test]
fn help_of_every_command() {
    let workshop = Workshop::new();
    let commands = [
        "build",
        "campaign",
        "check",
        "completions",
        "demo",
        "identify",
        "inspect",
        "man",
        "merge",
        "new",
        "replay",
        "reproduce",
        "run",
        "validate",
    ];
    for command in commands {
        let help = workshop.punctual([command, "--help"]).success();
        for (code, means) in of(Some(command)) {
            assert!(help.contains(&format!("\n  {code:<3}  {means}\n")), "{command}, {code}: {help}");
        }
        assert_golden(&format!("help-{command}.txt"), &help);
    }
}

#[test]
fn version() {
    let version = format!("punctual {}\n", env!("CARGO_PKG_VERSION"));
    assert_eq!(Workshop::new().punctual(["--version"]).success(), version);
}

#[test]
fn no_command_shows_the_help_as_wrong_usage() {
    let done = Workshop::new().punctual([""; 0]);
    assert_eq!((done.code, done.stdout.as_str()), (2, ""));
    assert!(done.stderr.contains("Usage: punctual <COMMAND>"), "{}", done.stderr);
}

#[test]
fn a_missing_argument_is_named() {
    let done = Workshop::new().punctual(["build", "x.toml"]);
    done.fails_like(
        2,
        "the following required arguments were not provided:\n  --output <FILE>\n",
        &["Usage: "],
    );
}

#[test]
fn an_unknown_command_is_named() {
    Workshop::new().punctual(["biuld"]).fails_like(2, "unrecognized subcommand 'biuld'\n", &["'build'"]);
}

#[test]
fn shells_and_man_know_every_command() {
    let workshop = Workshop::new();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = workshop.punctual(["completions", shell]).success();
        assert!(script.contains("campaign") && script.contains("u-ref"), "{shell}: {script}");
    }
    workshop.punctual(["man", "pages"]).success();
    for page in ["punctual", "punctual-check", "punctual-run"] {
        let text = workshop.text(&format!("pages/{page}.1"));
        let (_, codes) = text.split_once(".SH \"EXIT STATUS\"\n").expect("a section on exit codes");
        assert_eq!(codes.matches(".TP\n").count(), 4, "{page}: {codes}");
        assert!(text.starts_with(".ie") && text.contains(".SH NAME"), "{page}: {text}");
    }
    assert!(!workshop.path("pages/punctual-trial.1").exists(), "a hidden command has a page");
}
