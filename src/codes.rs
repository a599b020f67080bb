//! The exit codes: one table for all commands, which `--help`, the man pages and docs/commands.md use.

use std::fmt::Write;

pub use punctual_cosim::exit::{DONE, FOUND, INTERRUPTED, MISUSE};

/// Every code, with its meaning for all commands.
pub const CODES: [(u8, &str); 4] = [
    (DONE, "done, and nothing is wrong"),
    (FOUND, "something is wrong with what the command looked at, or an FMU failed"),
    (MISUSE, "wrong usage, or a file that cannot be used"),
    (INTERRUPTED, "interrupted; what was done until then is kept"),
];

/// What [`FOUND`] means for each command, in the order of `--help`. Commands that never end with it are not
/// listed.
pub const FOUND_BY: [(&str, &str); 14] = [
    ("new", ""),
    ("build", "the FMU that was made does not work"),
    ("check", "from the start, a promise is not guaranteed, or the closed loop does not keep it"),
    ("identify", "the FMU failed, or what is proposed does not explain every hold"),
    ("demo", "our method missed a deadline or left the disc"),
    ("reproduce", "our method missed a deadline or left the disc"),
    ("run", "a promise was not kept, guaranteed or refused (see --require); or an FMU failed"),
    ("campaign", "a run failed and `--require success` was given; or an FMU failed"),
    ("replay", "the run differs from the recorded one"),
    ("inspect", "the FMU cannot be used"),
    ("merge", "an FMU cannot be used, or they are not equal"),
    ("validate", "the FMU has errors"),
    ("completions", ""),
    ("man", ""),
];

/// The codes of a command, each with its meaning; those of all commands if none is named.
pub fn of(command: Option<&str>) -> Vec<(u8, &'static str)> {
    let found = command.and_then(|name| FOUND_BY.iter().find(|(known, _)| *known == name));
    let own = |(code, means)| match found {
        Some((_, own)) if code == FOUND => (code, *own),
        _ => (code, means),
    };
    CODES.into_iter().map(own).filter(|(_, means)| !means.is_empty()).collect()
}

/// `program` with the codes at the end of the help of every visible command.
pub fn in_help(program: clap::Command) -> clap::Command {
    let program = FOUND_BY.iter().fold(program, |program, (name, _)| {
        program.mut_subcommand(name, |command| command.after_help(help(Some(name))))
    });
    program.after_help(help(None))
}

fn help(command: Option<&str>) -> String {
    let mut text = "Exit codes:".to_owned();
    for (code, means) in of(command) {
        // Writing to a string cannot fail.
        let _ = write!(text, "\n  {code:<3}  {means}");
    }
    text
}

/// The same as a section of a man page.
pub fn in_man(command: Option<&str>) -> String {
    let mut text = ".SH \"EXIT STATUS\"\n".to_owned();
    for (code, means) in of(command) {
        let _ = write!(text, ".TP\n\\fB{code}\\fR\n{}\n", means.replace('-', "\\-"));
    }
    text
}
