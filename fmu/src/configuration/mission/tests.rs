//! Every refusal with its message, known normal forms, and the meaning of a formula before and after.

use super::syntax::{MAX_NESTING, Node, Tree, parse};
use super::tasks::{MAX_ALTERNATIVES, MAX_TASKS};
use super::*;

/// Missions with the texts of their normal forms, which another test gives to rtamt.
const MISSIONS: &str = include_str!("../../../../tests/data/missions.txt");

fn mission(text: &str) -> Mission {
    Mission::parse(text).unwrap_or_else(|e| panic!("{text}: {e}"))
}

fn tree(text: &str) -> Tree {
    parse(text).unwrap_or_else(|e| panic!("{text}: {e}"))
}

fn literal(text: &str) -> Literal {
    Literal { region: text.trim_start_matches('!').to_owned(), negated: text.starts_with('!') }
}

fn keep(what: &str, during: Option<[f64; 2]>) -> Task {
    Task::Keep { what: vec![literal(what)], during }
}

fn visit(what: &str, window: [f64; 2], stay: Option<f64>, after: Option<usize>) -> Task {
    Task::Visit { what: vec![literal(what)], window, stay, after }
}

/// The tree as text, with every operand of an operator in parentheses.
fn shown(tree: &Tree) -> String {
    let times = |times: Option<[f64; 2]>| times.map_or_else(String::new, interval);
    let joined =
        |all: &[Tree], sign: &str| format!("({})", all.iter().map(shown).collect::<Vec<_>>().join(sign));
    match &tree.node {
        Node::Name(name) => name.clone(),
        Node::Not(a) => format!("(!{})", shown(a)),
        Node::And(all) => joined(all, "&"),
        Node::Or(all) => joined(all, "|"),
        Node::Always(t, a) => format!("(G{} {})", times(*t), shown(a)),
        Node::Eventually(t, a) => format!("(F{} {})", times(*t), shown(a)),
        Node::Until(t, pair) => format!("({} U{} {})", shown(&pair[0]), times(*t), shown(&pair[1])),
    }
}

/// The trees that rtamt 0.4.10 has of these texts.
#[test]
fn operators_bind_as_in_rtamt() {
    for (text, wanted) in [
        ("G A & B", "((G A)&B)"),
        ("G[0,5] A U[0,5] B", "((G[0,5] A) U[0,5] B)"),
        ("A & B U[0,5] C", "(A&(B U[0,5] C))"),
        ("A | B & C U[1:2] D", "(A|(B&(C U[1,2] D)))"),
        ("!A U[0,5] B", "((!A) U[0,5] B)"),
        ("A U[0,5] B U[0,7] C", "((A U[0,5] B) U[0,7] C)"),
        ("A U[0,5] F[0,1] C & D", "((A U[0,5] (F[0,1] C))&D)"),
        ("F[0,5] !A & B", "((F[0,5] (!A))&B)"),
        ("not A and B or C", "(((!A)&B)|C)"),
        ("eventually[0:5]always[0:1]A", "(F[0,5] (G[0,1] A))"),
        ("G(A)and(B)", "((G A)&B)"),
        ("F [0,5] A", "(F[0,5] A)"),
        ("!!A", "(!(!A))"),
        ("GA | notA | F_ | U1", "(GA|notA|F_|U1)"),
        ("F[.5,5.] A", "(F[0.5,5] A)"),
        ("F[1e0,1.5e+1] A", "(F[1,15] A)"),
        ("F[0,05.5] A", "(F[0,5.5] A)"),
        ("F[1ms,2s] A", "(F[0.001,2] A)"),
        ("F[1,2 ms] A", "(F[0.001,0.002] A)"),
        ("F[0,1e2s] A", "(F[0,100] A)"),
        ("F[0,1e-7] A", "(F[0,1e-7] A)"),
        ("F[0,1e300] A", "(F[0,1e300] A)"),
        ("A\n\t&\r\n\u{c}B", "(A&B)"),
    ] {
        assert_eq!(shown(&tree(text)), wanted, "{text}");
    }
}

#[test]
fn missions_have_their_normal_forms() {
    let lines = MISSIONS.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
    let mut seen = 0;
    for line in lines {
        let (text, wanted) = line.split_once(" => ").unwrap_or_else(|| panic!("no => in {line}"));
        let found = mission(text);
        assert_eq!(found.to_string(), wanted);
        assert_eq!(mission(wanted), found);
        seen += 1;
    }
    assert!(seen > 40, "{seen}");
}

#[test]
fn tasks_and_groups_are_as_the_text_says() {
    let found =
        mission("F[0,5] G[1,3] A & (G !C | F[0,5] (A & F[0,7] G B)) & D U[0,9] A & (F[0,2] A | G[1,2] C)");
    let wanted = Mission {
        tasks: vec![
            visit("A", [1.0, 6.0], Some(2.0), None),
            keep("!C", None),
            visit("A", [0.0, 5.0], Some(0.0), None),
            visit("B", [0.0, 7.0], None, Some(2)),
            visit("A", [0.0, 9.0], Some(0.0), None),
            Task::KeepUntil { what: vec![literal("D")], visit: 4 },
            visit("A", [0.0, 2.0], Some(0.0), None),
            keep("C", Some([1.0, 2.0])),
        ],
        groups: vec![vec![vec![1], vec![2, 3]], vec![vec![6], vec![7]]],
    };
    assert_eq!(found, wanted);
    assert_eq!(found.required(), [0, 4, 5]);
    assert_eq!(found.regions(), ["A", "C", "B", "D"]);
    // A task of several alternatives is one task; the same in another choice, or always to be done, is another.
    let found = mission("G A & (G B & (G A | G C) | G A) & (G A | G D)");
    let [a, b, c, d] = ["A", "B", "C", "D"].map(|name| keep(name, None));
    assert_eq!(found.tasks, [a.clone(), b, a.clone(), c, a, d]);
    assert_eq!(found.groups, [vec![vec![1, 2], vec![1, 3], vec![2]], vec![vec![4], vec![5]]]);
}

fn refusal(text: &str) -> String {
    match Mission::parse(text) {
        Ok(mission) => panic!("{text:?} was taken: {mission:?}"),
        Err(error) => {
            assert_eq!(error.field(), "mission");
            error.message().to_owned()
        }
    }
}

const AFTER: &str = "must be &, |, U or the end";
const OPERAND: &str = "must be a name, G, F, ! or \"(\"";

#[test]
fn what_is_no_formula_is_told_with_its_position() {
    for (text, wanted) in [
        ("G A B", format!("at character 5 of \"G A B\" is \"B\", {AFTER}; the operators are G, F, U, &, | and !")),
        ("G A & & B", format!("at character 7 of \"G A & & B\" is \"&\", {OPERAND}")),
        ("G A && B", format!("at character 5 of \"G A && B\" is \"&&\", {AFTER}; both is written &")),
        ("G A &", format!("at character 6 of \"G A &\" is its end, {OPERAND}")),
        ("(G A", "at character 5 of \"(G A\" is its end, must be &, |, U or \")\"".to_owned()),
        ("G A)", format!("at character 4 of \"G A)\" is \")\", {AFTER}")),
        (
            "U[0,1] A",
            format!(
                "at character 1 of \"U[0,1] A\" is \"U\", {OPERAND}; A U[0,10] B needs both: what is kept, and what is \
                 visited"
            ),
        ),
        ("g[0,1] A", format!("at character 2 of \"g[0,1] A\" is \"[\", {AFTER}; an interval stands behind G, F or U")),
        (
            "F[0,5) A",
            "at character 6 of \"F[0,5) A\" is \")\", must be a unit or \"]\"; an interval contains both its ends"
                .to_owned(),
        ),
        ("F[0 5] A", "at character 5 of \"F[0 5] A\" is \"5\", must be a unit, \",\" or \":\"".to_owned()),
        (
            "F[-1,5] A",
            "at character 3 of \"F[-1,5] A\" is \"-\", must be a number in s; times count from the start, or from the \
             visit before, and are not negative"
                .to_owned(),
        ),
        (
            "G[0,inf] A",
            "at character 5 of \"G[0,inf] A\" is \"inf\", must be a number in s; for ever is written without an \
             interval: G A, or F[0,10] G A"
                .to_owned(),
        ),
        (
            "F[0,5min] A",
            "at character 6 of \"F[0,5min] A\" is \"min\", must be a unit or \"]\"; a time is a decimal number, its unit \
             s, ms or none"
                .to_owned(),
        ),
        (
            "F[0,05] A",
            "at character 5 of \"F[0,05] A\" is \"05\", must be a number in s; a whole number has no 0 before it"
                .to_owned(),
        ),
        ("F[1s,2] A", "\"[1s,2]\" has a unit at its first time only, must have one at both, or at the last".to_owned()),
        ("F[3,2] A", "\"[3,2]\" ends before it begins, must have the smaller time first".to_owned()),
        ("F[2s,500ms] A", "\"[2s,500ms]\" ends before it begins, must have the smaller time first".to_owned()),
        ("F[0,1e999] A", "\"[0,1e999]\" has a time that is too large, must have finite ones".to_owned()),
        (
            "F[1e308,1e308] G[1e308,1e308] A",
            "\"F[1e308,1e308] G[1e308,1e308] A\" has a time that is too large, must have finite ones".to_owned(),
        ),
        ("", "is empty, must say what to do, such as F[0,10] A: to be in A within 10 s".to_owned()),
        (" \n", "is empty, must say what to do, such as F[0,10] A: to be in A within 10 s".to_owned()),
        (
            "G \u{e4}",
            format!("at character 3 of \"G \u{e4}\" is \"\u{e4}\", {OPERAND}; names have ASCII letters only"),
        ),
        ("G A $", format!("at character 5 of \"G A $\" is \"$\", {AFTER}")),
    ] {
        assert_eq!(refusal(text), wanted, "{text}");
    }
    let long = refusal(&format!("{} G", "G A & ".repeat(100)));
    assert_eq!(
        long,
        format!(
            "at character 603 of \"G A & G A & G A & G A & G A & G A & G A ... G A & G A & G A & G\" is its end, {OPERAND}"
        )
    );
}

/// Operators of rtamt, and notations of other languages.
#[test]
fn operators_of_no_mission_are_answered() {
    for (text, wanted) in [
        ("A -> B", "a mission does not depend on what happens"),
        ("A implies B", "a mission does not depend on what happens"),
        ("A => B", "a mission does not depend on what happens"),
        ("A <-> B", "write the alternatives"),
        ("A iff B", "write the alternatives"),
        ("A xor B", "write the alternatives"),
        ("X A", "times are in s and do not count samples"),
        ("next A", "times are in s and do not count samples"),
        ("once A", "a mission begins when the filter does and has no past"),
        ("historically[0,1] A", "a mission begins when the filter does and has no past"),
        ("A since B", "a mission begins when the filter does and has no past"),
        ("A S[0,1] B", "a mission begins when the filter does and has no past"),
        ("Y A", "a mission begins when the filter does and has no past"),
        ("rise(A)", "a mission says where to be and not what to cross"),
        ("A unless[0,5] B", "it is written with G and U: G[0,10] A | A U[0,10] B"),
        ("G (A >= 0)", "a name alone stands for h >= 0 of its region"),
        ("A == B", "a name alone stands for h >= 0 of its region"),
        ("G abs(A)", "nothing is computed in a mission"),
        ("G (A + B)", "nothing is computed in a mission"),
        ("G true", "it is no region; leave it out"),
        ("G s", "the word has a meaning in the language of formulas; give the region another name"),
        ("G A // B", "a mission has no comments"),
        ("G A; G B", "a mission is one formula; join several by &"),
        ("G A || G B", "either is written |"),
        ("G ~A", "not is written !"),
        ("\u{25a1}A", "always is written G"),
        ("<>A", "eventually is written F"),
        ("[]A", "always is written G, without an interval"),
        ("G A \u{2227} G B", "both is written &"),
        ("G a.b", "a name has letters, digits and underscores only"),
    ] {
        let message = refusal(text);
        let advice = message.split_once("must be").expect("what is wanted").1.split_once("; ");
        let advice = advice.map_or("", |found| found.1);
        assert!(advice.starts_with(wanted), "{text}: {message}");
    }
}

#[test]
fn formulas_that_are_no_missions_are_refused_with_the_remedy() {
    const BINDING: &str = "G, F and ! bind more tightly than U, & and |, so G A & B is (G A) & B";
    let alone = |part: &str| {
        format!(
            "\"{part}\" stands without G, F or U and so would hold at the start only, must be G {part} to be kept, or \
             G[0,0] {part} if that is meant; {BINDING}"
        )
    };
    for (text, wanted) in [
        ("A", alone("A")),
        ("!C", alone("!C")),
        ("G A & B", alone("B")),
        ("F[0,5] A | (B & C)", alone("B")),
        ("F A", "\"F A\" has no deadline, must have one, such as F[0,10] A".to_owned()),
        ("A U B", "\"A U B\" has no deadline, must have one, such as A U[0,10] B".to_owned()),
        (
            "F[0,5] (A & F B)",
            "\"F B\" has no deadline, must have one, such as F[0,10] A".to_owned(),
        ),
        (
            "G[0,9] F[0,5] A",
            "\"G[0,9] F[0,5] A\" asks for a visit again and again, must have an end; write each visit, such as \
             F[0,10] A & F[10,20] A"
                .to_owned(),
        ),
        (
            "G F[0,5] G A",
            "\"G F[0,5] G A\" asks for a visit again and again, must have an end; write each visit, such as \
             F[0,10] A & F[10,20] A"
                .to_owned(),
        ),
        ("G[1,2] G[3,4] A", "\"G[1,2] G[3,4] A\" has G within G, must have one: G[4,6]".to_owned()),
        ("G G[3,4] A", "\"G G[3,4] A\" has G within G, must have one: G A".to_owned()),
        ("F[1,2] F[3,4] A", "\"F[1,2] F[3,4] A\" has F within F, must have one: F[4,6]".to_owned()),
        ("F[1,2] F A", "\"F A\" has no deadline, must be one F with one".to_owned()),
        (
            "G (A | B)",
            "\"G (A | B)\" has the alternatives \"(A | B)\" within, must have | between tasks instead, such as G A | G B, of which one is kept all the time".to_owned(),
        ),
        (
            "F[0,5] (A | B & C)",
            "\"F[0,5] (A | B & C)\" has the alternatives \"(A | B & C)\" within, must have | between tasks instead, such as \
             F[0,5] A | F[0,5] (B & C)"
                .to_owned(),
        ),
        (
            "(A | B) U[0,5] C",
            "\"(A | B) U[0,5] C\" has the alternatives \"(A | B)\" within, must have | between tasks instead, such as \
             A U[0,10] C | B U[0,10] C"
                .to_owned(),
        ),
        (
            "F[0,5] (A & (B | C))",
            "\"F[0,5] (A & (B | C))\" has the alternatives \"(B | C)\" within, must have | between tasks instead, such as \
             F[0,10] A | F[0,10] B"
                .to_owned(),
        ),
        (
            "F[0,5] !C",
            "\"F[0,5] !C\" has only outsides to visit, must name a region to be in; to keep out of one is G[0,5] !C"
                .to_owned(),
        ),
        (
            "A U[1,5] !C",
            "\"A U[1,5] !C\" has only outsides to visit, must name a region to be in; to keep out of one is G[1,5] !C"
                .to_owned(),
        ),
        (
            "!F[0,5] A",
            "\"!F[0,5] A\" negates more than a name, must have ! before names only; !F[0,10] A is G[0,10] !A".to_owned(),
        ),
        (
            "G !(A | B)",
            "\"!(A | B)\" negates more than a name, must have ! before names only; !(A | B) is !A & !B".to_owned(),
        ),
        (
            "!(G A & G B)",
            "\"!(G A & G B)\" negates more than a name, must have ! before names only; !(A & B) is !A | !B".to_owned(),
        ),
        ("G !!A", "\"!!A\" negates twice, must be written without both".to_owned()),
        (
            "!G A",
            "\"!G A\" negates more than a name, must have ! before names only; write what is to be done instead".to_owned(),
        ),
        (
            "F[0,5] (A & F[0,7] B & F[0,7] C)",
            "\"F[0,5] (A & F[0,7] B & F[0,7] C)\" has two visits that follow the same, must have one after the other, such \
             as F[0,10] (A & F[0,10] (B & F[0,10] C))"
                .to_owned(),
        ),
        (
            "F[0,5] (A & G[0,1] B)",
            "\"F[0,5] (A & G[0,1] B)\" has \"G[0,1] B\" beside other conditions within F, must have names and at most one \
             F there; F[0,10] G[0,5] (A & B) visits both and stays, and G B is a task of its own"
                .to_owned(),
        ),
        (
            "F[0,5] (A U[0,5] B)",
            "\"F[0,5] (A U[0,5] B)\" has U within F, must have names there; each U is a task that begins at 0".to_owned(),
        ),
        (
            "F[0,5] (A & A U[0,5] B)",
            "\"F[0,5] (A & A U[0,5] B)\" has U within F, must have names there; each U is a task that begins at 0".to_owned(),
        ),
        (
            "G (A U[0,5] B)",
            "\"G (A U[0,5] B)\" has U within G, must have names there; each U is a task that begins at 0".to_owned(),
        ),
        (
            "F[0,5] G (A & F[0,1] B)",
            "\"G (A & F[0,1] B)\" asks for a visit again and again, must have an end; write each visit, such as \
             F[0,10] A & F[10,20] A"
                .to_owned(),
        ),
        (
            "A U[0,5] G B",
            "\"A U[0,5] G B\" has an operator beside U, must have names there, such as A U[0,10] B; what else is to be \
             done is joined by &"
                .to_owned(),
        ),
        (
            "G A U[0,5] B",
            "\"G A U[0,5] B\" has an operator beside U, must have names there, such as A U[0,10] B; what else is to be \
             done is joined by &"
                .to_owned(),
        ),
    ] {
        assert_eq!(refusal(text), wanted, "{text}");
    }
}

#[test]
fn what_would_recurse_deeply_or_grow_is_refused() {
    let deep = |n: usize| format!("{}G A{}", "(".repeat(n), ")".repeat(n));
    assert!(Mission::parse(&deep(MAX_NESTING - 1)).is_ok());
    let nests = "nests more than 64 operators and parentheses at character";
    for text in [
        deep(MAX_NESTING),
        deep(4000),
        "(".repeat(16_000),
        "!".repeat(16_000),
        "G ".repeat(8000),
        format!("A{}", " U[0,1] A".repeat(1000)),
        "F[0,1](A&".repeat(1000),
    ] {
        let message = refusal(&text);
        assert!(message.starts_with(nests), "{message}");
    }
    assert_eq!(refusal(&"A".repeat(16_385)), "has 16385 bytes, must have at most 16384");
    let sum = |n: usize| (0..n).map(|i| format!("G A{i}")).collect::<Vec<_>>();
    assert_eq!(mission(&sum(MAX_TASKS).join("&")).tasks.len(), MAX_TASKS);
    assert_eq!(refusal(&sum(MAX_TASKS + 1).join("&")), "has 257 tasks, must have at most 256");
    assert_eq!(mission(&sum(MAX_ALTERNATIVES).join("|")).groups[0].len(), MAX_ALTERNATIVES);
    let many = |count: &str| {
        format!(
            "has a choice of {count} alternatives, must have at most 64; join choices that do not depend on each other by & \
             outside of any |"
        )
    };
    assert_eq!(refusal(&sum(MAX_ALTERNATIVES + 1).join("|")), many("65"));
    let pair = "(G A | G B)";
    assert_eq!(refusal(&format!("{} | G C", [pair; 6].join("&"))), many("65"));
    assert_eq!(refusal(&format!("{} | G C", [pair; 100].join("&"))), many("more than 1000000"));
    // Beside each other, and not within one another, choices do not multiply.
    assert_eq!(mission(&[pair; 100].join("&")).groups.len(), 100);
    let long = format!("({}) & ({pair} & {pair} & {pair} & {pair}) | G C", sum(200).join("&"));
    let written = "bytes with its alternatives written out, must have at most 16384";
    assert!(refusal(&long).ends_with(written), "{}", refusal(&long));
}

/// Pseudorandom numbers, by SplitMix64.
struct Random(u64);

impl Random {
    /// A whole number below `bound`.
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as usize % bound
    }

    fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }
}

/// No text makes the parser panic, and what it takes is read back from its own text.
#[test]
fn no_text_causes_a_panic() {
    const PIECES: [&str; 46] = [
        "G",
        "F",
        "U",
        "always",
        "until",
        "and",
        "or",
        "not",
        "!",
        "&",
        "|",
        "(",
        ")",
        "[",
        "]",
        ",",
        ":",
        "0",
        "1",
        "2.5",
        "1e3",
        "1e400",
        ".5",
        "ms",
        "s",
        "A",
        "B",
        "C1",
        " ",
        "\n",
        "[0,5]",
        "[1,2]",
        "->",
        "xor",
        "\u{e4}",
        "$",
        "\u{0}",
        "G A",
        "F[0,5] ",
        "F[0,5] (A & ",
        "A U[0,1] B",
        "!C",
        "G[0,1] ",
        "-",
        "\"",
        "\u{1f600}",
    ];
    let mut random = Random(1);
    let mut taken = 0;
    for _ in 0..200_000 {
        let count = random.below(14);
        let text: String = (0..count).map(|_| random.pick(&PIECES)).collect();
        if let Ok(found) = Mission::parse(&text) {
            taken += 1;
            assert_eq!(Mission::parse(&found.to_string()), Ok(found), "{text:?}");
        }
    }
    assert!(taken > 1000, "{taken}");
    for _ in 0..20_000 {
        let (count, bound) = (random.below(40), random.pick(&[0x80, 0x500, 0x11_0000]));
        let text: String = (0..count).filter_map(|_| char::from_u32(random.below(bound) as u32)).collect();
        // Whether it is taken is not the question.
        let _ = Mission::parse(&text);
    }
}

/// The time between samples in s; times of random formulas are multiples of it.
const STEP: f64 = 0.5;

/// Samples of each trace; the last one holds for ever.
const SAMPLES: usize = 24;

const REGIONS: [&str; 4] = ["A", "B", "C", "D"];

/// Whether the state is in each region, at each sample.
type Trace = [[bool; SAMPLES]; REGIONS.len()];

fn trace(random: &mut Random) -> Trace {
    [(); REGIONS.len()].map(|()| {
        let (mut inside, change) = (random.below(3) > 0, random.pick(&[3, 6, 12, 24]));
        [(); SAMPLES].map(|()| {
            inside ^= random.below(change) == 0;
            inside
        })
    })
}

fn is_in(trace: &Trace, region: &str, sample: usize) -> bool {
    let region = REGIONS.iter().position(|name| *name == region).expect("a region");
    trace[region][sample.min(SAMPLES - 1)]
}

/// The samples of an interval that begins at a sample; from there for ever, which the last sample ends.
fn samples(from: usize, interval: Option<[f64; 2]>) -> std::ops::RangeInclusive<usize> {
    let count = |time: f64| (time / STEP) as usize;
    match interval {
        Some([first, last]) => from + count(first)..=from + count(last),
        None => from..=from.max(SAMPLES - 1),
    }
}

/// Whether the formula holds from a sample on, by the definition of its operators.
fn holds(tree: &Tree, trace: &Trace, at: usize) -> bool {
    match &tree.node {
        Node::Name(name) => is_in(trace, name, at),
        Node::Not(a) => !holds(a, trace, at),
        Node::And(all) => all.iter().all(|a| holds(a, trace, at)),
        Node::Or(all) => all.iter().any(|a| holds(a, trace, at)),
        Node::Always(during, a) => samples(at, *during).all(|k| holds(a, trace, k)),
        Node::Eventually(during, a) => samples(at, *during).any(|k| holds(a, trace, k)),
        Node::Until(during, pair) => samples(at, *during)
            .any(|k| holds(&pair[1], trace, k) && (at..k).all(|k| holds(&pair[0], trace, k))),
    }
}

/// Whether the conditions hold at a sample.
fn hold(what: &[Literal], trace: &Trace, at: usize) -> bool {
    what.iter().all(|literal| is_in(trace, &literal.region, at) != literal.negated)
}

/// Whether a visit can be made, counted from a sample, with all that refers to it.
fn can_visit(mission: &Mission, visit: usize, trace: &Trace, from: usize) -> bool {
    let Task::Visit { what, window, stay, .. } = &mission.tasks[visit] else { panic!("{visit} is no visit") };
    samples(from, Some(*window)).any(|k| {
        let stays = samples(k, stay.map(|stay| [0.0, stay])).all(|k| hold(what, trace, k));
        let others = mission.tasks.iter().enumerate().all(|(i, other)| match other {
            Task::Visit { after, .. } if *after == Some(visit) => can_visit(mission, i, trace, k),
            Task::KeepUntil { what, visit: until } if *until == visit => (0..k).all(|k| hold(what, trace, k)),
            _ => true,
        });
        stays && others
    })
}

/// Whether a mission is accomplished, by what its documentation says.
fn is_accomplished(mission: &Mission, trace: &Trace) -> bool {
    let is_done = |task: &usize| match &mission.tasks[*task] {
        Task::Keep { what, during } => samples(0, *during).all(|k| hold(what, trace, k)),
        Task::Visit { after: None, .. } => can_visit(mission, *task, trace, 0),
        // With what they refer to.
        Task::Visit { .. } | Task::KeepUntil { .. } => true,
    };
    let any = |group: &Vec<Vec<usize>>| group.iter().any(|alternative| alternative.iter().all(is_done));
    mission.required().iter().all(is_done) && mission.groups.iter().all(any)
}

/// A random mission, written with parentheses around everything and with as few as possible.
struct Written {
    full: String,
    sparse: String,
    /// How tightly the outermost operator of `sparse` binds.
    power: usize,
}

impl Written {
    const OR: usize = 0;
    const AND: usize = 1;
    const UNTIL: usize = 2;
    const PREFIX: usize = 3;

    /// As an operand where at least `power` is needed.
    fn operand(&self, power: usize) -> String {
        if self.power < power { format!("({})", self.sparse) } else { self.sparse.clone() }
    }

    fn joined(all: &[Self], sign: &str, power: usize) -> Self {
        if let [one] = all {
            return Self { full: one.full.clone(), sparse: one.sparse.clone(), power: one.power };
        }
        let full: Vec<_> = all.iter().map(|one| one.full.as_str()).collect();
        // An operator of equal power as an operand would join the others.
        let sparse: Vec<_> = all.iter().map(|one| one.operand(power + 1)).collect();
        let sign = format!(" {sign} ");
        Self { full: format!("({})", full.join(&sign)), sparse: sparse.join(&sign), power }
    }

    fn prefixed(operator: &str, operand: &Self) -> Self {
        Self {
            full: format!("({operator} {})", operand.full),
            sparse: format!("{operator} {}", operand.operand(Self::PREFIX)),
            power: Self::PREFIX,
        }
    }

    fn literal(random: &mut Random, negations: bool) -> Self {
        let name = random.pick(&REGIONS);
        let text = if negations && random.below(3) == 0 { format!("!{name}") } else { name.to_owned() };
        let power = Self::PREFIX;
        Self { full: format!("({text})"), sparse: text, power }
    }

    /// Conditions, the first a name, or all of any kind.
    fn conditions(random: &mut Random, is_goal: bool) -> Self {
        let mut all = vec![Self::literal(random, !is_goal)];
        while random.below(3) == 0 {
            all.push(Self::literal(random, true));
        }
        Self::joined(&all, "&", Self::AND)
    }

    fn interval(random: &mut Random) -> String {
        let first = random.below(6);
        let last = first + random.below(9);
        let time = |count: usize, random: &mut Random| match random.below(3) {
            0 => format!("{}ms", count * 500),
            1 => format!("{:?}s", count as f64 * STEP),
            _ => format!("{}.{}s", count / 2, count % 2 * 5),
        };
        format!("[{}{}{}]", time(first, random), random.pick(&[",", ":", " , "]), time(last, random))
    }

    fn visit(random: &mut Random, depth: usize) -> Self {
        let operator = random.pick(&["F", "eventually"]).to_owned() + &Self::interval(random);
        let inside = match random.below(4) {
            0 => Self::prefixed("G", &Self::conditions(random, true)),
            1 => Self::prefixed(&format!("G{}", Self::interval(random)), &Self::conditions(random, true)),
            2 if depth < 3 => {
                let mut all = vec![Self::conditions(random, true), Self::visit(random, depth + 1)];
                let turn = random.below(2);
                all.rotate_left(turn);
                Self::joined(&all, "&", Self::AND)
            }
            _ => Self::conditions(random, true),
        };
        Self::prefixed(&operator, &inside)
    }

    fn task(random: &mut Random) -> Self {
        match random.below(5) {
            0 => Self::prefixed("G", &Self::conditions(random, false)),
            1 => {
                let operator = format!("G{}", Self::interval(random));
                Self::prefixed(&operator, &Self::conditions(random, false))
            }
            2 => {
                let operator = random.pick(&["U", "until"]).to_owned() + &Self::interval(random);
                let [left, right] = [false, true].map(|is_goal| Self::conditions(random, is_goal));
                Self {
                    full: format!("({} {operator} {})", left.full, right.full),
                    sparse: format!(
                        "{} {operator} {}",
                        left.operand(Self::PREFIX),
                        right.operand(Self::PREFIX)
                    ),
                    power: Self::UNTIL,
                }
            }
            _ => Self::visit(random, 0),
        }
    }

    fn mission(random: &mut Random, depth: usize) -> Self {
        if depth >= 4 || random.below(3) == 0 {
            return Self::task(random);
        }
        let all: Vec<_> = (0..2 + random.below(2)).map(|_| Self::mission(random, depth + 1)).collect();
        match random.below(2) {
            0 => Self::joined(&all, random.pick(&["&", "and"]), Self::AND),
            _ => Self::joined(&all, random.pick(&["|", "or"]), Self::OR),
        }
    }
}

/// By the definition of the operators on the tree of the text, and by the meaning of tasks and groups.
#[test]
fn the_normal_form_means_what_the_formula_says() {
    let mut random = Random(2);
    let (mut missions, mut accomplished, mut traces, mut many) = (0, 0, 0, 0);
    let mut noticed = 0;
    for _ in 0..4000 {
        let written = Written::mission(&mut random, 0);
        let (sparse, full) = (tree(&written.sparse), tree(&written.full));
        assert_eq!(shown(&sparse), shown(&full), "{} is {}", written.sparse, written.full);
        let found = match Mission::parse(&written.sparse) {
            Ok(found) => found,
            Err(e) => {
                assert!(e.message().contains("alternatives"), "{}: {e}", written.sparse);
                many += 1;
                continue;
            }
        };
        assert_eq!(mission(&written.full), found);
        assert_eq!(mission(&found.to_string()), found);
        missions += 1;
        // With one window begun later, what must not remain unnoticed each time.
        let mut wrong = found.clone();
        if let Some(Task::Visit { window, .. }) =
            wrong.tasks.iter_mut().find(|task| matches!(task, Task::Visit { .. }))
        {
            *window = window.map(|time| time + 4.0 * STEP);
        }
        let mut differs = false;
        for _ in 0..30 {
            let trace = trace(&mut random);
            let is = is_accomplished(&found, &trace);
            assert_eq!(is, holds(&sparse, &trace, 0), "{} as {found:?} on {trace:?}", written.sparse);
            differs |= is_accomplished(&wrong, &trace) != is;
            accomplished += usize::from(is);
            traces += 1;
        }
        noticed += usize::from(differs);
    }
    assert!(missions > 3000, "{missions}, and {many} with too many alternatives");
    // Neither is an exception.
    assert!(accomplished > traces / 10 && accomplished < traces * 9 / 10, "{accomplished} of {traces}");
    assert!(noticed > missions / 10, "{noticed} of {missions}");
}
