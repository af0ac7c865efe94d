"""The design's columns are found by name, and what is known of all of them together is the null."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from igrow.trainer.data import Log
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis.design import sensitivity
from igrow.trainer.diagnosis.design.balances import balances_of
from igrow.trainer.diagnosis.design.candidates import Candidate
from igrow.trainer.diagnosis.design.design import Design, lay_out
from igrow.trainer.diagnosis.knowledge import knowledge_of
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.fit.solver import DivergenceError
from tests.diagnosis.conftest import model_in_force
from tests.diagnosis.synthetic_design import NEVER, make_design
from tests.virtual_log import SITE


@pytest.fixture(scope="module")
def quiet(quiet_log: Log) -> Design:
    known, record = knowledge_of(model_in_force(), SITE, DEFAULT), quiet_log.record(0.0)
    return lay_out(record, split_days(record, SITE.longitude), known.prior, {}, SITE.longitude, DEFAULT)


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


def test_the_null_holds_all_that_may_be_missing_as_it_is_known() -> None:
    design = make_design(parameters=2)
    null = design.null_model()
    assert list(null.base) == [name for block in ("parameter", "effect", "pattern") for name in design.columns(block)]
    np.testing.assert_allclose(np.diag(null.precision), [1.0, 1.0, *[NEVER**-2.0] * 3])


def test_every_column_of_a_log_has_a_label_and_a_place(quiet: Design) -> None:
    assert sum(len(block) for block in quiet.blocks.values()) == len(quiet.values)
    assert all(len(block.labels) == len(block) for block in quiet.blocks.values())
    assert quiet.block("parameter").labels == quiet.prior.names
    assert len(quiet.columns("effect:wind_infiltration")) == 4
    assert [one.key for one in quiet.patterns] == list(quiet.block("pattern").labels)
    assert not any(one.is_weekly for one in quiet.patterns)


def test_a_column_without_numbers_is_said_and_hides_no_cause() -> None:
    design = make_design(seed=2)
    design.values[design.block("pattern").columns[0], 0, 3, 2] = np.nan
    with pytest.raises(DivergenceError, match="runs out of all bounds"):
        design.whitened(design.whitening)


@pytest.mark.parametrize("runaway", [np.nan, 1e274])
def test_a_log_is_not_laid_out_about_a_model_that_runs_out_of_all_bounds_a_little_further_on(
    quiet: Design, monkeypatch: pytest.MonkeyPatch, runaway: float
) -> None:
    def diverged(*asked: Any) -> Any:
        slopes = quiet.values[quiet.block("parameter").columns].copy()
        slopes[0, 0, 0, -1] = runaway
        return slopes

    monkeypatch.setattr(sensitivity, "parameter_sensitivities", diverged)
    with pytest.raises(DivergenceError, match="out of all bounds"):
        lay_out(quiet.line.record, quiet.split, quiet.prior, {}, SITE.longitude, DEFAULT)


def test_a_time_step_counts_only_if_every_balance_was_seen_in_it(quiet: Design) -> None:
    line = quiet.line
    weight = np.ones_like(line.runs.weight)
    weight[1, 0, 5] = False
    runs = replace(line.runs, weight=weight)
    balances = balances_of(replace(line, runs=runs), DEFAULT)
    assert balances.numbers == (0, 1, 2)
    assert not balances.observed[0, 5]
    assert balances.observed.sum() == balances.observed.size - 1
    assert not balances(np.ones((1, *weight.shape)))[0, :, 0, 5].any()
    # A quantity that is hardly ever measured is left out, and costs no time step.
    weight[1] = False
    assert balances_of(replace(line, runs=runs), DEFAULT).numbers == (0, 2)
