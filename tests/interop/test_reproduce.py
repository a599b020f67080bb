"""`punctual reproduce`: its numbers, its files, and the guide that is made from them.

It is separate from the other tests of the command line, since it requires an optimised build.
"""

import json
import re
import shutil

from conftest import ROOT, punctual

NUMBER = re.compile(r"\d+(?:\.\d+)?")


def column(report, key, head, *words):
    """The cells of table `key` in column `head`, from the rows that contain all of `words`."""
    (table,) = [table for table in report["tables"] if table["key"] == key]
    index = table["header"].index(head)
    return [row[index] for row in table["rows"] if all(word in row for word in words)]


def test_the_numbers_of_a_few_runs(study):
    _, report = study
    runs = report["options"]["runs"]
    assert report["kept"] is True
    # The paper's first table. Its method, whatever integrates it, is within the 4 ms that the integrators differ
    # by; ours is on time.
    for vehicle, paper in [("point mass", 10.003), ("unicycle", 10.087), ("bicycle", 10.256)]:
        assert column(report, "discretisation", "paper (s)", vehicle) == [paper]
        for head in ["repeated root, Euler (s)", "semi-implicit (s)", "RK4 (s)"]:
            (time,) = column(report, "discretisation", head, vehicle)
            assert abs(time - paper) < 4e-3, (vehicle, head)
        assert column(report, "discretisation", "ours, RK4 (s)", vehicle)[0] <= 10.0
    # The methods on the same starts, one row per vehicle.
    advised = "distance, damping"
    assert column(report, "methods", "kept until 2T", "reference profile (ours)", advised) == [runs] * 3
    assert column(report, "methods", "kept until 2T", "constricting tube", "default", advised) == [runs] * 3
    # This method has no deadline to keep: with a = 1 it has not arrived by T.
    assert column(report, "methods", "on time", "exponential CBF", "default", advised) == [0] * 3
    assert column(report, "methods", "on time", "repeated root (the paper)", "quadratic, u_ref = 0") == [0] * 3
    # With a plan every promise is kept, whatever u_ref is. A method with a backup keeps the set it starts in, and is asked no more.
    for method in ["plans (ours)", "gatekeeper", "backup CBF"]:
        assert set(column(report, "always", "accepted, not kept", method)) == {0}
    for vehicle in ["point mass", "unicycle", "bicycle"]:
        for head in ["accepted", "on time", "kept"]:
            assert column(report, "always", head, "reach and stay", vehicle, "plans (ours)") == [runs] * 3
        assert column(report, "always", "kept", "stay", vehicle, "plans (ours)") == [runs] * 3
    assert sum(column(report, "always", "accepted, not kept", "reach and stay", "rows alone (ours)")) > 0
    assert column(report, "seeds", "bicycle") == [runs] * report["options"]["seeds"]
    # Held inputs cost the repeated root a time of first order in the period; ours is early at every one.
    (order,) = column(report, "step_size", "fitted order in δ", "lateness (s)", "point mass", "repeated root")
    assert 0.9 < order < 1.1
    for head in ["at 1 ms", "at 10 ms", "at 50 ms"]:
        late = column(report, "step_size", head, "lateness (s)", "profile, compensated")
        assert len(late) == 3 and all(float(value) < 0 for value in late)


def test_the_bicycles():
    """A few starts of the table of docs/bicycle.md: every filter keeps the car's promise on every plant."""
    done = punctual("reproduce", "--bicycles", "--quick", "--json")
    table = json.loads(done.stdout)
    head = table["header"].index
    # Three vehicles: on three plants four remedies and a filter for small slip, on one its own model.
    assert len(table["rows"]) == 3 * (3 * 5 + 1)
    car = [row for row in table["rows"] if row[head("vehicle")] == "car"]
    assert len(car) == 16
    for row in car:
        assert row[head("on time")] == row[head("inside from T to 2T")] == 4, row
        assert row[head("least h (m)")] >= 0, row


def test_a_file_for_each_table_and_picture(study):
    folder, report = study
    for table in report["tables"]:
        lines = (folder / f"{table['key']}.csv").read_text().splitlines()
        assert len(lines) == 1 + len(table["rows"])
    page = (folder / "report.html").read_text()
    pictures = list(folder.glob("*.svg"))
    assert len(pictures) >= 18
    assert page.count('class="chart"') == len(pictures)
    # The page loads nothing; the SVG namespace is an address that is not fetched.
    assert set(re.findall(r"://([^/\"]*)", page)) == {"www.w3.org"}
    for loads in ["src=", "@import", "<link", "fetch("]:
        assert loads not in page


def test_the_same_again(study, tmp_path):
    """Rows, pictures and page are bitwise the same, whatever runs first."""
    folder, _ = study
    punctual("reproduce", "--quick", "--untimed", "--out", tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(p.name for p in folder.iterdir())
    for path in tmp_path.iterdir():
        assert path.read_bytes() == (folder / path.name).read_bytes(), path.name


def test_the_guide_is_what_the_program_makes(tmp_path):
    """Words must match exactly, numbers up to the effect of another platform's `sin` and `cos`: a pixel in a picture, a per cent or
    two units of the last digit in a table."""
    docs = ROOT / "docs"
    shutil.copy(docs / "guide.md", tmp_path)
    punctual("reproduce", "--guide", tmp_path)
    made = sorted(path.name for path in (tmp_path / "guide").iterdir())
    assert made == sorted(path.name for path in (docs / "guide").iterdir())
    text = (docs / "guide.md").read_text()
    assert sorted(re.findall(r"\]\(guide/(.*?)\)", text)) == made
    for name, absolute, part in [("guide.md", 0.02, 0.01)] + [(f"guide/{name}", 1, 0) for name in made]:
        wanted, found = (docs / name).read_text(), (tmp_path / name).read_text()
        assert NUMBER.sub("#", wanted) == NUMBER.sub("#", found), name
        for w, f in zip(map(float, NUMBER.findall(wanted)), map(float, NUMBER.findall(found))):
            assert abs(w - f) <= absolute + part * w, (name, w, f)
