"""The page of `punctual reproduce` in a real browser: it draws, shows values, zooms, and fits a phone."""

import re

import pytest
from browser import opened

# Operates the page like a user, and stores what it saw as attributes of the document.
PROBE = """
<script>
const root = document.documentElement, seen = root.dataset;
seen.overflow = String(root.scrollWidth - root.clientWidth);
const svg = document.querySelector(".chart.live svg"), box = svg.getBoundingClientRect();
const at = (type, x, y) => svg.dispatchEvent(new PointerEvent(type, { bubbles: true, pointerId: 1,
  pointerType: "mouse", clientX: box.left + x * box.width, clientY: box.top + y * box.height }));
svg.setPointerCapture = () => {};
const curve = () => svg.querySelector("g path").getAttribute("d");
const before = curve();
// Where the first curve is.
const [x, y] = before.slice(1).split("L")[0].split(" ").map(Number), view = svg.viewBox.baseVal;
at("pointermove", x / view.width, y / view.height);
seen.read = svg.parentNode.querySelector("output").textContent;
at("pointerdown", 0.3, 0.3);
at("pointermove", 0.6, 0.6);
at("pointerup", 0.6, 0.6);
seen.zoomed = String(curve() !== before);
svg.dispatchEvent(new MouseEvent("dblclick", { bubbles: true }));
seen.reset = String(curve() === before);
const key = svg.parentNode.querySelector(".key");
key.click();
seen.hidden = String(svg.querySelectorAll("g path").length);
key.click();
seen.shown = String(svg.querySelectorAll("g path").length);
</script>
"""


@pytest.mark.parametrize("width", [1200, 390])
def test_the_page_works_in_a_browser(study, width, tmp_path):
    text = (study[0] / "report.html").read_text()
    charts = len(re.findall(r'class="chart"', text))
    assert charts >= 18
    attributes, document, _ = opened(text, PROBE, width, tmp_path)
    # The script draws every chart.
    assert attributes["ready"] == "yes"
    assert len(re.findall(r'data-drawn="[1-9]', document)) == charts
    # Wide tables scroll by themselves; the page does not.
    assert int(attributes["overflow"]) <= 0
    assert re.search(r"x_p \(m\) = .*, y_p \(m\) = ", attributes["read"])
    assert (attributes["zoomed"], attributes["reset"]) == ("true", "true")
    assert int(attributes["hidden"]) < int(attributes["shown"])
