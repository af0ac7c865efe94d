"""A bundle's own names tell which setpoints it takes; those of sites that take the usual ones are as they were."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from igrow.core.arrays import Floats
from igrow.core.bundle import Bundle, default_bundle_folder, read_bundle
from igrow.core.quantities import SETPOINTS, USUAL_SETPOINTS
from igrow.core.simulator import actuation
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Greenhouse, Site
from igrow.trainer.exporting import export, read_model
from igrow.trainer.fit.model import FittedModel
from tests.setpoint_tables import OPTIONAL

SITE = Site("damp", 52.0, 4.5, setpoints=SETPOINTS)
START = np.datetime64("2020-02-01T00:00:00")
NIGHT = np.tile([4.0, 95.0, 415.0, 0.0, 3.0, 0.0], (24, 1))
DAMP = (*USUAL_SETPOINTS, "humidity_setpoint")
WHEN = datetime(2026, 1, 1, tzinfo=UTC)


def answering(model: FittedModel) -> FittedModel:
    """Return the model with vents that open for humidity above its setpoint alone."""
    rules = {"lee_humidity": 0.0, "windward_humidity": 0.0, "lee_humidity_opening": 0.4, "lee_humidity_band": 8.0}
    return replace(model, actuation={**model.actuation, **rules})


@pytest.fixture(scope="module")
def built_in() -> Bundle:
    return read_bundle(default_bundle_folder())


@pytest.fixture(scope="module")
def damp(built_in: Bundle, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bundle]:
    """The built-in bundle's model with vents that answer to a humidity setpoint, exported."""
    yield export(answering(read_model(built_in, SITE)), tmp_path_factory.mktemp("damp") / "bundle", created=WHEN)


def nights(bundle: Bundle, levels: tuple[float, ...]) -> Floats:
    """Return the mean humidity of a night under each setpoint of the humidity, by a bundle's graph."""
    asked = np.tile([20.0, 400.0, 0.0, 0.0, *OPTIONAL], (len(levels), 24, 1))
    asked[:, :, SETPOINTS.index("humidity_setpoint")] = np.array(levels)[:, None]
    outcome = BundleSimulator(bundle, Greenhouse(), members=1).simulate({"air_humidity": 88.0}, NIGHT, asked, START)
    return np.asarray(outcome.air_humidity[0, :, 12:].mean(axis=-1))


def test_the_built_in_bundle_takes_the_usual_setpoints_and_hears_of_no_other(built_in: Bundle) -> None:
    simulator = BundleSimulator(built_in, Greenhouse(), members=1)
    assert simulator.setpoints == USUAL_SETPOINTS
    dry, moist = nights(built_in, (72.0, 90.0))
    assert dry == moist


def test_a_model_of_the_usual_setpoints_is_exported_as_before_others_were_known(
    built_in: Bundle, tmp_path: Path
) -> None:
    model = read_model(built_in, replace(SITE, setpoints=USUAL_SETPOINTS))
    again = export(model, tmp_path / "again", created=WHEN)
    for graph in ("simulator", "hindcast"):
        assert again.manifest.graphs[graph] == built_in.manifest.graphs[graph]
    assert set(again.manifest.simulator["parameters"]) == set(built_in.manifest.simulator["parameters"])


def test_a_bundle_whose_vents_answer_to_it_takes_the_setpoint_and_keeps_it_through_a_reading(damp: Bundle) -> None:
    assert BundleSimulator(damp, Greenhouse(), members=1).setpoints == DAMP
    again = read_model(damp, SITE)
    assert actuation.setpoints_of(again.actuation) == DAMP
    assert again.actuation["lee_humidity_opening"] == pytest.approx(0.4)


def test_the_lower_the_setpoint_the_drier_the_night(damp: Bundle) -> None:
    found = nights(damp, (72.0, 80.0, 88.0))
    assert (np.diff(found) > 0.5).all()


@pytest.fixture(scope="module")
def full(built_in: Bundle, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bundle]:
    """The same with a computer that answers to every setpoint."""
    model = read_model(built_in, SITE)
    rules = {
        rule: 1.0 for name in ("ventilation_setpoint", "minimum_pipe_setpoint") for rule in actuation.ANSWERS[name]
    }
    rules |= {"energy_screen_limited": 1.0, "lee_humidity_opening": 0.2}
    answered = replace(model, actuation={**model.actuation, **rules})
    yield export(answered, tmp_path_factory.mktemp("full") / "bundle", created=WHEN)


@pytest.mark.parametrize(
    ("name", "levels", "outcome", "least"),
    [
        ("ventilation_setpoint", (18.0, 21.0, 26.0), "air_temperature", 0.1),
        ("minimum_pipe_setpoint", (0.0, 35.0, 55.0), "heat", 0.01),
        ("energy_screen_setpoint", (100.0, 50.0, 0.0), "heat", 0.01),
    ],
)
def test_each_setpoint_of_a_full_computer_moves_the_greenhouse(
    full: Bundle, name: str, levels: tuple[float, ...], outcome: str, least: float
) -> None:
    """Vents that open later leave it warmer; a warmer minimum pipe and a screen that stays open use more heat."""
    assert BundleSimulator(full, Greenhouse(), members=1).setpoints == SETPOINTS
    # Under lamps the blackout screen closes, beside which another saves little.
    of_screen = name == "energy_screen_setpoint"
    asked = np.tile([17.0, 400.0, float(not of_screen), 0.0, *OPTIONAL], (len(levels), 24, 1))
    asked[:, :, SETPOINTS.index(name)] = np.array(levels)[:, None]
    simulator = BundleSimulator(full, Greenhouse(), members=1)
    weather = NIGHT + np.array([6.0, 0.0, 0.0, 300.0, 0.0, 0.0]) * (name == "ventilation_setpoint")
    weather[:, 0] -= 4.0 * of_screen
    found = getattr(simulator.simulate({"air_humidity": 75.0}, weather, asked, START), outcome)[0].mean(axis=-1)
    assert (np.diff(found) > least).all(), found
