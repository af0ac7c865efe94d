"""Exports of greenhouse computers in golden folders: what is understood of each, and that it reads as the truth.

Each folder of `layouts/` holds the file as a computer writes it, `options.txt` with what only its user knows,
`mapping.yaml` as it must come out, and `ORIGIN.md` on where the layout is from. All show the greenhouse of `truth.csv`.
"""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pytest

from igrow.core.telemetry import read_csv
from igrow.trainer.cli import main
from igrow.trainer.data import read_log

pytestmark = pytest.mark.usefixtures("without_picture")
LAYOUTS = Path(__file__).parent / "layouts"
FOLDERS = sorted(folder for folder in LAYOUTS.iterdir() if folder.is_dir())
TRUTH = read_csv(LAYOUTS / "truth.csv")
OPEN = ("danish-cell", "hobo-logger")
"""A dosing without a unit, and a logger of the bench that knows nothing of the weather: the status says so."""
ROUNDED = {
    "air_co2": 0.51, "outdoor_humidity": 0.51, "air_humidity": 0.51, "global_radiation": 0.51, "vent_lee": 0.51,
    "vent_wind": 0.51, "energy_screen": 0.51, "blackout_screen": 0.51, "heating_setpoint": 0.51, "co2_setpoint": 0.51,
}  # fmt: skip
"""Half a step of the coarsest layout; elsewhere a tenth."""


def export_of(folder: Path) -> Path:
    return next(path for path in folder.iterdir() if path.name.startswith("export"))


@pytest.fixture
def copied(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The export alone, in a folder of its own."""
    source = export_of(request.param)
    (tmp_path / source.name).write_bytes(source.read_bytes())
    return tmp_path / source.name


@pytest.mark.parametrize(
    ("folder", "copied"), [(one, one) for one in FOLDERS], indirect=["copied"], ids=lambda p: p.name
)
def test_a_layout_is_understood_and_reads_as_the_truth(
    folder: Path, copied: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = shlex.split((folder / "options.txt").read_text())
    status = main(["import", str(copied), *options])
    assert (status, "\nopen: " in capsys.readouterr().out) == ((2, True) if folder.name in OPEN else (0, False))
    told = (copied.parent / "export.mapping.yaml").read_text()
    assert told == (folder / "mapping.yaml").read_text()
    table = read_log(copied).telemetry
    assert len(table) == len(TRUTH)
    np.testing.assert_array_equal(table.time, TRUTH.time)
    for name, values in table.columns.items():
        if name in TRUTH and name not in ("lamp_on", "rain"):
            np.testing.assert_allclose(values, TRUTH[name], atol=ROUNDED.get(name, 0.06), err_msg=name)
    if "lamp_on" in table:
        np.testing.assert_array_equal(table["lamp_on"] > 0.5, TRUTH["lamp_power"] > 1.0)


def test_there_are_as_many_layouts_as_the_documentation_says() -> None:
    assert len(FOLDERS) >= 15
    assert all((folder / "ORIGIN.md").is_file() for folder in FOLDERS)
