"""The five lines of the road can be typed as they stand, and cost nothing until they are used."""

from __future__ import annotations

import subprocess
import sys

import pytest

import igrow.trainer
from igrow.trainer import calibrate, diagnose, export, publish, read_log


def test_every_name_of_the_road_is_a_function_whatever_was_imported_before() -> None:
    import igrow.trainer.calibration
    import igrow.trainer.diagnosis.diagnose
    import igrow.trainer.exporting.bundle

    for name in ("read_log", "calibrate", "diagnose", "export", "publish"):
        assert callable(getattr(igrow.trainer, name)), name
    assert all(map(callable, (read_log, calibrate, diagnose, export, publish)))
    assert set(igrow.trainer.__all__) == set(dir(igrow.trainer))


def test_importing_the_trainer_loads_nothing_heavy() -> None:
    code = "import igrow.trainer, sys; print([m for m in ('torch', 'scipy', 'pandas', 'onnx') if m in sys.modules])"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "[]"


def test_a_name_that_is_not_of_the_road_is_told() -> None:
    with pytest.raises(AttributeError, match="no attribute 'train'"):
        _ = igrow.trainer.train
