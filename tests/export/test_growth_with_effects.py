"""What a bundle's effects take from light and crop is growth that its plans do not count on."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from igrow.core.bundle import Bundle, EffectRecord, Estimate, Onset, default_bundle_folder, read_bundle
from igrow.core.simulator.outcome import Outcome
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Greenhouse, Site
from igrow.trainer.exporting import export, read_model
from igrow.trainer.fit.model import FittedModel
from tests.setpoint_tables import OPTIONAL

SITE = Site("declining", 52.0, 4.5)
START = np.datetime64("2020-05-01T00:00:00")
HOUR = np.arange(24)
SUN = np.maximum(600.0 * np.sin(2.0 * np.pi * (HOUR - 5.0) / 30.0), 0.0) * (HOUR > 4) * (HOUR < 20)
DAY = np.stack([np.full(24, 14.0), np.full(24, 70.0), np.full(24, 415.0), SUN, np.full(24, 3.0), np.full(24, 2.0)], 1)
RECIPE = np.tile([19.0, 400.0, 0.0, 0.0, *OPTIONAL], (1, 24, 1))


@pytest.fixture(scope="module")
def built_in() -> Bundle:
    return read_bundle(default_bundle_folder())


def began(days: int, name: str, amplitude: float) -> EffectRecord:
    """Return an effect that ages, as it is some days after it began."""
    since = datetime.fromisoformat(str(START)).replace(tzinfo=UTC) - timedelta(days=days)
    return EffectRecord(
        name, "process", {"loss": Estimate.about(amplitude, 0.1, "1")}, onset=Onset(since, since, since)
    )


def simulated(model: FittedModel, folder: Path) -> Outcome:
    """Return a sunny day of May by a model's exported bundle."""
    bundle = export(model, folder, created=datetime(2020, 4, 1, tzinfo=UTC))
    return BundleSimulator(bundle, Greenhouse(), members=1).simulate({}, DAY, RECIPE, START)


@pytest.fixture(scope="module")
def whole(built_in: Bundle, tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """The day of a greenhouse in which nothing is missing."""
    return simulated(read_model(built_in, SITE), tmp_path_factory.mktemp("whole") / "bundle")


def grown(outcome: Outcome) -> float:
    """Return what the day's light has paid for, kg m-2: net growth and the maintenance that it pays first."""
    return float(outcome.net_growth[0, 0].sum())


@pytest.mark.parametrize("name", ["photosynthesis_decline", "cover_ageing"])
def test_a_crop_that_assimilates_less_and_a_cover_that_lets_less_through_grow_less(
    name: str, built_in: Bundle, whole: Outcome, tmp_path: Path
) -> None:
    """Heat and CO2 followed what was found, and growth was still that of a greenhouse without it."""
    model = read_model(built_in, SITE)
    half, all_of_it = (
        grown(simulated(replace(model, effects=(began(days, name, 1.0),)), tmp_path / str(days))) for days in (50, 300)
    )
    assert half < 0.75 * grown(whole)
    # All of it is nothing grown, and maintenance goes on; three times as much is no more.
    assert -0.3 * grown(whole) < all_of_it < 0.0
