//! References resolve: links to a part of a document, and the numbers and labels of docs/theory.md.

use std::collections::BTreeSet;
use std::path::{Component, Path};

use crate::sources::TEXTS;

fn text(path: &str) -> &'static str {
    &TEXTS.iter().find(|t| t.path == path).unwrap_or_else(|| panic!("no {path}")).text
}

/// The lines of a Markdown text outside code blocks, each with its number.
fn lines(markdown: &str) -> Vec<(usize, &str)> {
    let mut inside = false;
    let mut lines = Vec::new();
    for (i, line) in markdown.lines().enumerate() {
        let fence = line.trim_start().starts_with("```");
        inside ^= fence;
        if !inside && !fence {
            lines.push((i + 1, line));
        }
    }
    lines
}

/// The text of a heading.
fn heading(line: &str) -> Option<&str> {
    let text = line.trim_start_matches('#');
    (text.len() < line.len()).then(|| text.strip_prefix(' ')).flatten()
}

/// The anchor that Markdown viewers make from a heading.
fn slug(heading: &str) -> String {
    let kept = heading.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.flat_map(char::to_lowercase).map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// The anchor that a line defines: `<a id="NAME"></a>`.
fn own_anchor(line: &str) -> Option<&str> {
    line.strip_prefix("<a id=\"")?.strip_suffix("\"></a>")
}

/// The anchors of a Markdown text: explicit ones, and those of its headings.
fn anchors(markdown: &str) -> Vec<String> {
    let of_line =
        |(_, line): &(usize, &str)| heading(line).map(slug).or_else(|| own_anchor(line).map(str::to_owned));
    lines(markdown).iter().filter_map(of_line).collect()
}

/// Numbered parts of a document: sections, statements (lemmas, theorems and propositions in one sequence) and
/// equations.
#[derive(Debug, Default, PartialEq)]
struct Numbers {
    sections: Vec<usize>,
    statements: Vec<(String, usize)>,
    equations: Vec<String>,
}

const STATEMENTS: [&str; 3] = ["lemma", "theorem", "proposition"];

/// The number that a text begins with, unless it is one of several parts, such as 3.2.2.
fn number(text: &str) -> Option<usize> {
    let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let parts =
        text[end..].strip_prefix('.').is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
    if parts { None } else { text[..end].parse().ok() }
}

/// The label in parentheses at the beginning of a text: a capital letter, or a number of at most two digits.
fn label(text: &str) -> Option<&str> {
    let (label, _) = text.strip_prefix('(')?.split_once(')')?;
    let letter = label.len() == 1 && label.bytes().all(|b| b.is_ascii_uppercase());
    let number = (1..=2).contains(&label.len()) && label.bytes().all(|b| b.is_ascii_digit());
    (letter || number).then_some(label)
}

/// The labels of the formulas in a text: `\tag{L}`.
fn tags(text: &str) -> impl Iterator<Item = &str> {
    text.split(r"\tag{").skip(1).map(|part| part.split('}').next().unwrap_or_default())
}

impl Numbers {
    /// Collects the numbers from `## 1. …`, `**Lemma 1…`, and `\tag{L}` in a formula.
    fn of(markdown: &str) -> Self {
        let equations = tags(markdown).map(str::to_owned).collect();
        let mut numbers = Self { equations, ..Self::default() };
        for (_, line) in lines(markdown) {
            numbers.sections.extend(line.strip_prefix("## ").and_then(number));
            for kind in STATEMENTS {
                let rest = line.strip_prefix("**").and_then(|line| {
                    line.get(..kind.len()).filter(|head| head.eq_ignore_ascii_case(kind))?;
                    line[kind.len()..].strip_prefix(' ')
                });
                numbers.statements.extend(rest.and_then(number).map(|number| (kind.to_owned(), number)));
            }
        }
        numbers
    }

    /// References in a text to parts that do not exist. With `loose`, labels without a word before them count
    /// too.
    fn missing(&self, text: &str, loose: bool) -> Vec<String> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let mut missing = Vec::new();
        for (i, word) in words.iter().enumerate() {
            if let Some(label) = label(word).filter(|_| loose || i == 0)
                && !self.equations.iter().any(|known| known == label)
            {
                missing.push(format!("({label})"));
            }
            let word = word.trim_start_matches(['*', '(']).to_lowercase();
            let (kind, several) = match word.strip_suffix('s') {
                Some(kind) => (kind, true),
                None => (&*word, false),
            };
            if kind != "section" && !STATEMENTS.contains(&kind) || !loose && i > 0 {
                continue;
            }
            // "sections 2 to 6 and 8": consecutive words and numbers.
            let mut referred = Vec::new();
            for next in &words[i + 1..] {
                match number(next) {
                    Some(number) => referred.push(number),
                    None if several && matches!(*next, "and" | "to") => continue,
                    None => break,
                }
                if !several {
                    break;
                }
            }
            for number in referred {
                let known = match kind {
                    "section" => self.sections.contains(&number),
                    kind => self.statements.iter().any(|(k, n)| k == kind && *n == number),
                };
                if !known {
                    missing.push(format!("{kind} {number}"));
                }
            }
        }
        missing
    }
}

fn theory() -> Numbers {
    Numbers::of(text("docs/theory.md"))
}

#[test]
fn numbers_of_the_theory_are_given_once_and_in_order() {
    let theory = theory();
    let in_order = |numbers: Vec<usize>| numbers.iter().copied().eq(1..=numbers.len());
    assert!(theory.sections.len() > 10 && in_order(theory.sections.clone()), "{:?}", theory.sections);
    let statements: Vec<_> = theory.statements.iter().map(|(_, number)| *number).collect();
    assert!(statements.len() > 10 && in_order(statements), "{:?}", theory.statements);
    let unique: BTreeSet<_> = theory.equations.iter().collect();
    assert!(unique.len() > 10 && unique.len() == theory.equations.len(), "{:?}", theory.equations);
}

#[test]
fn references_of_the_theory_to_itself_exist() {
    let document = text("docs/theory.md");
    let prose = lines(document).into_iter().filter(|(_, line)| !line.starts_with('|'));
    let prose: Vec<_> = prose.map(|(_, line)| line).collect();
    let missing = theory().missing(&prose.join("\n"), true);
    assert!(missing.is_empty(), "docs/theory.md has no {missing:?}");
}

/// "[theory](theory.md), section 12", "theory, (S)", "theory, lemma 3".
#[test]
fn references_to_the_theory_exist() {
    let theory = theory();
    let mut seen = 0;
    for text in TEXTS.iter().filter(|t| t.path != "docs/theory.md" && t.path != "tests/tidy/references.rs") {
        for (i, line) in text.text.lines().enumerate() {
            for (at, _) in line.to_ascii_lowercase().match_indices("theory") {
                let rest = &line[at + "theory".len()..];
                let rest = rest.strip_prefix(".md").unwrap_or(rest).trim_start_matches(['`', ')', ']']);
                let Some(rest) = rest.strip_prefix(", ") else { continue };
                seen += 1;
                let missing = theory.missing(rest, false);
                assert!(missing.is_empty(), "{}:{}: docs/theory.md has no {missing:?}", text.path, i + 1);
            }
        }
    }
    assert!(seen > 10, "{seen} references to docs/theory.md");
}

/// Every label in the documentation of the sources exists in docs/theory.md.
#[test]
fn labels_of_the_sources_are_those_of_the_theory() {
    let theory = theory();
    let mut seen = 0;
    for text in TEXTS.iter().filter(|t| t.path.contains("src/") && t.path.ends_with(".rs")) {
        for (i, line) in text.text.lines().enumerate().filter(|(_, line)| line.trim_start().starts_with("//"))
        {
            for label in tags(line) {
                let known = theory.equations.iter().any(|known| known == label);
                assert!(known, "{}:{}: docs/theory.md has no ({label})", text.path, i + 1);
                seen += 1;
            }
        }
    }
    assert!(seen > 0, "no formula of the sources has a label");
}

/// The path of a link from the document at `from`, relative to the root; forward slashes.
fn resolved(from: &str, target: &str) -> String {
    if target.is_empty() {
        return from.to_owned();
    }
    let mut parts = Vec::new();
    for component in Path::new(from).with_file_name(target).components() {
        match component {
            Component::ParentDir => drop(parts.pop()),
            part => parts.push(part.as_os_str().to_string_lossy().into_owned()),
        }
    }
    parts.join("/")
}

#[test]
fn links_to_a_part_of_a_document_lead_there() {
    for document in TEXTS.iter().filter(|t| t.path.ends_with(".md")) {
        for part in document.text.split("](").skip(1) {
            let target = part.split(')').next().unwrap_or_default();
            let Some((file, anchor)) = target.split_once('#').filter(|_| !target.contains("://")) else {
                continue;
            };
            let file = resolved(&document.path, file);
            let known = anchors(text(&file)).iter().any(|known| known == anchor);
            assert!(known, "{}: no #{anchor} in {file}", document.path);
        }
    }
    // Sources name a document by its path.
    for source in TEXTS.iter().filter(|t| !t.path.ends_with(".md") && t.path != "tests/tidy/references.rs") {
        for part in source.text.split("docs/").skip(1) {
            let Some((name, rest)) = part.split_once(".md#") else { continue };
            if !name.bytes().all(|b| b.is_ascii_lowercase() || b == b'-') {
                continue;
            }
            let end =
                rest.find(|c: char| !(c.is_alphanumeric() || matches!(c, '-' | '_'))).unwrap_or(rest.len());
            let (file, anchor) = (format!("docs/{name}.md"), &rest[..end]);
            let known = anchors(text(&file)).iter().any(|known| known == anchor);
            assert!(known, "{}: no #{anchor} in {file}", source.path);
        }
    }
}

#[test]
fn anchors_are_unique_and_of_use() {
    for document in TEXTS.iter().filter(|t| t.path.ends_with(".md")) {
        let all = anchors(&document.text);
        let lines = lines(&document.text);
        for pair in lines.windows(2) {
            let Some(anchor) = own_anchor(pair[0].1) else { continue };
            let path = &document.path;
            assert_eq!(all.iter().filter(|a| *a == anchor).count(), 1, "{path}: #{anchor}");
            // A heading, or one that begins a paragraph.
            let heads = heading(pair[1].1).is_some() || pair[1].1.starts_with("**");
            let link = format!("#{anchor}");
            let used = heads || TEXTS.iter().any(|t| t.text.contains(&link));
            assert!(used, "{path}: #{anchor} is at no heading, and nothing refers to it");
        }
    }
}

#[test]
fn numbers_and_references_are_found() {
    let document = "## 1. A b\n\n**Lemma 1.** If\n\n```math\ne \\ge f(T) \\tag{L}\n```\n\n**Theorem 2 (n).** x\n\
                    ```\n## 3. No\n```\n<a id=\"here\"></a>\n";
    let numbers = Numbers::of(document);
    let statements = vec![("lemma".to_owned(), 1), ("theorem".to_owned(), 2)];
    assert_eq!(numbers, Numbers { sections: vec![1], statements, equations: vec!["L".to_owned()] });
    assert_eq!(anchors(document), ["1-a-b", "here"]);
    for good in
        ["By (L), lemma 1's P and theorem 2.", "section 1: f(T), (T, x)", "theorem 3.2.2", "h(0) (683)"]
    {
        assert_eq!(numbers.missing(good, true), [""; 0], "{good}");
    }
    let wrong = "(R) and (12); Lemma 2, sections 1 to 3 and 4, *theorem 1* and proposition 7.";
    let missing = ["(R)", "(12)", "lemma 2", "section 3", "section 4", "theorem 1", "proposition 7"];
    assert_eq!(numbers.missing(wrong, true), missing);
    assert_eq!(numbers.missing("section 4, (R)", false), ["section 4"]);
    assert_eq!(resolved("docs/a.md", "../b.md"), "b.md");
    assert_eq!(resolved("docs/a.md", ""), "docs/a.md");
}
