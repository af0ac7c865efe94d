"""What a greenhouse tells others: its log's own word on parameters and discrepancy, and no row of the log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.trainer.diagnosis import DEFAULT, learned_from
from igrow.trainer.diagnosis.design.amplitudes import omission
from igrow.trainer.fit import FittedModel
from igrow.trainer.fit.discrepancy import Discrepancy
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.population import Learned, learn_population
from tests.virtual_log import SITE

EFFECT, PATTERN = "lamp_heat", "heat:cold weather"


def model_that_misses(amount: float, left: float) -> FittedModel:
    """A calibrated model whose log showed an effect, in the deviation before any log, and left a pattern unseen."""
    names = ("parameter:respiration", EFFECT, PATTERN)
    scale = np.array([1.0, *omission(names[1:], DEFAULT)])
    known = Gaussian(names, scale * [0.0, amount, 0.0], np.diag(scale**2 * [0.5, left, 1.0]))
    model = FittedModel.described(SITE)
    return replace(
        model, history=Discrepancy(model.posterior.values, known, {}, 900.0, {}, np.datetime64("2020-02-01"))
    )


def test_the_discrepancy_is_shared_with_what_was_known_before_divided_out() -> None:
    told = learned_from(model_that_misses(0.6, 0.25))
    assert told.shift == {EFFECT: pytest.approx(0.8)}, "neither the parameters nor the pattern was seen"
    assert told.variance == {EFFECT: pytest.approx(1.0 / 3.0)}


def test_what_a_log_hardly_showed_is_not_shared() -> None:
    # Before the log it was known less surely than what is shared, and would seem far larger than it is.
    model = model_that_misses(0.6, 0.25)
    assert model.history is not None
    assert learned_from(replace(model, history=replace(model.history, unseen=(EFFECT,)))).shift == {}


def test_what_several_greenhouses_miss_is_expected_of_a_further_one() -> None:
    population = learn_population([Learned({EFFECT: 0.8}, {EFFECT: 0.05})] * 6)
    before = omission((EFFECT, PATTERN), DEFAULT)
    mean, deviation = population.scaled((EFFECT, PATTERN), before)
    assert 0.5 < mean[0] / before[0] < 0.8
    assert deviation[0] < before[0]
    assert (mean[1], deviation[1]) == (0.0, before[1]), "of what nobody saw nothing is known"
