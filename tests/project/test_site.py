"""The documentation site builds without a warning, whole, and asks nothing of the network."""

import re
import subprocess
import sys
from html import unescape
from pathlib import Path

import pytest

import harpy_pin as hp

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site: unknown links, anchors and parameters are errors, and so are pages outside nav."""
    pytest.importorskip("mkdocs", reason="the site is the extra docs")
    folder = tmp_path_factory.mktemp("site")
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(build, cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return folder


def test_every_name_has_its_entry(site: Path) -> None:
    pages = "".join(page.read_text() for page in (site / "reference").glob("*.html"))
    for name in hp.__all__:
        if name != "__version__" and not name.islower():
            assert f'id="harpy_pin.{name}"' in pages, name
    assert ":class:" not in pages
    assert ":func:" not in pages


def test_indices_of_symbols_are_subscripts_and_names_are_kept(site: Path) -> None:
    page = (site / "equations.html").read_text()
    assert "u<sub>gz</sub>" in page
    assert "u<sub>t,c</sub>" in page
    for path in site.rglob("*.html"):
        for code in re.finditer(r"<(code|pre|math)\b.*?</\1>", path.read_text(), re.S):
            assert "<sub>" not in code[0], path


def test_lines_of_code_fit_a_page_of_1280_pixels(site: Path) -> None:
    """Also those of docstrings, examples and notebooks; commands take further lines there."""
    for path in site.rglob("*.html"):
        for block in re.finditer(r'<div class="([^"]*)"><pre>(.*?)</pre>', path.read_text(), re.S):
            lines = unescape(re.sub(r"<[^>]*>", "", block[2])).splitlines()
            assert "language-bash" in block[1] or not [line for line in lines if len(line) > 100], (
                path
            )


def test_nothing_comes_from_the_network(site: Path) -> None:
    for page in site.rglob("*.html"):
        text = page.read_text()
        assert not re.findall(
            r"<(?:script|link|img|iframe)[^>]*(?:src|href)=[\"']?https?:", text
        ), page
        assert not re.findall(r"@import|url\(https?:", text), page


def test_home_is_the_readme_and_its_links_lead_on(site: Path) -> None:
    home = (site / "index.html").read_text()
    for target in (
        "condensed.html",
        "tutorials/index.html",
        "examples.html#own_controller",
        "changelog.html",
    ):
        assert f'href="{target}"' in home
    for page in set(site.rglob("*.html")) - {site / "404.html"}:  # whose links are a server's
        local = re.findall(r'(?:href|src)="([^":#?]+)[#?"]', page.read_text())
        assert not [link for link in local if not (page.parent / link).exists()], page


def test_notebooks_are_pages_and_can_be_downloaded(site: Path) -> None:
    page = (site / "tutorials" / "own_robot.html").read_text()
    assert 'id="a-loop-of-your-own"' in page
    assert 'class="language-python highlight"' in page
    assert 'href="own_policy.html"' in page
    assert 'href="own_robot.ipynb" download' in page
    assert (site / "tutorials" / "own_robot.ipynb").is_file()
