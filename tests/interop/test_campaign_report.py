"""The page of `punctual campaign --report` in a real browser: it draws what the reader selects, and fits a phone."""

import re

import pytest
from browser import opened
from conftest import punctual

CAMPAIGN = """
system = "car.toml"
[campaign]
runs = 60
sampling = "sobol"
[vary."plant.x0.x_p"]
distribution = "uniform"
min = 0.0
max = 30.0
[vary."plant.x0.theta"]
distribution = "uniform"
min = -3.0
max = 3.0
[vary."filter.goal.deadline"]
distribution = "choice"
values = [4.0, 8.0, 12.0]
"""

# Operates the page like a user, and stores what it saw as attributes of the document.
PROBE = """
<script>
const root = document.documentElement, seen = root.dataset;
seen.overflow = String(root.scrollWidth - root.clientWidth);
const place = document.querySelector('[data-chart="runs"]');
const marks = () => [...place.querySelectorAll("g path.curve")].map((path) => path.getAttribute("d"));
const count = () => marks().map((d) => d.split("M").length - 1).reduce((a, b) => a + b, 0);
const axis = () => [...place.querySelectorAll("text")].map((text) => text.textContent).join("|");
seen.marks = String(count());
const before = marks().join();
const across = document.getElementById("across");
seen.choices = String(across.options.length);
across.value = String((Number(across.value) + 1) % across.options.length);
across.dispatchEvent(new Event("change"));
seen.changed = String(marks().join() !== before);
seen.named = String(axis().includes(across.selectedOptions[0].textContent));
seen.charts = String(place.querySelectorAll("svg").length);
// A click on the first mark.
const svg = place.querySelector("svg"), box = svg.getBoundingClientRect(), view = svg.viewBox.baseVal;
const [x, y] = marks().find((d) => d).slice(1).split(/[hl]/)[0].split(" ").map(Number);
const at = { bubbles: true, clientX: box.left + (x / view.width) * box.width, clientY: box.top + (y / view.height) * box.height };
seen.hidden = String(document.getElementById("again").hidden);
svg.dispatchEvent(new MouseEvent("click", at));
seen.again = document.getElementById("again").textContent;
svg.dispatchEvent(new PointerEvent("pointermove", { ...at, pointerId: 1, pointerType: "mouse" }));
seen.read = place.querySelector("output").textContent;
// The rate by cell, with the number of runs.
const how = document.getElementById("how");
how.value = "1";
how.dispatchEvent(new Event("change"));
seen.cells = String(place.querySelectorAll("rect.cell").length);
seen.counted = [...place.querySelectorAll("g text")].map((text) => text.textContent).filter((words) => words.startsWith("of ")).join("|");
how.value = "0";
how.dispatchEvent(new Event("change"));
seen.back = String(place.querySelectorAll("rect.cell").length);
const bars = document.querySelector('[data-chart="arrivals"]');
seen.bars = String(bars.querySelectorAll("g path.curve").length);
seen.filled = getComputedStyle(bars.querySelector("g path.curve")).fill;
</script>
"""


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """The folder with the page of a campaign that starts from the file of `punctual new`."""
    folder = tmp_path_factory.mktemp("campaign")
    punctual("new", "car.toml", cwd=folder)
    car = (folder / "car.toml").read_text()
    # Without plans a run takes milliseconds.
    (folder / "car.toml").write_text('assurance = "off"\n' + car)
    (folder / "many.toml").write_text(CAMPAIGN)
    punctual("campaign", "many.toml", "--report", cwd=folder)
    return folder


@pytest.mark.parametrize("width", [1200, 390])
def test_the_reader_chooses_what_runs_are_drawn_over(campaign, width, tmp_path):
    page = (campaign / "many.html").read_text()
    seen, _, said = opened(page, PROBE, width, tmp_path)
    assert "CONSOLE" not in said, said
    assert seen["ready"] == "yes"
    # Wide tables scroll by themselves; the page does not.
    assert int(seen["overflow"]) <= 0
    assert int(seen["marks"]) == 60
    assert int(seen["choices"]) > 3
    assert (seen["changed"], seen["named"], seen["charts"]) == ("true", "true", "1")
    # The command that it shows repeats this run, with the row as it was recorded.
    assert seen["hidden"] == "true"
    run = re.fullmatch(r"punctual replay many[.]parquet --run (\d+) --out out", seen["again"])[1]
    assert seen["read"].startswith(f"run {run}, ")
    done = punctual(*seen["again"].split()[1:], cwd=campaign)
    assert "the row is as recorded, bit for bit" in done.stdout
    assert 1 < int(seen["cells"]) <= 9 and seen["back"] == "0"
    if width > 1000:
        # Every cell is large enough for its count.
        counts = [int(words.removeprefix("of ")) for words in seen["counted"].split("|")]
        assert (len(counts), sum(counts)) == (int(seen["cells"]), 60)
    assert int(seen["bars"]) >= 1
    assert seen["filled"].startswith("rgb")
