"""Simulators side by side on one log."""

from __future__ import annotations

from dataclasses import replace

import pytest

from igrow.core.bundle import Span, default_bundle_folder
from igrow.core.errors import IgrowError
from igrow.core.local_time import utc_datetime
from igrow.trainer.data import prepare_log
from igrow.trainer.fit import FittedModel
from igrow.trainer.fit.evaluation import evaluate
from igrow.trainer.scoring.comparison import compare
from tests.diagnosis.conftest import model_in_force
from tests.virtual_log import SITE, virtual_log


def test_simulators_are_compared_by_the_errors_that_each_has_alone() -> None:
    log = prepare_log(virtual_log(6, seed=2, step=900.0), SITE)
    good, plain = model_in_force(), FittedModel.described(SITE)
    found = compare({"good": good, "plain": plain, "built in": default_bundle_folder()}, log, ("1_h",))
    alone = evaluate(log.record(0.0), good.posterior.values, {}, ("1_h",))
    assert found.scores["good"]["air_temperature"]["1_h"].mae == alone["air_temperature"]["1_h"].mae
    assert found.scores["built in"]["air_temperature"]["1_h"].mae > alone["air_temperature"]["1_h"].mae
    lines = repr(found).splitlines()
    assert lines[0].split()[-3:] == ["plain", "built", "in"]
    assert len(lines) == 4
    table = found.to_pandas()
    assert len(table) == 9
    assert set(table["simulator"]) == {"good", "plain", "built in"}
    assert table["mae"].to_list() == [row["mae"] for row in found.rows()]


def test_a_simulator_is_judged_on_the_days_that_it_was_not_calibrated_on() -> None:
    log = prepare_log(virtual_log(6, seed=2, step=900.0), SITE)
    time, known = log.telemetry.time, replace(model_in_force(), alignment=0.0)
    seen = replace(known, training_span=Span(utc_datetime(time[0]), utc_datetime(time[2 * 96])))
    found = compare({"seen": seen, "known": known}, log, ("1_h",)).scores
    later = compare([known], log.select(time[2 * 96 + 1]), ("1_h",)).scores["1 virtual"]
    assert found["seen"] == later != found["known"]
    with pytest.raises(IgrowError, match="give a later one"):
        compare([seen], log.select(None, time[96]), ("1_h",))


def test_simulators_without_names_get_some() -> None:
    log = prepare_log(virtual_log(4, seed=2, step=900.0), SITE)
    found = compare([model_in_force(), FittedModel.described(SITE)], log, ("1_h",))
    assert list(found.scores) == ["1 virtual", "2 described"]
    assert found.scores["1 virtual"]["air_co2"]["1_h"].mae == pytest.approx(
        {row["quantity"]: row["mae"] for row in found.rows() if row["simulator"] == "1 virtual"}["air_co2"]
    )
