"""Whether every link and picture of the book, a folder of pages, leads to something within it: docs/book calls it.

Prints what does not, and ends with code 1 then. What a page itself loads must lie in the book.
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """The anchors of a page, where its links lead, and what it loads."""

    def __init__(self, text):
        super().__init__()
        self.anchors, self.links, self.loaded = set(), [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.anchors |= {attributes[name] for name in ("id", "name") if attributes.get(name)}
        if attributes.get("href"):
            (self.loaded if tag == "link" else self.links).append(attributes["href"])
        if attributes.get("src"):
            self.loaded.append(attributes["src"])


def defects(book):
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in book.rglob("*.html")}
    for path, page in sorted(pages.items()):
        for link in [*page.links, *page.loaded]:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                if link in page.loaded:
                    yield path, f"{link}: loaded from elsewhere"
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.is_file():
                yield path, f"{link}: no such file"
            elif target in pages and parts.fragment and unquote(parts.fragment) not in pages[target].anchors:
                yield path, f"{link}: no such place"


def main():
    book = Path(sys.argv[1]).resolve()
    found = [f"{path.relative_to(book)}: {defect}" for path, defect in defects(book)]
    print(*found, sep="\n", end="\n" if found else "")
    sys.exit(1 if found else 0)


main()
