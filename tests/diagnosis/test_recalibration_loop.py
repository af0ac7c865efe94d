from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.site import Site
from igrow.trainer.cli.recalibrate import read_history, recalibrate, relative_gain
from igrow.trainer.diagnosis import Diagnosis

SITE = Site(name="house", latitude=52.0, longitude=4.5)
NOON = datetime(2020, 3, 1, 12, tzinfo=UTC)


def refuse(folder: Path) -> None:
    pytest.fail(f"{folder} was published")


def diagnosis(deployed: float, corrected: float) -> Diagnosis:
    start = np.datetime64("2020-01-01T00:00:00")
    errors = {"air_temperature": {"24_h": {"deployed": deployed, "recalibrated": deployed, "corrected": corrected}}}
    return Diagnosis("house", "named", start, start, 20, 8, (), errors, ())


def test_a_site_without_telemetry_is_an_error_in_its_history_and_publishes_nothing(tmp_path: Path) -> None:
    turn = recalibrate(SITE, tmp_path / "exchange", tmp_path / "state", refuse, now=NOON)
    assert turn.verdict == "error"
    assert not turn.published
    (line,) = read_history(tmp_path / "state" / "house")
    assert line["time"] == "2020-03-01T12:00:00Z"
    assert "no telemetry of site house" in line["note"]


def test_a_site_waits_for_its_own_pace(tmp_path: Path) -> None:
    exchange, state = tmp_path / "exchange", tmp_path / "state"
    recalibrate(SITE, exchange, state, refuse, now=NOON)
    early = recalibrate(SITE, exchange, state, refuse, now=NOON + timedelta(days=3))
    late = recalibrate(SITE, exchange, state, refuse, now=NOON + timedelta(days=7))
    assert early.verdict == "waiting"
    assert "2020-03-08 12:00" in early.note
    assert late.verdict == "error"
    assert len(read_history(state / "house")) == 2


def test_the_gain_is_negative_where_the_new_model_is_worse_on_unseen_days() -> None:
    assert relative_gain(diagnosis(1.0, 0.75)) == pytest.approx(0.25)
    assert relative_gain(diagnosis(1.0, 1.5)) == pytest.approx(-0.5)


def test_an_unknown_effect_to_leave_out_is_refused_with_the_known_ones() -> None:
    from igrow.trainer.diagnosis import diagnose
    from tests.diagnosis.conftest import deployed_model, greenhouse_log

    with pytest.raises(IgrowError, match="no effect is called 'wind'"):
        diagnose(greenhouse_log(1, days=8), SITE, deployed_model(), without=["wind"])
