"""What a model says of a greenhouse depends on whether it was calibrated there."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from igrow.core.bundle import EffectRecord, Estimate, Onset, default_bundle_folder, read_bundle
from igrow.core.site import Greenhouse, Site
from igrow.trainer.cli import main
from igrow.trainer.data import Log
from igrow.trainer.diagnosis.knowledge import (
    ActiveTerm,
    Knowledge,
    activate,
    active_term,
    clipped,
    drift,
    knowledge_of,
)
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.exporting import export, read_model
from tests.diagnosis.conftest import model_in_force
from tests.virtual_log import SITE

HERE = Site(name="here", latitude=52.0, longitude=4.5)
LOW = replace(HERE, greenhouse=Greenhouse(mean_height=2.5))


def known_of(site: Site, folder: Path | None = None) -> Knowledge:
    return knowledge_of(read_model(read_bundle(folder or default_bundle_folder()), site), site, DEFAULT)


def test_at_home_the_posterior_is_widened_by_the_drift() -> None:
    model = model_in_force()
    known = knowledge_of(model, SITE, DEFAULT)
    share = drift(model.posterior.values, DEFAULT.parameter_drift, DEFAULT)
    exact = np.hypot(model.posterior.standard_deviation, share)
    np.testing.assert_allclose(known.prior.standard_deviation, exact)
    np.testing.assert_array_equal(known.prior.mean, model.posterior.mean)


def test_of_a_transferred_model_less_is_known_and_its_correlations_stay() -> None:
    model = model_in_force()
    covariance = model.posterior.covariance.copy()
    covariance[0, 1] = covariance[1, 0] = 0.9 * np.sqrt(covariance[0, 0] * covariance[1, 1])
    transferred = replace(model, posterior=replace(model.posterior, covariance=covariance), calibrated_on="there")
    known = knowledge_of(transferred, SITE, DEFAULT)
    change = drift(model.posterior.values, DEFAULT.transferred_drift, DEFAULT)
    exact = np.sqrt(knowledge_of(model, SITE, DEFAULT).prior.standard_deviation ** 2 + change**2)
    np.testing.assert_allclose(known.prior.standard_deviation, exact)
    assert known.prior.covariance[0, 1] == pytest.approx(covariance[0, 1])
    assert known.transferred
    # What physics lets change says nothing of a greenhouse that is another one.
    assert known.by_physics(DEFAULT) is known.prior


def test_a_small_parameter_drifts_by_a_share_of_its_usual_value() -> None:
    (moved,) = drift({"leakage_wind": 0.0}, 0.1, DEFAULT)
    (usual,) = drift({"leakage_wind": model_in_force().posterior.values["leakage_wind"]}, 0.1, DEFAULT)
    assert moved == pytest.approx(DEFAULT.least_drift_share * usual, rel=0.05)


def test_values_beyond_their_bounds_are_brought_back() -> None:
    assert clipped(["transmissivity"], np.array([7.0]))["transmissivity"] <= 1.0


def test_an_effect_of_a_bundle_is_active_from_its_beginning_on(quiet_log: Log) -> None:
    record = quiet_log.record(0.0)
    began = datetime(2020, 2, 11, tzinfo=UTC)
    effect = EffectRecord(
        "humidity_drift", "sensor", {"drift": Estimate(6.0, 5.0, 7.0, "%")}, onset=Onset(began, began, began)
    )
    term = active_term(effect)
    assert (term.amplitude, term.onset) == (6.0, np.datetime64("2020-02-11T00:00:00"))
    amplitude = activate(record, [term])["humidity_drift"]["drift"]
    # Times the record's own age: the effect counts from its own beginning.
    grown = amplitude * record.inputs["elapsed_days"]
    assert grown[: 10 * 96 + 1].max() == 0.0
    assert grown[12 * 96] == pytest.approx(2.0 * 6.0)


def test_an_effect_without_a_beginning_is_active_all_along(quiet_log: Log) -> None:
    active = activate(quiet_log.record(0.0), [ActiveTerm("pipe_lag", 0.5, {"time_constant": 20.0})])
    assert active == {"pipe_lag": {"exchange": 0.5, "time_constant": 20.0}}


def test_the_built_in_bundle_follows_a_sites_description() -> None:
    same, low = known_of(HERE), known_of(LOW)
    assert same.transferred
    wind = low.prior.values["leakage_wind"] / same.prior.values["leakage_wind"]
    assert wind == pytest.approx(2.0, rel=0.01)


def test_a_bundle_knows_the_greenhouse_it_was_calibrated_on() -> None:
    manifest = read_bundle(default_bundle_folder()).manifest
    own = known_of(replace(HERE, name=manifest.site))
    assert not own.transferred
    assert own.posterior.deviations["leakage_wind"] == pytest.approx(
        manifest.parameters["leakage_wind"].standard_deviation
    )


def test_an_exported_bundle_is_known_as_the_one_it_came_from(tmp_path: Path) -> None:
    export(
        read_model(read_bundle(default_bundle_folder()), LOW),
        tmp_path / "low",
        created=datetime(2020, 1, 1, tzinfo=UTC),
    )
    direct, through = known_of(LOW), known_of(LOW, tmp_path / "low")
    assert through.transferred
    assert through.prior.values == pytest.approx(direct.prior.values)
    np.testing.assert_allclose(through.prior.covariance, direct.prior.covariance, rtol=1e-6, atol=1e-12)


def test_the_same_greenhouse_under_another_name_stays_calibrated(tmp_path: Path) -> None:
    site = tmp_path / "site.yaml"
    site.write_text("name: here\nlatitude: 52.0\nlongitude: 4.5\n")
    for folder, options in (("other", []), ("same", ["--same-greenhouse"])):
        assert main(["export", "--site", str(site), "--out", str(tmp_path / folder), *options]) == 0
        assert known_of(HERE, tmp_path / folder).transferred != bool(options)
