"""A crop that was planted since the calibration: what it does otherwise than the one before is no fault."""

from __future__ import annotations

import datetime
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from igrow.core.telemetry import Telemetry
from igrow.trainer.data import Log
from igrow.trainer.diagnosis import circumstances, diagnose
from igrow.trainer.diagnosis.answer import wording
from igrow.trainer.diagnosis.crop import LEAVES_AND_LIGHT, has_new_crop, new_leaves, of_one_crop, with_its_drift
from igrow.trainer.diagnosis.knowledge import PARAMETER_PREFIX, knowledge_of
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.diagnosis.search import rounds
from igrow.trainer.fit import FittedModel
from igrow.trainer.fit.discrepancy import Discrepancy
from igrow.trainer.fit.gaussian import Gaussian
from tests.diagnosis.conftest import STEP, model_in_force

PLANTED = np.datetime64("2020-03-10T00:00:00", "s")


def log_of(log: Log, first: int, last: int) -> Log:
    """An hourly log from so many days after the planting to so many."""
    time = PLANTED + np.arange(24 * first, 24 * last) * np.timedelta64(1, "h")
    site = log.known_site
    crop = replace(site.crop, planting_date=PLANTED.astype("datetime64[D]").item())
    return replace(log, telemetry=Telemetry(time, {}), site=replace(site, crop=crop))


def calibrated(middle: np.datetime64) -> FittedModel:
    """A model whose history was learned from weeks about a time, at other steps than these logs have."""
    model = model_in_force()
    posterior = model.posterior
    keys = tuple(PARAMETER_PREFIX + name for name in posterior.names)
    known = Gaussian(keys, np.zeros(len(keys)), posterior.covariance)
    return replace(model, history=Discrepancy(posterior.values, known, {}, STEP, {}, middle))


@pytest.mark.parametrize(
    ("first", "last", "kept", "said"),
    [
        (-20, 10, (0, 10), "the days before are left out"),
        (-20, 5, (-20, 0), "less than a week ago"),
        (-4, 4, (-4, 4), ""),
        (1, 20, (1, 20), ""),
        (-20, -1, (-20, -1), ""),
    ],
)
def test_a_log_is_of_one_crop(quiet_log: Log, first: int, last: int, kept: tuple[int, int], said: str) -> None:
    found, notes = of_one_crop(log_of(quiet_log, first, last), DEFAULT)
    assert (found.telemetry.time == log_of(quiet_log, *kept).telemetry.time).all()
    assert said in "".join(notes)
    assert bool(notes) is bool(said)


def test_a_crop_is_new_where_the_calibration_was_mostly_of_another(quiet_log: Log) -> None:
    before, after = (calibrated(PLANTED + np.timedelta64(days, "D")) for days in (-30, 30))
    later, earlier = log_of(quiet_log, 1, 20), log_of(quiet_log, -20, -1)
    for log, model, new in ((later, before, True), (later, after, False), (earlier, before, False)):
        assert has_new_crop(log.telemetry.time, log.known_site, model) is new
    assert not has_new_crop(later.telemetry.time, later.known_site, model_in_force())


@pytest.mark.slow
def test_of_a_new_crop_nothing_is_named_and_the_model_follows_it(leaky_log: Log) -> None:
    site = leaky_log.known_site
    planted = leaky_log.telemetry.time[0].astype("datetime64[D]").item() - datetime.timedelta(days=100)
    crop = replace(site.crop, planting_date=planted)
    log = replace(leaky_log, site=replace(site, crop=crop))
    model = calibrated(np.datetime64(f"{planted}T00:00:00") - np.timedelta64(60, "D"))
    result = diagnose(log, model)
    assert (result.verdict, result.findings) == ("nothing", ())
    assert wording.NEW_CROP in result.notes
    assert {"leaf_area_transpiration", "night_transpiration", "photosynthesis_decline"} <= set(result.untestable)
    day = result.errors["air_humidity"]["24_h"]
    assert day["corrected"] == day["recalibrated"] < day["deployed"]


@pytest.mark.slow
def test_what_is_not_asked_of_a_crop_that_grew_is_said(quiet_log: Log) -> None:
    site = quiet_log.known_site
    planted = quiet_log.telemetry.time[0].astype("datetime64[D]").item() - datetime.timedelta(days=60)
    log = replace(quiet_log, site=replace(site, crop=replace(site.crop, planting_date=planted)))
    log = log.without("leaf_area_index")
    result = diagnose(log, calibrated(np.datetime64(f"{planted}T00:00:00") + np.timedelta64(20, "D")))
    assert wording.GROWN_CROP in result.notes
    assert wording.NEW_CROP not in result.notes
    assert "structure_shade" in result.untestable


@pytest.mark.slow
@pytest.mark.parametrize(("new", "few"), [(0.2, True), (0.4, False)])
def test_where_many_leaves_are_new_days_alone_tell_nothing_and_that_is_said(
    new: float, few: bool, quiet_log: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = sys.modules["igrow.trainer.diagnosis.diagnose"]  # its function has its name
    asked: list[bool] = []

    def search_of(*arguments: Any, by_days: bool, **others: Any) -> rounds.Search:
        asked.append(by_days)
        return rounds.search_of(*arguments, by_days=by_days, **others)

    monkeypatch.setattr(circumstances, "new_leaves", lambda *_: new)
    monkeypatch.setattr(module, "search_of", search_of)
    result = diagnose(quiet_log, model_in_force())
    assert asked == [few]
    assert (wording.NEW_LEAVES not in result.notes) is few


def test_crop_and_light_may_differ_by_the_leaves_that_the_calibration_has_not_seen(quiet_log: Log) -> None:
    site = log_of(quiet_log, 56, 84).known_site
    known = calibrated(PLANTED + np.timedelta64(28, "D")).history
    assert known is not None
    other = with_its_drift(DEFAULT, 1.0)
    young, usual, grown = (
        with_its_drift(DEFAULT, new_leaves(replace(known, leaf_area=then), site, 3.0)) for then in (1.5, np.nan, 2.25)
    )
    assert (other.crop_drift, other.light_drift) == (DEFAULT.new_crop_drift, DEFAULT.new_crop_drift)
    assert young.crop_drift == young.light_drift == pytest.approx(0.5 * DEFAULT.new_crop_drift)
    # Where it is not known, the usual course says what there was four weeks after the planting.
    assert DEFAULT.new_crop_drift > usual.crop_drift > 5.0 * DEFAULT.crop_drift
    # A share that the null bounds were learned of is in these already; what nobody measures may be the crop's.
    assert grown == with_its_drift(DEFAULT, new_leaves(None, site, 3.0)) == DEFAULT
    unmeasured = with_its_drift(DEFAULT, 0.25, measured=False)
    assert unmeasured == replace(DEFAULT, crop_drift=0.25 * DEFAULT.new_crop_drift)


def test_a_crop_may_differ_more_than_the_walls() -> None:
    model = model_in_force()
    another = replace(DEFAULT, crop_drift=DEFAULT.new_crop_drift)
    usual, new = (knowledge_of(model, model.site, one).prior.standard_deviation for one in (DEFAULT, another))
    wider = {name for name, one, two in zip(model.posterior.names, usual, new, strict=True) if two > 2.0 * one}
    assert {"transpiration_radiation", "transpiration_moist_air", "assimilation_light", "respiration"} <= wider
    assert not {"transmissivity", "leakage_wind", "vent_wind", "cover_heat_transfer"} & wider


def test_of_a_crop_that_may_be_another_neither_leaves_nor_light_are_asked() -> None:
    of_leaves = {"transpiration_moist_air", "assimilation_light", "respiration", "deficit_stomata_closure"}
    of_light = {"transmissivity", "lamp_radiation_share", "structure_shade", "cover_ageing"}
    assert of_leaves | of_light <= LEAVES_AND_LIGHT
    known = {"humidity_offset", "wind_infiltration", "soil_respiration", "leakage_wind", "rail_pipe_heat_transfer"}
    assert LEAVES_AND_LIGHT.isdisjoint(known)
