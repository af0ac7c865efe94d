"""Errors of free runs over horizons, on a log whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.simulator.hybrid.nominal import site_record
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.fit.evaluation import evaluate, starts_within
from tests.virtual_log import GREENHOUSE, SITE, virtual_log


@pytest.fixture(scope="module")
def record() -> Record:
    return site_record(virtual_log(10, seed=4), SITE, 300.0)


@pytest.mark.slow
def test_the_true_model_has_no_error_but_noise(record: Record) -> None:
    values = GREENHOUSE
    errors = evaluate(record, values, {}, ("1_h", "24_h"), np.arange(len(record)) > 2 * 288)
    assert errors["air_temperature"]["24_h"].mae < 0.2
    assert errors["air_temperature"]["24_h"].mae_low <= errors["air_temperature"]["24_h"].mae
    assert errors["air_temperature"]["24_h"].persistence > 0.2


def test_a_run_counts_only_if_all_its_rows_are_allowed(record: Record) -> None:
    allowed = np.zeros(len(record), dtype=bool)
    allowed[500:900] = True
    starts = starts_within(record, allowed, 288, 7)
    assert len(starts) > 3
    assert starts.min() >= 500
    assert (starts + 288).max() < 900


def test_an_unknown_horizon_is_refused_in_one_line(record: Record) -> None:
    with pytest.raises(IgrowError, match="'2_h' is not known: 1_step, 1_h"):
        evaluate(record, GREENHOUSE, {}, ("2_h",))
