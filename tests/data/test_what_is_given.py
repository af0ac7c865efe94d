"""The functions that a researcher types say in one line what is right where they are given something else."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import pandas as pd
import pytest

from igrow import trainer
from igrow.core.errors import IgrowError
from igrow.trainer import FittedModel, Log, prepare_log
from tests.virtual_log import SITE, virtual_log

ROAD: Any = trainer
"""Whose functions are given what no type checker lets pass."""


@pytest.fixture(scope="module")
def log() -> Log:
    return prepare_log(virtual_log(8, seed=1, step=3600.0), SITE)


@pytest.mark.parametrize(
    "start",
    [
        "2020-02-03", "2020-02-03T00:00:00Z", datetime.date(2020, 2, 3), datetime.datetime(2020, 2, 3),
        datetime.datetime(2020, 2, 3, 1, tzinfo=ZoneInfo("Europe/Amsterdam")), pd.Timestamp("2020-02-03"),
        pd.Timestamp("2020-02-03", tz="UTC"), np.datetime64("2020-02-03"),
    ],
    ids=repr,
)  # fmt: skip
def test_a_part_of_a_log_is_taken_by_any_kind_of_time(log: Log, start: Any) -> None:
    assert log.select(start).telemetry.time[0] == np.datetime64("2020-02-03T00:00:00")
    assert log.select(end=start).telemetry.time[-1] == np.datetime64("2020-02-02T23:00:00")


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda log, model: log.select(5), "5 is no time: a numpy.datetime64"),
        (lambda log, model: log.select("april"), "'april' is no time: 2020-02-01"),
        (lambda log, model: log.without("lamps"), "'lamps' is no quantity; this log has outdoor_temperature"),
        (lambda log, model: ROAD.read_log(log.to_pandas()), "a path is needed, not a DataFrame: prepare_log"),
        (lambda log, model: ROAD.read_log(None), "a path is needed, not a NoneType"),
        (lambda log, model: ROAD.prepare_log(log.to_pandas()), "a Telemetry is needed, not a DataFrame"),
        (lambda log, model: ROAD.calibrate("log.csv"), "a Log is needed, not a str: read_log"),
        (lambda log, model: ROAD.calibrate(log.telemetry), "a Log is needed, not a Telemetry: read_log"),
        (lambda log, model: ROAD.diagnose(model, log), "a Log is needed, not a FittedModel: read_log"),
        (lambda log, model: ROAD.diagnose(log, "bundle"), "a FittedModel is needed, not a str: calibrate"),
        (lambda log, model: ROAD.diagnose(log, model, without="wind"), "no effect is called 'wind'"),
        (lambda log, model: ROAD.export("bundle", "out"), "a FittedModel is needed, not a str: calibrate"),
        (lambda log, model: ROAD.compare({}, log), "no simulator is given"),
        (lambda log, model: ROAD.compare([model], "log.csv"), "a Log is needed, not a str"),
    ],
)
def test_something_else_is_refused_in_one_line(log: Log, call: Callable[[Log, FittedModel], Any], said: str) -> None:
    with pytest.raises(IgrowError) as refused:
        call(log, FittedModel.described(SITE))
    assert str(refused.value).startswith(said)
    assert "\n" not in str(refused.value)
