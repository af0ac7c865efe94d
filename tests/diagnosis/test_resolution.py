from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from igrow.core.telemetry import Telemetry
from igrow.trainer.data import prepare_log
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis import problem, resolution, selection
from igrow.trainer.diagnosis.problem import Problem
from tests.diagnosis.conftest import deployed_model
from tests.virtual_log import SITE


def prepared(log: Telemetry, interval: float) -> Problem:
    deployed = deployed_model()
    record = prepare_log(log, SITE).record()
    split = split_days(record, SITE.longitude)
    return problem.prepare(record, split, deployed.prior, {}, SITE.longitude, {}, interval=interval)


def disagreement(log: Telemetry) -> float:
    return resolution.disagreement(prepared(log, problem.HOUR), prepared(log, 900.0))


def test_rows_and_hours_agree_where_the_structure_is_right(quiet_log: Telemetry) -> None:
    assert disagreement(quiet_log) <= resolution.LARGEST_DISAGREEMENT


def test_rows_and_hours_disagree_where_fast_masses_are_missing(quiet_log: Telemetry) -> None:
    # A second mass that the balances do not have: half of every move arrives within two hours only.
    slow = {
        name: 0.5 * values + 0.5 * lfilter([0.12], [1.0, -0.88], values, zi=[0.88 * values[0]])[0]
        for name, values in quiet_log.columns.items()
        if name in {"air_temperature", "air_humidity", "air_co2"}
    }
    assert disagreement(quiet_log.with_columns(slow)) > resolution.LARGEST_DISAGREEMENT


def test_the_number_of_intervals_follows_their_length(quiet_log: Telemetry) -> None:
    assert prepared(quiet_log, problem.HOUR).whitening.weight.shape[1] == 24
    assert prepared(quiet_log, 900.0).whitening.weight.shape[1] == 96


@pytest.mark.parametrize(("gains", "middle"), [([1.0, 3.0, 3.0, 3.0, 2.0], 2), ([5.0, 1.0], 0)])
def test_of_several_equal_beginnings_the_middle_one_is_taken(gains: list[float], middle: int) -> None:
    assert selection.middle_of_best(np.array(gains)) == middle
