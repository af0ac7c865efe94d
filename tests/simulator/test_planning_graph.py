"""The bundle's graph as the planner's simulator: what a plan is charged for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.core.bundle import Bundle, default_bundle_folder, read_bundle
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Greenhouse
from tests.setpoint_tables import OPTIONAL

START = np.datetime64("2020-02-01T00:00:00")
NIGHT = np.tile([2.0, 85.0, 415.0, 0.0, 3.0, -8.0], (24, 1))
WARM = np.tile([20.0, 400.0, 0.0, 0.0, *OPTIONAL], (1, 24, 1))


@pytest.fixture(scope="module")
def bundle() -> Bundle:
    return read_bundle(default_bundle_folder())


def heat(bundle: Bundle, greenhouse: Greenhouse) -> np.ndarray:
    """MJ m-2 of a cold day, by each member of the posterior."""
    return np.asarray(BundleSimulator(bundle, greenhouse).simulate({}, NIGHT, WARM, START).heat[:, 0].sum(axis=-1))


def test_all_that_leaves_the_pipes_is_paid_and_not_only_what_reaches_the_air(bundle: Bundle) -> None:
    greenhouse = Greenhouse()
    parameters = bundle.manifest.simulator["parameters"]
    fitted = replace(
        greenhouse,
        rail_pipe_heat_transfer=parameters["parameter:rail_pipe_heat_transfer"],
        grow_pipe_heat_transfer=parameters["parameter:grow_pipe_heat_transfer"],
    )
    received = heat(bundle, fitted)[0]
    assert received > 1.0
    twice = replace(
        fitted,
        rail_pipe_heat_transfer=2.0 * fitted.rail_pipe_heat_transfer,
        grow_pipe_heat_transfer=2.0 * fitted.grow_pipe_heat_transfer,
    )
    assert heat(bundle, twice)[0] == pytest.approx(2.0 * received, rel=1e-6)


def test_a_greenhouse_without_pipes_is_charged_for_what_its_air_receives(bundle: Bundle) -> None:
    without = replace(Greenhouse(), rail_pipe_heat_transfer=0.0, grow_pipe_heat_transfer=0.0)
    assert heat(bundle, without).min() > 1.0
