"""What becomes a page of the site: README, changelog, examples and notebooks; links lead to them.

The Markdown files stay as they read well in the repository; their links are turned into the site's
here, their formulas, which GitHub draws from fences named ``math``, into MathML, which browsers
draw without a script, and the indices of symbols in sentences, such as u_gz, into subscripts.
"""

from __future__ import annotations

import json
import re
from os.path import relpath
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
PAGES = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
}
"""Files at the top of the repository, and the pages that they become."""
EXAMPLES = "examples.md"
_LINK = re.compile(r"\[(?P<text>[^]\n]*)\]\((?P<path>[^)\s#]+)(?P<anchor>#[^)\s]*)?\)")
_APART = re.compile(r"(<(?P<tag>a|code|pre|math|script|style)\b.*?</(?P=tag)>|<[^>]+>)", re.S)
"""Parts of a page that are not sentences: tags, and all of elements in which an underscore is
itself.
"""
_SYMBOL = re.compile(
    r"(?<![\w/.])((?:[^\W\d_][\u0300-\u036f]?){1,2}|‖²)"
    r"_([A-Za-z0-9]{1,5}(?:,[a-z](?![a-z]))?|⊥)(?![A-Za-z0-9_])"
)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Make MathML of every fence named ``math``."""
    fences = config.mdx_configs.setdefault("pymdownx.superfences", {}).setdefault(
        "custom_fences", []
    )
    fences.append({"name": "math", "class": "math", "format": formula})
    return config


def formula(source: str, *_: Any, **__: Any) -> str:
    """The MathML of LaTeX that stands on lines of its own."""
    return f'<div class="formula">{convert(source, display="block")}</div>'


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages whose text is elsewhere."""
    for name, page in PAGES.items():
        files.append(File.generated(config, page, content=(ROOT / name).read_text()))
    files.append(File.generated(config, EXAMPLES, content=examples()))
    for path in sorted(DOCS.rglob("*.ipynb")):
        page = path.with_suffix(".md").relative_to(DOCS)
        files.append(File.generated(config, page.as_posix(), content=notebook(path)))
    return files


def notebook(path: Path) -> str:
    """A notebook as Markdown: its text, its code in fences, and below the title where to get it."""
    cells = json.loads(path.read_text())["cells"]
    texts = ["".join(cell["source"]) for cell in cells]
    fences = {"markdown": "{}", "code": "```python\n{}\n```"}
    title, *rest = (
        fences[cell["cell_type"]].format(text) for cell, text in zip(cells, texts, strict=True)
    )
    name = f'<a href="{path.name}" download>Download the notebook</a>'
    return "\n\n".join([title, f"{name}; here it is without its output.", *rest]) + "\n"


def examples() -> str:
    """All examples on one page, each under its file's name."""
    sections = ["# Examples", "Each runs as it is: `python examples/first_walk.py`."]
    for path in sorted((ROOT / "examples").glob("*.py")):
        sections.append(f"## {path.name} {{#{path.stem}}}\n\n```python\n{path.read_text()}```")
    return "\n\n".join(sections) + "\n"


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Set the indices of symbols below the line, but in the reference, whose names have
    underscores, too.
    """
    if page.file.src_uri.startswith("reference/"):
        return html
    parts, end = [], 0
    for apart in _APART.finditer(html):
        parts += [_SYMBOL.sub(r"\1<sub>\2</sub>", html[end : apart.start()]), apart[0]]
        end = apart.end()
    return "".join([*parts, _SYMBOL.sub(r"\1<sub>\2</sub>", html[end:])])


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links within the repository into links within the site; source files are named only, as
    it has none.
    """
    uri = page.file.src_uri
    generated = {page: ROOT / name for name, page in PAGES.items()}
    folder = generated.get(uri, DOCS / uri).parent

    def link(match: re.Match[str]) -> str:
        text, path, anchor = match["text"], match["path"], match["anchor"] or ""
        if "://" in path:
            return match[0]
        file = (folder / path).resolve()
        if ROOT / "examples" in (file, file.parent):
            anchor = f"#{file.stem}" if file.suffix else ""
            file = DOCS / EXAMPLES
        elif file.parent == ROOT and file.name in PAGES:
            file = DOCS / PAGES[file.name]
        elif file.suffix == ".ipynb":
            file = file.with_suffix(".md")
        elif file.is_file() and not file.is_relative_to(DOCS):
            return text
        return f"[{text}]({relpath(file, (DOCS / uri).parent)}{anchor})"

    return _LINK.sub(link, markdown)
