"""A page in a real browser."""

import html
import os
import re
import shutil
import subprocess

import pytest

BROWSERS = ["chromium", "chromium-browser", "google-chrome", "chrome"]

# A window is at least 500 pixels wide, but a frame can be narrower. The results are copied out of the frame.
FRAME = """<!DOCTYPE html>
<html><body>
<script>
const copy = (frame) => {
  const inside = frame.contentDocument.documentElement, copied = document.createElement("template");
  Object.assign(document.documentElement.dataset, inside.dataset, { width: frame.contentWindow.innerWidth });
  copied.innerHTML = inside.outerHTML;
  document.body.append(copied);
};
</script>
<iframe style="width: WIDTHpx; height: 900px; border: 0" onload="copy(this)" srcdoc="PAGE"></iframe>
</body></html>
"""


def opened(text, probe, width, folder):
    """Opens the page `text`, `width` pixels wide, with the script `probe` appended. Returns the attributes of the document, its
    whole text, and the browser's messages."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        missing = pytest.fail if "CI" in os.environ else pytest.skip
        missing(f"no browser to open the page with: none of {', '.join(BROWSERS)} is installed")
    inner = html.escape(text.replace("</body>", probe + "</body>"))
    page = folder / "page.html"
    page.write_text(FRAME.replace("WIDTH", str(width)).replace("PAGE", inner))
    arguments = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder / 'profile'}"]
    arguments += ["--enable-logging=stderr", "--window-size=1300,1000", "--virtual-time-budget=5000"]
    done = subprocess.run(
        [browser, *arguments, "--dump-dom", page.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    attributes = dict(re.findall(r'data-([a-z]+)="([^"]*)"', done.stdout.split(">", 2)[1]))
    assert int(attributes["width"]) == width
    return attributes, done.stdout, done.stderr
