"""Figures count what they say, and models of another greenhouse are asked as such."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.diagnosis import figures
from benchmarks.diagnosis.cases import Case
from benchmarks.diagnosis.figures import Row
from benchmarks.diagnosis.greenhouses import others
from benchmarks.diagnosis.logs import Reference
from benchmarks.diagnosis.scoring import Outcome
from benchmarks.diagnosis.transferred import CASES_SEED, MODELS, SEED, by_each
from benchmarks.results import RESULTS
from igrow.core.greenhouse import generate_weather
from igrow.trainer.diagnosis import DEFAULT
from igrow.trainer.diagnosis.knowledge import knowledge_of
from igrow.trainer.diagnosis.learned.null_gains import NullGains
from igrow.trainer.fit.model import FittedModel

LEAK = Case("leak", "single", "greenhouse", 1, ("wind_infiltration",), 1.0)
NAMED = Outcome(
    case=LEAK, verdict="named", found=("wind_infiltration",), confounded=(("wind_infiltration",),), relative_size=0.7,
    relative_flux=0.9, covered=True, half_width=0.5, onset_error=None, deployed=3.0, recalibrated=2.0, corrected=1.25,
    perfect=1.0, expected_gain=15.0, known_gain=90.0, seconds=1.0,
)  # fmt: skip
MISSED = replace(
    NAMED, verdict="nothing", found=(), confounded=(), relative_size=None, relative_flux=None, covered=None,
    half_width=None, recalibrated=1.05, corrected=1.05, expected_gain=9.0,
)  # fmt: skip
NULL = replace(MISSED, case=Case("null", "nothing", "greenhouse", 2), expected_gain=None, known_gain=None)
FALSE = replace(NULL, verdict="unexplained", found=("discrepancy",))


def figure(rows: list[Row], what: str) -> tuple[float, int]:
    """Return a figure and its cases."""
    (row,) = (one for one in rows if one.what == what)
    return row.value, row.cases


def test_what_is_told_where_nothing_is_missing_is_a_false_claim() -> None:
    rows = figures.false_claims([NAMED, NULL, NULL, FALSE])
    assert figure(rows, "false claims, nothing missing") == pytest.approx((1 / 3, 3))
    value, cases = figure(rows, "false claims, wrong noise")
    assert (math.isnan(value), cases) == (True, 0)


def test_names_are_counted_apart_where_a_cause_matters() -> None:
    rows = figures.names([NAMED, MISSED, FALSE])
    assert figure(rows, "right cause first, ENR 1") == (0.5, 2)
    assert figure(rows, "right first, where recalibration errs a tenth more") == (1.0, 1)
    assert figure(rows, "right first, where recalibration does not") == (0.0, 1)
    assert figure(rows, "right cause first, where a name was given") == (1.0, 1)


def test_the_oracle_counts_what_gains_enough() -> None:
    rows = figures.oracle([NAMED, MISSED], NullGains({"wind_infiltration": 20.0}, least=10.0))
    assert [(row.value, row.cases) for row in rows[:3]] == [(0.5, 2), (1.0, 2), (0.0, 2)]


def test_sizes_are_those_of_what_was_named() -> None:
    rows = figures.estimates([NAMED, MISSED, NULL])
    assert figure(rows, "size, median relative error") == pytest.approx((0.3, 1))
    # Of the 1.0 and .05 that the truth takes off beyond recalibration .75 and nothing.
    assert figure(rows, "recoverable error recovered") == pytest.approx((0.75 / 1.05, 2))


def test_a_neighbours_model_and_the_built_in_bundle_are_models_of_another_greenhouse() -> None:
    ((name, greenhouse),) = others(1, 1).items()
    model = replace(FittedModel.described(greenhouse.site), calibrated_on=name)
    start = np.datetime64("2020-04-01T00:00:00")
    log = generate_weather(start, start + np.timedelta64(1, "h"), seed=1)
    asked = by_each(LEAK, log, Reference(greenhouse, model, {}, None))
    assert list(asked) == list(MODELS)
    for _, _, one in asked.values():
        assert knowledge_of(one.model, one.greenhouse.site, DEFAULT).transferred
    assert knowledge_of(model, greenhouse.site, DEFAULT).transferred is False


def test_the_page_says_the_seeds_that_are_drawn() -> None:
    assert RESULTS["diagnosis-transferred"].seeds == f"{SEED} and on; cases from {CASES_SEED}"
