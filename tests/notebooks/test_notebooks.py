"""Every notebook of the documentation runs from its first cell to its last."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

from igrow.core.telemetry import write_csv
from tests.virtual_log import virtual_log

DOCS = Path(__file__).resolve().parents[2] / "docs"
NOTEBOOKS = sorted(DOCS.rglob("*.ipynb"))


def test_each_journey_of_a_researcher_has_its_notebook() -> None:
    assert {path.stem for path in NOTEBOOKS} >= {
        "tutorial", "compare_simulators", "plan_a_week", "reproduce_the_paper",
    }  # fmt: skip


def test_the_first_figure_takes_two_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_csv(tmp_path / "export.csv", virtual_log(3, seed=1, step=900.0))
    (tmp_path / "site.yaml").write_text("name: virtual\nlatitude: 52.0\nlongitude: 4.5\n")
    monkeypatch.chdir(tmp_path)
    blocks = (DOCS / "data.md").read_text().split("```python\n")[1:]
    lines = [line for line in blocks[0].split("```")[0].splitlines() if line]
    assert len(lines) == 2
    names: dict[str, Any] = {}
    exec(lines[0], names)
    figure = eval(lines[1], names)
    assert "<svg" in figure._repr_svg_()


@pytest.mark.notebooks
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, data_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IGROW_DATA", str(data_folder))
    notebook = nbformat.read(path, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "kept without outputs: they would grow stale"
    NotebookClient(
        notebook, timeout=1200, kernel_name="python3", resources={"metadata": {"path": str(path.parent)}}
    ).execute()
    assert any(cell.get("outputs") for cell in notebook.cells)
