//! Terminals of FMI 3.0: what is written comes back; each defect is told.

#[path = "support/fmi3.rs"]
mod support;

use punctual_modeldescription::Place;
use punctual_modeldescription::fmi3::{LocatedTerminals, StreamMember, Terminal, TerminalMember, Terminals};
use roxmltree::Document;
use support::small3;

/// A message, and the defect that has it.
type Row = (&'static str, fn(&mut Terminals));

fn vehicle() -> Terminals {
    Terminals {
        terminals: vec![
            Terminal {
                name: "vehicle".into(),
                matching_rule: "bus".into(),
                description: "State in, input out".into(),
                members: vec![TerminalMember::signal("u", "x"), TerminalMember::signal("y", "u")],
                ..Terminal::default()
            },
            Terminal { name: "other".into(), matching_rule: "none".into(), ..Terminal::default() },
            Terminal {
                inside: Some(0),
                name: "flow".into(),
                matching_rule: "plug".into(),
                terminal_kind: "org.example.pipe".into(),
                streams: vec![StreamMember {
                    in_member_name: "h_in".into(),
                    out_member_name: "h_out".into(),
                    in_variable_name: "narrow".into(),
                    out_variable_name: "y".into(),
                }],
                ..Terminal::default()
            },
        ],
    }
}

#[test]
fn what_was_written_comes_back() {
    let xml = vehicle().to_xml(&small3()).expect("valid");
    if std::env::var_os("PUNCTUAL_UPDATE_GOLDEN").is_some() {
        std::fs::write("tests/golden/terminals.xml", &xml).expect("can be written");
    }
    assert_eq!(xml, std::fs::read_to_string("tests/golden/terminals.xml").expect("can be read"));
    let document = Document::parse(&xml).expect("well-formed");
    let read = LocatedTerminals::read(&document);
    assert_eq!(read.terminals, vehicle());
    read.check(&small3(), &mut |violation| panic!("{violation:?}"));
    for (place, text) in [
        (Place::Terminal(2), "<Terminal name=\"flow\""),
        (Place::Member(0, 1), "<TerminalMemberVariable variableName=\"y\""),
        (Place::Member(2, 0), "<TerminalStreamMemberVariable "),
    ] {
        assert!(xml[read.position(place)..].starts_with(text), "{place:?}");
    }
}

#[test]
fn each_defect_is_refused_in_its_words() {
    let rows: [Row; 9] = [
        ("terminals is empty; allowed: at least one terminal", |t| t.terminals.clear()),
        ("terminals[0].inside is 2; allowed: the position of a terminal before this one", |t| {
            t.terminals[0].inside = Some(2);
        }),
        (r#"terminals[1].matching_rule is ""; allowed: a non-empty text"#, |t| {
            t.terminals[1].matching_rule.clear();
        }),
        (r#"terminals[1]: the terminal "vehicle" is there twice on its level"#, |t| {
            t.terminals[1].name = "vehicle".into();
        }),
        (r#"terminals[0].members[1]: the terminal "vehicle" has the member "x" twice"#, |t| {
            t.terminals[0].members[1].member_name = "x".into();
        }),
        (
            r#"terminals[0].members[0]: a member of the terminal "vehicle" has no memberName; must have one, as matchingRule = bus"#,
            |t| t.terminals[0].members[0].member_name.clear(),
        ),
        (r#"terminals[0].members[0]: the terminal "vehicle" names "v"; must name a variable"#, |t| {
            t.terminals[0].members[0].variable_name = "v".into();
        }),
        (
            r#"terminals[0].members[0]: the terminal "vehicle" names "guess", which has causality = local; allowed: input, output, parameter, calculatedParameter"#,
            |t| t.terminals[0].members[0].variable_name = "guess".into(),
        ),
        (r#"terminals[2].members[0]: the terminal "flow" names "w"; must name a variable"#, |t| {
            t.terminals[2].streams[0].out_variable_name = "w".into();
        }),
    ];
    for (message, break_it) in rows {
        let mut terminals = vehicle();
        break_it(&mut terminals);
        assert_eq!(terminals.to_xml(&small3()).expect_err(message).to_string(), message);
    }
}

#[test]
fn names_may_be_used_again_on_another_level_and_members_may_be_aliases() {
    let mut terminals = vehicle();
    terminals.terminals[2].name = "vehicle".into();
    terminals.terminals[0].members[0].variable_name = "centre".into();
    terminals.to_xml(&small3()).expect("valid");
}

#[test]
fn terminals_may_lie_deep_in_each_other() {
    let depth = 500;
    let xml = format!(
        "<fmiTerminalsAndIcons fmiVersion=\"3.0\"><Terminals>{}{}</Terminals></fmiTerminalsAndIcons>",
        "<Terminal name=\"a\" matchingRule=\"none\">".repeat(depth),
        "</Terminal>".repeat(depth)
    );
    let read = LocatedTerminals::read(&Document::parse(&xml).expect("well-formed"));
    assert_eq!(read.terminals.terminals.len(), depth);
    assert_eq!(read.terminals.terminals[depth - 1].inside, Some(depth - 2));
}
