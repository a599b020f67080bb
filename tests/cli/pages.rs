//! The tutorial and the page on obstacles: their steps are carried out, and their output is what the pages
//! show.

use crate::models::{blocks, document};
use crate::workshop::Workshop;

/// Asserts that each line of `shown` is a line of `printed`, except for trailing blanks.
#[track_caller]
fn assert_printed(shown: &str, printed: &str) {
    for line in shown.lines() {
        assert!(printed.lines().any(|said| said.trim_end() == line), "{line:?} in {printed}");
    }
}

#[test]
fn the_tutorial_is_what_happens() {
    let (workshop, text) = (Workshop::with_library(), document("tutorial.md"));
    let shown = blocks(&text, "text");
    let [backup_plan, verdicts, sooner, refused, around, never] = shown[..] else { panic!("{shown:?}") };
    let made = workshop.punctual(["new", "car.toml"]).success();
    assert!(text.contains(&format!("$ punctual new car.toml\n{made}```")), "{made}");
    let file = workshop.text("car.toml");
    let changed = |from: &str, to: &str| {
        assert_eq!(file.matches(from).count(), 1, "{from:?} in {file}");
        workshop.write("car.toml", file.replace(from, to));
    };
    let run = || workshop.punctual(["run", "car.toml"]).success();
    let check = |code| {
        let done = workshop.punctual(["check", "car.toml"]);
        assert_eq!(done.code, code, "{done:#?}");
        done
    };
    assert_printed(backup_plan, &check(0).stdout);
    assert_printed(verdicts, &run());
    assert!(workshop.path("car/car-path.svg").exists() && workshop.path("car/car-h.svg").exists());

    changed("deadline = 10.0", "deadline = 5.0");
    assert_printed(sooner, &run());
    changed("deadline = 10.0", "deadline = 4.0");
    let printed = check(1).stdout;
    assert_printed(refused, &printed);
    assert!(text.contains("3.01 s (no input within") && printed.contains("3.01 s (no input within"));
    assert_eq!(workshop.punctual(["run", "car.toml"]).code, 1, "refused and missed");
    changed("deadline = 10.0", "when_infeasible = \"earliest\"\ndeadline = 4.0");
    let printed = workshop.punctual(["run", "car.toml"]);
    assert!(
        text.contains("after 4.13 s") && printed.code == 1 && printed.stdout.contains("4.131"),
        "{printed:#?}"
    );

    let [tree, plant] = blocks(&text, "toml")[..] else { panic!("two files") };
    workshop.write("car.toml", format!("{file}\n{tree}"));
    assert_printed(around, &run());
    workshop.write("car.toml", format!("{file}\n{}", tree.replace("[29.0, 8.0]", "[25.0, 15.0]")));
    assert_printed(never, &check(1).stdout);

    let mistakes: Vec<_> = text.lines().filter_map(|line| line.strip_prefix("| `")).collect();
    for (row, right) in mistakes[mistakes.len() - 2..].iter().zip(["radius = 3.0 ", "centre = [20.0, -1.0]"])
    {
        let (written, message) = row.split_once("` for the rock | `").expect("two columns");
        changed(right, written);
        let message = message.strip_suffix("` |").expect("its end");
        workshop.punctual(["check", "car.toml"]).fails(2, &format!("car.toml: {message}"));
    }

    workshop.write("car.toml", &file);
    workshop.write("plant.toml", plant);
    for line in blocks(&text, "console").concat().lines().filter_map(|l| l.strip_prefix("$ punctual build "))
    {
        workshop.punctual(["build"].into_iter().chain(line.split(' '))).success();
    }
    workshop.punctual(["validate", "car.fmu"]).success();
    assert!(workshop.files().contains(&"plant.fmu".to_owned()));
}

/// Each file, followed by the lines that its run prints.
#[test]
fn the_page_on_obstacles_is_what_happens() {
    let (workshop, text) = (Workshop::new(), document("obstacles.md"));
    let parts: Vec<_> = text.split("```toml\n").skip(1).collect();
    assert_eq!(parts.len(), 7);
    for part in parts {
        let (file, rest) = part.split_once("```").expect("its end");
        workshop.write("my.toml", file);
        let printed = workshop.punctual(["run", "my.toml", "--signals"]);
        let shown = blocks(rest, "text").first().copied().unwrap_or_default();
        assert_eq!(printed.code, i32::from(shown.contains("not kept")), "{printed:#?}");
        assert_printed(shown, &printed.stdout);
    }
    // The two variants on the page: on their own, rows get stuck; with a hint there is a way.
    let all = blocks(&text, "toml");
    let [.., rows, hinted, _, _] = all[..] else { panic!("{all:?}") };
    workshop.write("my.toml", rows.replace("assurance = \"off\"", "assurance = \"on\""));
    workshop.punctual(["run", "my.toml", "--require", "kept"]).success();
    workshop.write("my.toml", hinted);
    workshop.punctual(["run", "my.toml", "--require", "guaranteed"]).success();
}
