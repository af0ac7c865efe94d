"""What a calibration log says that its model lacks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.diagnosis.omission import Told, learned
from igrow.core.bundle import EffectRecord, Estimate, HeldOutError
from igrow.core.language import speak
from igrow.core.simulator.hybrid.nominal import site_record
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.diagnosis import DEFAULT
from igrow.trainer.diagnosis.search import history, omission
from igrow.trainer.diagnosis.search.omission import TERMS
from igrow.trainer.fit import FittedModel
from igrow.trainer.fit.climate import bounds, fit_climate, site_prior
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.omission import Omission
from igrow.trainer.report import sentences
from tests.virtual_log import GREENHOUSE, SITE, virtual_log


@pytest.fixture(scope="module")
def record() -> Record:
    return site_record(virtual_log(10, seed=3, step=900.0), SITE, 900.0)


def prior_of_it() -> Gaussian:
    """Return a prior about the greenhouse that the logs are of."""
    prior = site_prior(SITE)
    return prior.moved(np.array([GREENHOUSE[name] for name in prior.names]))


def held(*parameters: str) -> Gaussian:
    """Return the same with parameters held at their lowest values."""
    prior = prior_of_it()
    mean, deviation = prior.mean.copy(), prior.standard_deviation.copy()
    for parameter in parameters:
        place = prior.names.index(parameter)
        mean[place], deviation[place] = PARAMETERS[parameter].low, 1e-6 * PARAMETERS[parameter].value
    return Gaussian(prior.names, mean, np.diag(deviation**2))


def test_a_parameter_that_was_held_is_not_free_again_when_the_log_is_asked() -> None:
    known = history.physical_prior(SITE, held("leakage_wind"))
    assert known.values["leakage_wind"] == 0.0
    assert known.deviations["leakage_wind"] < 1e-6
    assert known.deviations["leakage_still"] == site_prior(SITE).deviations["leakage_still"]


def test_a_term_that_was_taken_out_gains_and_one_that_is_there_does_not(record: Record) -> None:
    whole = omission.gains_of(record, SITE, prior_of_it(), DEFAULT)
    lacking = omission.gains_of(record, SITE, held("transpiration_night_share"), DEFAULT)
    assert set(whole) <= set(TERMS)
    assert whole["night_transpiration"] < 5.0
    assert lacking["night_transpiration"] > whole["night_transpiration"] + 20.0
    assert max(lacking, key=lacking.__getitem__) == "night_transpiration"


@pytest.mark.slow
def test_a_term_that_hides_behind_a_larger_one_is_named_beside_it() -> None:
    month = site_record(virtual_log(28, seed=3), SITE, 3600.0)
    lacking = held("transpiration_night_share", "leakage_wind")
    found = omission.examine(month, SITE, lacking, replace(DEFAULT, most_omission_fits=2))
    assert found is not None
    assert {effect.name for effect in found.effects} == {"night_transpiration", "wind_infiltration"}
    assert np.mean([one.after / one.before for one in found.errors if one.horizon == omission.DAY]) < 0.9


def test_the_size_of_a_term_is_fitted_beside_the_parameters(record: Record) -> None:
    assert [float(edge[0]) for edge in bounds(("wind_infiltration:air_changes",))] == [0.0, 1.0]
    prior = held("leakage_wind")
    joint = Gaussian(
        (*prior.names, "wind_infiltration:air_changes"),
        np.append(prior.mean, 0.03),
        np.diag(np.append(prior.standard_deviation, 0.09) ** 2),
    )
    found = fit_climate([(record, None)], joint, {"wind_infiltration": {"exponent": 1.0}})
    # It stands in for the leakage that was taken out: 0.06 air changes per hour for each m/s.
    assert found.values["wind_infiltration:air_changes"] == pytest.approx(0.06, abs=0.03)
    assert found.values["leakage_wind"] == 0.0


def test_a_term_that_gains_little_in_the_linear_model_is_not_fitted() -> None:
    rules = replace(DEFAULT, most_omission_fits=2, least_omission_gain=5.0)
    gains = {"lamp_heat": 9.0, "sky_cooling": 4.0, "soil_respiration": 30.0, "screen_gap": 12.0}
    assert [one.name for one in omission._promising(gains, rules)] == ["soil_respiration", "screen_gap"]
    assert omission._promising({"sky_cooling": 4.0}, rules) == []


def test_a_fall_is_that_of_a_day_ahead_and_the_mean_of_all_quantities() -> None:
    errors = [
        HeldOutError("air_temperature", "24_h", 1.0, 0.8, "degC"),
        HeldOutError("air_co2", "24_h", 50.0, 50.0, "ppm"),
        HeldOutError("air_co2", "1_h", 50.0, 10.0, "ppm"),
    ]
    assert omission.fall(errors) == pytest.approx(0.1)
    assert omission.fall([]) == 0.0


def test_what_a_term_must_remove_is_more_than_where_nothing_was_taken_out() -> None:
    told = [Told("a", "", (), fall, 1.0) for fall in (0.0, 0.012, 0.0, 0.021)]
    assert learned(told) == pytest.approx(0.02, abs=0.002)


def test_a_model_is_completed_only_when_it_is_asked() -> None:
    model = FittedModel.described(SITE)
    estimates = {"air_changes": Estimate(0.05, 0.03, 0.07, "h-1 (m s-1)-1"), "exponent": Estimate(1.0, 0.5, 2.0, "1")}
    effect = EffectRecord("wind_infiltration", "process", estimates, ("heat", "vapour", "co2"))
    errors = (HeldOutError("air_temperature", "24_h", 1.2, 0.8, "degC"),)
    lacking = replace(
        model,
        omission=Omission((effect,), held("leakage_wind"), errors),
        errors=(HeldOutError("air_temperature", "24_h", 2.0, 1.2, "degC"),),
    )
    assert lacking.active_effects == {}
    whole = lacking.completed()
    assert whole.active_effects["wind_infiltration"]["air_changes"] == 0.05
    assert whole.posterior.values["leakage_wind"] == 0.0
    assert [(one.before, one.after) for one in whole.errors] == [(2.0, 0.8)]
    assert model.completed() is model
    assert lacking.omission is not None
    told = sentences.omission(lacking.omission, speak("en"), completed=False)
    assert "0.05" in told[0]
    assert "1.2" in told[1]
    assert "0.8" in told[1]
    assert told[-1] != sentences.omission(lacking.omission, speak("en"), completed=True)[-1]
    # An error of 1.2 K is none of 34 degF.
    assert "2.2" in sentences.omission(lacking.omission, speak("en", units="us"), completed=False)[1]
    assert " K" in told[1]
