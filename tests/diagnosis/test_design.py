"""The design's columns are found by name, and its blocks with a prior are the model under which nothing is missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.trainer.data import Log
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis import recalibration
from igrow.trainer.diagnosis.candidates import Candidate
from igrow.trainer.diagnosis.design import Design, prepare
from igrow.trainer.diagnosis.knowledge import knowledge_of
from igrow.trainer.diagnosis.rules import DEFAULT, HOUR
from igrow.trainer.diagnosis.structure import disagreement
from tests.diagnosis.conftest import model_in_force
from tests.diagnosis.synthetic_design import make_design
from tests.virtual_log import SITE


def prepared(log: Log, interval: float = HOUR, **more: object) -> Design:
    known = knowledge_of(model_in_force(), SITE, DEFAULT)
    record = log.record(0.0)
    options = {"discrepancy": {}, "interval": interval} | more
    split = split_days(record, SITE.longitude)
    return prepare(record, split, known.short_prior, {}, SITE.longitude, DEFAULT, **options)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def quiet(quiet_log: Log) -> Design:
    return prepared(quiet_log, discrepancy={"co2_offset": 10.0}, directions=[{"heat:cold weather": 0.5}, {}])


def test_columns_are_found_by_the_name_of_their_block_and_their_label() -> None:
    shapes = (Candidate("lamp_heat", ()), Candidate("pipe_lag", (("time_constant", 10.0),)))
    design = make_design(candidates=(*shapes, Candidate("pipe_lag", (("time_constant", 25.0),))), parameters=2)
    assert design.columns("residual") == [0]
    assert design.columns("parameter") == [1, 2]
    assert design.columns("parameter:p1") == [2]
    assert design.columns("effect:pipe_lag") == [4, 5]
    assert design.columns("effect:pipe_lag:time_constant=25") == [5]
    # No effect's name is taken for the beginning of another's.
    assert design.columns("effect:pipe") == []
    with pytest.raises(KeyError):
        design.block("wind")


def test_the_null_holds_the_blocks_that_have_a_prior() -> None:
    design = make_design(parameters=2, discrepancy=True)
    null = design.null_model()
    assert list(null.base) == [*design.columns("parameter"), *design.columns("discrepancy")]
    np.testing.assert_array_equal(null.precision, np.eye(3))
    # The discrepancy of the calibration is expected to be there, once.
    np.testing.assert_array_equal(null.mean, [0.0, 0.0, 1.0])
    assert not design.transferred
    assert make_design().transferred


def test_every_column_of_a_log_has_a_label_and_a_place(quiet: Design) -> None:
    assert sum(len(block) for block in quiet.blocks.values()) == len(quiet.values)
    assert all(len(block.labels) == len(block) for block in quiet.blocks.values())
    assert quiet.block("parameter").labels == quiet.prior.names
    assert len(quiet.columns("effect:wind_infiltration")) == 4
    assert [one.key for one in quiet.patterns] == list(quiet.block("pattern").labels)
    assert (len(quiet.block("discrepancy")), len(quiet.block("nuisance")), len(quiet.block("drift"))) == (1, 2, 0)


def test_discrepancy_and_nuisance_are_sums_of_the_columns_that_they_name(quiet: Design) -> None:
    (offset,), (known,) = quiet.columns("effect:co2_offset"), quiet.columns("discrepancy")
    # The one is taken where the search began, the other at the recalibrated parameters.
    scale = np.abs(quiet.values[known]).max()
    np.testing.assert_allclose(quiet.values[known], 10.0 * quiet.values[offset], atol=0.1 * scale)
    cold, empty = quiet.columns("nuisance")
    (pattern,) = quiet.columns("pattern:heat:cold weather")
    scale = np.abs(quiet.values[cold]).max()
    np.testing.assert_allclose(quiet.values[cold], 0.5 * quiet.values[pattern], atol=0.1 * scale)
    assert not quiet.values[empty].any()


def test_an_effect_that_is_left_out_or_active_is_no_candidate(quiet_log: Log) -> None:
    design = prepared(quiet_log, without=["wind_infiltration"])
    assert design.columns("effect:wind_infiltration") == []
    assert design.columns("effect:screen_gap")


def test_means_over_intervals_leave_out_what_is_not_whole() -> None:
    values = np.arange(10.0)
    np.testing.assert_array_equal(recalibration.averaged(values, 900.0, 3600.0), [1.5, 5.5])
    np.testing.assert_array_equal(recalibration.averaged(values, 900.0, 900.0), values)


def test_an_interval_counts_only_if_every_balance_was_seen_in_all_of_it(quiet: Design) -> None:
    line = quiet.line
    weight = np.ones_like(line.runs.weight)
    weight[1, 0, 5] = False
    runs = replace(line.runs, weight=weight)
    average = recalibration.averaging(replace(line, runs=runs), HOUR, DEFAULT)
    assert average.balances == (0, 1, 2)
    assert not average.observed[0, 1]
    assert average.observed.sum() == average.observed.size - 1
    # A quantity that is hardly ever measured is left out, and costs no interval.
    weight[1] = False
    assert recalibration.averaging(replace(line, runs=runs), HOUR, DEFAULT).balances == (0, 2)


def test_the_number_of_intervals_follows_their_length(quiet_log: Log) -> None:
    assert prepared(quiet_log).observed.shape[1] == 24
    steps = prepared(quiet_log, 900.0)
    assert steps.observed.shape[1] == 96
    assert steps.time_steps


def test_time_steps_and_hours_agree_where_the_structure_is_right(quiet_log: Log) -> None:
    assert disagreement(prepared(quiet_log), prepared(quiet_log, 900.0)) <= DEFAULT.largest_disagreement


def test_time_steps_and_hours_disagree_where_fast_masses_are_missing(quiet_log: Log) -> None:
    from scipy.signal import lfilter

    # A second mass that the balances do not have: half of every move arrives within two hours only.
    slow = {
        name: 0.5 * values + 0.5 * lfilter([0.12], [1.0, -0.88], values, zi=[0.88 * values[0]])[0]
        for name, values in quiet_log.telemetry.columns.items()
        if name in {"air_temperature", "air_humidity", "air_co2"}
    }
    moved = quiet_log.with_columns(slow)
    assert disagreement(prepared(moved), prepared(moved, 900.0)) > DEFAULT.largest_disagreement
