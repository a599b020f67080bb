"""The page of `punctual run --report` in a real browser: it plays, follows its slider, and fits a phone."""

import re

import pytest
from browser import opened
from conftest import ROOT, punctual

# Operates the page like a user, and stores what it saw as attributes of the document.
PROBE = """
<script>
const root = document.documentElement, seen = root.dataset;
seen.overflow = String(root.scrollWidth - root.clientWidth);
const slider = document.getElementById("time");
const where = () => [...document.querySelectorAll(".vehicle")].map((v) => v.getAttribute("transform")).join(";");
const trail = () => document.querySelector(".trail")?.getAttribute("d").length ?? 0;
const lines = () => [...document.querySelectorAll("line.now")].map((l) => Number(l.getAttribute("x1")).toFixed(2));
const state = (name) => {
  seen[name + "where"] = where(); seen[name + "trail"] = String(trail()); seen[name + "lines"] = lines().join(" ");
  seen[name + "goal"] = document.querySelector(".safe")?.getAttribute("d") ?? "";
  seen[name + "clock"] = document.getElementById("clock").textContent;
  seen[name + "now"] = document.getElementById("now").textContent;
};
const to = (part) => {
  slider.value = Number(slider.min) + part * (slider.max - slider.min);
  slider.dispatchEvent(new Event("input", { bubbles: true }));
};
state("first");
to(0.5);
state("half");
to(1);
state("last");
// A click into a chart over time goes there.
const chart = document.querySelector(".over-time svg"), box = chart.getBoundingClientRect();
chart.dispatchEvent(new MouseEvent("click", { bubbles: true, clientX: box.left + box.width / 2, clientY: box.top + box.height / 2 }));
seen.clicked = document.getElementById("clock").textContent;
const play = document.getElementById("play");
play.click();
seen.playing = play.getAttribute("aria-label");
play.click();
seen.paused = play.getAttribute("aria-label");
</script>
"""


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The folder with the pages of three systems: one vehicle, one following another, and no vehicle."""
    folder = tmp_path_factory.mktemp("runs")
    for model in ["unicycle", "expressions"]:
        punctual("new", f"{model}.toml", "--model", model, cwd=folder)
        punctual("run", f"{model}.toml", "--require", "nothing", "--report", "--out", ".", cwd=folder)
    vehicles = ROOT / "examples" / "vehicles"
    for name in ["escort", "escort-filter", "escort-plant"]:
        text = (vehicles / f"{name}.toml").read_text()
        (folder / f"{name}.toml").write_text(re.sub(r'fmu = "([a-z-]+)[.]fmu"', r'fmu = "\1.toml"', text))
    punctual("run", "escort.toml", "--require", "nothing", "--report", "--out", ".", cwd=folder)
    return folder


@pytest.mark.parametrize("width", [1200, 390])
@pytest.mark.parametrize("name", ["unicycle", "expressions", "escort"])
def test_the_slider_moves_the_run(runs, name, width, tmp_path):
    seen, _, said = opened((runs / f"{name}.html").read_text(), PROBE, width, tmp_path)
    assert "CONSOLE" not in said, said
    assert seen["ready"] == "yes"
    assert int(seen["overflow"]) <= 0
    # Every cursor moves, and so do the values that it shows.
    for what in ["lines", "clock", "now"]:
        states = [seen[state + what] for state in ["first", "half", "last"]]
        assert len(set(states)) == 3, (what, states)
    first, last = (list(map(float, seen[state + "lines"].split())) for state in ["first", "last"])
    assert all(a < b for a, b in zip(first, last, strict=True))
    assert (seen["playing"], seen["paused"]) == ("pause", "play")
    assert seen["clicked"] not in (seen["firstclock"], seen["lastclock"])
    if name == "expressions":
        assert seen["firstwhere"] == ""
        return
    vehicles = [seen[state + "where"].split(";") for state in ["first", "half", "last"]]
    assert [len(at) for at in vehicles] == [2 if name == "escort" else 1] * 3
    assert all(len(set(places)) == 3 for places in zip(*vehicles, strict=True))
    assert int(seen["firsttrail"]) < int(seen["halftrail"]) < int(seen["lasttrail"])
    # The goal moves only in the system with a leader, as the leader does.
    assert (seen["firstgoal"] != seen["lastgoal"]) == (name == "escort")
