"""Makes chapters of the documents, for mdBook: docs/book calls it.

The documents are written for a code host. Three things differ in a book:

- Formulas, code blocks of the language `math`, are set by KaTeX here, so that a reader needs no network. In a document that
  has some, indices and exponents of formulas in a line (`c_k`, `e^{-t}`) are set below and above it.
- A link out of docs/ leads to a page of the book that shows the file.
- Text that is not Markdown, such as the help of every command, becomes a page.
"""

import json
import os
import posixpath
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = "docs"
# What shows a file's lines, by the end of its name.
LANGUAGES = {".c": "c", ".cpp": "cpp", ".h": "c", ".py": "python", ".rs": "rust", ".toml": "toml"}

FENCE = re.compile(r"^```.*?^```[ ]*$", re.M | re.S)
LINK = re.compile(r"(\]\()([^)\s]+)(\))")
# What stays as it is within a line: code, where a link leads, HTML.
KEPT = re.compile(r"`[^`]*`|\]\([^)]*\)|<[^>]*>")
# An index or an exponent: in braces, one sign, or one of the words that stand as an index.
LOWERED = re.compile(r"(?<=[^\W_]|[′\u0300-\u036f])_(?:\{([^{}]*)\}|((?:ref|min|max|rows|plan|cmd|front)\b|[^\W_])(?![a-z_]))")
RAISED = re.compile(r"(?<=[\w)|>])\^(?:\{([^{}]*)\}|(\w))")

KATEX = """
const katex = require(process.argv[1]);
const formulas = JSON.parse(require("fs").readFileSync(0, "utf8"));
const set = (formula) => katex.renderToString(formula, { displayMode: true, throwOnError: true, strict: "error" });
process.stdout.write(JSON.stringify(formulas.map(set)));
"""


def set_formulas(formulas):
    """The HTML of formulas in LaTeX."""
    command = ["node", "-e", KATEX, os.environ["PUNCTUAL_KATEX"]]
    done = subprocess.run(command, input=json.dumps(formulas), stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout)


def page_of(path):
    """The page that shows a file or folder of the repository, given from its root; in the book, from its root."""
    if path in CHAPTERS:
        return CHAPTERS[path]
    if path.startswith(DOCS + "/"):
        return path.removeprefix(DOCS + "/")
    if path not in PAGES:
        PAGES[path] = f"files/{path}/contents.md" if (ROOT / path).is_dir() else f"files/{path}.md"
    return PAGES[path]


def redirected(target, folder, page):
    """Where a link of a document in `folder` leads from the page that shows it."""
    path, mark, anchor = target.partition("#")
    if "://" in target or not path:
        return target
    leads = page_of(posixpath.normpath(posixpath.join(folder, path)))
    return posixpath.relpath(leads, posixpath.dirname(page) or ".") + mark + anchor


def raised_and_lowered(text):
    """`c_k` and `e^{-t}` with their index and exponent in HTML."""
    text = LOWERED.sub(lambda m: f"<sub>{m[1] or m[2]}</sub>", text)
    return RAISED.sub(lambda m: f"<sup>{m[1] or m[2]}</sup>", text)


def formulas_in_lines(text):
    """Text between code blocks, with the formulas in its lines set; headings stay, since anchors are made of them."""
    lines = []
    for line in text.split("\n"):
        if not line.startswith("#"):
            kept = KEPT.findall(line)
            parts = [raised_and_lowered(part) for part in KEPT.split(line)]
            line = "".join(part + (kept[k] if k < len(kept) else "") for k, part in enumerate(parts))
        lines.append(line)
    return "\n".join(lines)


def markdown(text, path, page):
    """The chapter that a document at `path` comes to."""
    folder = posixpath.dirname(path)
    blocks = FENCE.findall(text)
    formulas = [block for block in blocks if block.startswith("```math\n")]
    done = iter(set_formulas([block.removeprefix("```math\n").removesuffix("```") for block in formulas]) if formulas else [])
    result = []
    for k, part in enumerate(FENCE.split(text)):
        part = LINK.sub(lambda m: m[1] + redirected(m[2], folder, page) + m[3], part)
        result.append(formulas_in_lines(part) if formulas else part)
        if k < len(blocks):
            block = blocks[k]
            result.append(f'<div class="formula">{next(done)}</div>' if block in formulas else block)
    if formulas:
        up = "../" * page.count("/")
        result.insert(0, f'<link rel="stylesheet" href="{up}katex/katex.min.css">\n\n')
    return "".join(result)


def fenced(text, language):
    fence = "`" * (1 + max((len(run) for run in re.findall(r"``+", text)), default=2))
    return f"{fence}{language}\n{text.rstrip()}\n{fence}\n"


def notebook(text):
    cells = []
    for cell in json.loads(text)["cells"]:
        source = "".join(cell["source"])
        cells.append(source if cell["cell_type"] == "markdown" else fenced(source, "python"))
    return "\n\n".join(cells)


def file_page(path, page):
    """The page that shows a file, or what a folder has."""
    full = ROOT / path
    if full.is_dir():
        listed = subprocess.run(["git", "ls-files", path], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
        links = [f"- [`{name.removeprefix(path + '/')}`](/{name})" for name in listed.stdout.split()]
        return f"# {path}\n\n" + "\n".join(LINK.sub(lambda m: m[1] + redirected(m[2][1:], "", page) + m[3], l) for l in links)
    text = full.read_text(encoding="utf-8")
    if full.suffix == ".md":
        return markdown(text, path, page)
    if full.suffix == ".ipynb":
        return markdown(f"# {path}\n\n" + notebook(text), path, page)
    return f"# {path}\n\n" + fenced(text, LANGUAGES.get(full.suffix, "text"))


def help_page():
    """What `--help` says of every command, as tests/cli compares it with the program."""
    folder = ROOT / "tests/cli/golden"
    names = ["help.txt", *sorted(path.name for path in folder.glob("help-*.txt"))]
    parts = ["# Every option\n\nThis is what `punctual --help` and `punctual COMMAND --help` say; a test compares it with the program.\n"]
    for name in names:
        command = " ".join(["punctual", *name.removesuffix(".txt").split("-")[1:]])
        parts.append(f"## {command}\n\n" + fenced((folder / name).read_text(encoding="utf-8"), "text"))
    return "\n".join(parts)


def chapter(name, content, path, number, parents=()):
    return {"Chapter": {"name": name, "content": content, "number": number, "sub_items": [], "path": path,
                        "source_path": path, "parent_names": list(parents)}}


def walk(items):
    for item in items:
        if isinstance(item, dict) and "Chapter" in item:
            yield item["Chapter"]
            yield from walk(item["Chapter"]["sub_items"])


def main():
    if sys.argv[1:2] == ["supports"]:
        sys.exit(sys.argv[2] != "html")
    _, book = json.load(sys.stdin)
    chapters = list(walk(book["items"]))
    for each in chapters:
        path = posixpath.normpath(posixpath.join(DOCS, each["source_path"]))
        name = posixpath.basename(path)
        page = {"README.md": "index.md", "help.txt": "options.md"}.get(name, str(Path(name).with_suffix(".md")))
        CHAPTERS[path], each["path"] = page, page
        each["source_path"] = path
    for each in chapters:
        path, page = each["source_path"], each["path"]
        if page == "options.md":
            each["content"] = help_page()
        elif path.endswith(".md"):
            each["content"] = markdown(each["content"], path, page)
        else:
            each["content"] = f"# {each['name']}\n\n" + fenced(each["content"], "text")
    # A page may name files that no page named before.
    shown = {}
    while missing := [path for path in PAGES if path not in shown]:
        for path in missing:
            shown[path] = file_page(path, PAGES[path])
    last = max(each["number"] for each in chapters if each["number"])[0] + 1
    files = chapter("Files that the book names", "# Files that the book names\n", "files/contents.md", [last])
    for k, path in enumerate(sorted(shown)):
        page = chapter(path, shown[path], PAGES[path], [last, k + 1], [files["Chapter"]["name"]])
        files["Chapter"]["sub_items"].append(page)
        files["Chapter"]["content"] += f"\n- [`{path}`]({posixpath.relpath(PAGES[path], 'files')})"
    book["items"] += [{"PartTitle": "Files"}, files]
    json.dump(book, sys.stdout)


# Pages by what they show. The contents stand beside every page.
CHAPTERS = {"docs/SUMMARY.md": "index.md"}
PAGES = {}
if __name__ == "__main__":
    main()
