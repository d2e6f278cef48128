"""The package as its users meet it."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import harpy_pin as hp
from harpy_pin.controllers import CondensedController
from harpy_pin.kernels.source import _own_fingerprint
from harpy_pin.wbc.condensed.solve import solve_condensed

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "harpy_pin"

# From top to bottom: a package imports only packages above its own line.
ORDER = [
    ("errors",),
    ("checks", "files"),
    ("arguments",),
    ("kernels",),
    ("model",),
    ("estimation",),
    ("ground",),
    ("log",),
    ("simulation",),
    ("gaits",),
    ("governors",),
    ("wbc",),
    ("controllers",),
    ("scenario",),
    ("export",),
    ("view",),
    ("cli",),
    ("__main__",),
    ("contrib",),
]


def test_every_name_is_there():
    for name in hp.__all__:
        assert getattr(hp, name) is not None
    with pytest.raises(AttributeError, match="nonsense"):
        _ = hp.nonsense


def test_packages_are_attributes():
    """``import harpy_pin as hp`` is enough to write ``hp.wbc.make_problem``; each package lists
    names of its own.
    """
    names = [
        "controllers",
        "gaits",
        "governors",
        "ground",
        "log",
        "model",
        "simulation",
        "view",
        "wbc",
    ]
    script = f"""
import harpy_pin as hp
for package in {names}:
    module = getattr(hp, package)
    listed = [getattr(module, name) for name in module.__all__]
    assert len(listed) > 1 and None not in listed, package
"""
    subprocess.run([sys.executable, "-c", script], check=True, cwd=ROOT)


def test_import_is_light():
    """Importing the package loads none of the heavy libraries, and so compiles nothing."""
    heavy = ("pinocchio", "scipy", "matplotlib", "mujoco")
    script = f"import sys, harpy_pin; print([m for m in {heavy} if m in sys.modules])"
    loaded = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert loaded.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("used", "most"),
    [
        ("hp.CondensedController", 63),
        ("hp.view.write_html, hp.measure", 44),
        ("hp.walk", 82),
        ("hp.walk(hp.Scenario(duration=0.01))", 118),
    ],
)
def test_what_is_used_needs_few_files(used, most):
    """Files that are imported, besides those of the language and ``__init__.py``."""
    script = f"""
import sys, harpy_pin as hp
{used}
print(*(name for name, module in sys.modules.items() if name.startswith("harpy_pin.")
    and not hasattr(module, "__path__") and not name.startswith("harpy_pin.kernels.")))
"""
    loaded = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=ROOT
    )
    files = loaded.stdout.split()
    assert 30 < len(files) <= most, files


def test_nothing_imports_upward():
    level = {part: i for i, parts in enumerate(ORDER) for part in parts}
    modules = [p for p in PACKAGE.rglob("*.py") if p != PACKAGE / "__init__.py"]
    assert {p.relative_to(PACKAGE).parts[0].removesuffix(".py") for p in modules} == set(level)
    for path in modules:
        part = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        for node in ast.walk(ast.parse(path.read_text())):
            names = []
            if isinstance(node, ast.ImportFrom) and node.module:
                names = (
                    [node.module]
                    if node.module != "harpy_pin"
                    else [f"harpy_pin.{a.name}" for a in node.names]
                )
            elif isinstance(node, ast.Import):
                names = [a.name for a in node.names]
            for name in names:
                other = name.split(".")[1] if name.startswith("harpy_pin.") else None
                if other in level and other != part:
                    assert level[other] < level[part], f"{path.name} → {name}"
                assert not name.startswith(("comparison", "reproduction")), f"{path.name} → {name}"


def test_ci_runs_the_readmes_commands():
    """The README's two commands are where .ci/run looks for them, and the tests come before
    anything is installed.
    """
    readme = (ROOT / "README.md").read_text()
    blocks = dict(re.findall(r"<!-- (\w+) -->\n```bash\n(.*?)\n```", readme, re.S))
    assert "python -m comparison" in blocks["comparison"]
    assert "pytest" in blocks["tests"]
    check = (ROOT / ".ci" / "run").read_text()
    assert "$(readme comparison)" in check
    assert check.index("$(readme tests)") < min(check.index("apt-get"), check.index("pip install"))


def test_ten_files_are_the_whole_way_of_a_state():
    """docs/architecture.md names ten files to read, in at most 2,600 lines; every module it names
    exists.
    """
    text = (ROOT / "docs" / "architecture.md").read_text()
    section = text[text.index("## Ten files to read") : text.index("## The packages")]
    files = re.findall(r"^\d+\. `([^`]+)`", section, re.M)
    assert len(files) == 10
    assert sum(len((ROOT / name).read_text().splitlines()) for name in files) <= 2600
    for name in re.findall(r"`((?:harpy_pin|comparison|tests)/[\w/]+\.py)`", text):
        assert (ROOT / name).is_file(), name


def called_by(kernel):
    """Modules of all kernels that a kernel may call, itself included."""
    waiting, seen = [kernel.py_func], set()
    while waiting:
        function = waiting.pop()
        if function not in seen:
            seen.add(function)
            waiting += _own_fingerprint(function)[1]
    return {function.__module__ for function in seen}


def test_the_condensed_tick_is_short():
    """Its kernels, from the measured state to torques, stand in at most 22 files of four folders
    and 3,840 lines.
    """
    modules = called_by(CondensedController(hp.make_gait(hp.load_harpy()))._step)
    assert {module.split(".")[1] for module in modules} == {"controllers", "wbc", "model", "ground"}
    files = [ROOT / (module.replace(".", "/") + ".py") for module in modules]
    assert len(files) <= 22
    assert sum(len(file.read_text().splitlines()) for file in files) <= 3840


def test_the_condensed_optimum_is_closed_in_itself():
    """The kernels of a solve call none outside ``wbc``, but for small mathematics and a check of
    numbers, and none of the whole-body QP.
    """
    others = {
        module
        for module in called_by(solve_condensed)
        if not module.startswith("harpy_pin.wbc.condensed.")
    }
    search = {"cones", "giving_way", "newton", "optimum", "targets"}
    model = {f"harpy_pin.model.{name}" for name in ("cholesky", "terms", "vectors")}
    assert others == model | {f"harpy_pin.wbc.{name}" for name in search}


def test_nothing_under_model_reads_weights():
    """A model has no tasks: weights belong to ``wbc``."""
    for path in (PACKAGE / "model").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [getattr(node, part, None) for part in ("id", "attr", "arg", "name", "value")]
            found = [
                n
                for n in names
                if isinstance(n, str) and re.fullmatch(r"w_\w+|weights?|\w+Weights\w*", n)
            ]
            assert not found, f"{path.name}: {found}"


LINES_OF_A_WALK = [
    ["walk", "--duration", "0.05", "--save", "walk.npz"],
    ["view", "walk.npz", "--csv", "walk.csv"],
    *(["view", "walk.npz"], ["view", "walk.npz", "--figures", "walk.pdf"], ["demo", "--no-open"]),
]


def test_walks_need_no_viewer(tmp_path):
    """Nor do their logs; what shows them names the extra that it needs, before anything is
    walked.
    """
    script = f"""
import sys
sys.modules.update(dict.fromkeys(("matplotlib", "meshcat", "umsgpack", "PIL", "jinja2")))
from harpy_pin.__main__ import main
for words in {LINES_OF_A_WALK}:
    sys.argv = ["harpy", *words]
    try:
        main()
    except SystemExit as end:
        print("code", end.code or 0)
"""
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.stderr.count("Traceback") == 0, done.stderr
    walked, table, *shown = re.findall(r"^code (\d)$", done.stdout, re.M)
    assert walked == "0"
    assert table in "02"  # that needs pandas
    assert shown == ["2", "2", "2"]
    assert done.stderr.count("[view]") == 3
