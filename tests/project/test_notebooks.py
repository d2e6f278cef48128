"""The notebooks are stored without output, run in a Jupyter kernel in an empty folder, and keep
their promises.
"""

import json
from pathlib import Path

import pytest

TUTORIALS = Path(__file__).resolve().parents[2] / "docs" / "tutorials"
HOLDS = {
    "own_policy": """
slid = {name: run["slip_path"][-1].mean() for name, run in runs.items()}
assert all(run.ending == "completed" for run in runs.values())
assert all(slid[f"{name}, shielded"] < 0.6 * slid[name] for name in MOTIONS)
""",
    "own_robot": """
assert dog.mass == pytest.approx(model.body_mass.sum(), rel=1e-9) and not bridge.differences
assert run.ending == "completed" and run["q"][-1, 0] == pytest.approx(0.4 * data.time, rel=0.3)
""",
    "robot_dog": """
assert run.ending == "completed" and seen.slip_mm_per_step < 0.01
""",
    "why_feet_slip": """
slip = [hp.measure(run).slip_mm_per_step for run in runs.values()]
assert slip[1] < 0.1 * slip[0] and slides[satisfied].mean() > 0.1
""",
}
"""What is true after the last cell of each notebook."""


@pytest.mark.parametrize("name", HOLDS)
def test_nothing_but_cells_is_stored(name: str) -> None:
    nbformat = pytest.importorskip("nbformat")
    book = json.loads((TUTORIALS / f"{name}.ipynb").read_text())
    nbformat.validate(book)
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    assert (book["nbformat"], book["nbformat_minor"], book["metadata"]) == (
        4,
        5,
        {"kernelspec": kernel},
    )
    ids = [cell["id"] for cell in book["cells"]]
    assert len(set(ids)) == len(ids)
    for cell in book["cells"]:
        assert cell["metadata"] == {}
        assert cell.get("outputs", []) == []
        assert cell.get("execution_count") is None


@pytest.mark.long
@pytest.mark.parametrize("name", HOLDS)
def test_it_runs(name: str, tmp_path: Path) -> None:
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    book = nbformat.read(TUTORIALS / f"{name}.ipynb", as_version=4)
    book.cells.append(nbformat.v4.new_code_cell(f"import pytest\n{HOLDS[name]}"))
    nbclient.NotebookClient(
        book, timeout=600, resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    outputs = [output for cell in book.cells if cell.cell_type == "code" for output in cell.outputs]
    assert any(
        "<iframe srcdoc" in output.get("data", {}).get("text/html", "") for output in outputs
    )
    assert not [output.text for output in outputs if "Warning" in output.get("text", "")]


def test_every_notebook_is_tested() -> None:
    assert {path.stem for path in TUTORIALS.glob("*.ipynb")} == set(HOLDS)
