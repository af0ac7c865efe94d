"""The bundle's graph as the planner's simulator: what a plan is charged for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import helper

from igrow.core.bundle import Bundle, default_bundle_folder, read_bundle
from igrow.core.simulator.outcome import Initial
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


def without_soil(bundle: Bundle, folder: Path) -> Bundle:
    """Return a bundle as it was before its graphs were told the mean of the day before: it begins with three rows."""
    model = onnx.load(str(bundle.graph("simulator")))
    graph, (climate,) = model.graph, [one for one in model.graph.input if one.name == "climate"]
    climate.type.tensor_type.shape.dim[0].dim_value = 3
    for node in graph.node:
        node.input[:] = ["four_rows" if name == "climate" else name for name in node.input]
    first = helper.make_node("Slice", ["climate", "zero_row", "one_row", "zero_row"], ["air_row"])
    both = helper.make_node("Concat", ["climate", "air_row"], ["four_rows"], axis=0)
    for place, node in enumerate((first, both)):
        graph.node.insert(place, node)
    for name, value in (("zero_row", 0), ("one_row", 1)):
        graph.initializer.append(helper.make_tensor(name, onnx.TensorProto.INT64, [1], [value]))
    onnx.save(model, str(folder / "simulator.onnx"))
    signature = bundle.manifest.graphs["simulator"]
    inputs = tuple(
        replace(one, quantities=one.quantities[:3], units=one.units[:3]) if one.name == "climate" else one
        for one in signature.inputs
    )
    graphs = {**bundle.manifest.graphs, "simulator": replace(signature, inputs=inputs)}
    return replace(bundle, folder=folder, manifest=replace(bundle.manifest, graphs=graphs))


def test_a_bundle_of_before_the_soil_is_planned_with_as_it_was(bundle: Bundle, tmp_path: Path) -> None:
    old = BundleSimulator(without_soil(bundle, tmp_path), Greenhouse(), members=1)
    new = BundleSimulator(bundle, Greenhouse(), members=1)
    initial = {"air_temperature": 17.0, "mean_air_temperature": 22.0}
    found = old.simulate(initial, NIGHT, WARM, START)
    as_warm = new.simulate(initial | {"mean_air_temperature": 17.0}, NIGHT, WARM, START)
    np.testing.assert_array_equal(found.heat, as_warm.heat)
    assert (found.heat.sum() - new.simulate(initial, NIGHT, WARM, START).heat.sum()) > 0.01


def starts() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the weather, the setpoints and the starts of three candidates: two of a winter's day, one of spring."""
    spring = NIGHT + np.array([10.0, -10.0, 0.0, 300.0, 1.0, 8.0])
    return (
        np.stack([NIGHT, NIGHT, spring]),
        np.concatenate([WARM, WARM + 1.0, WARM]),
        np.array([START, START, START + np.timedelta64(90, "D")]),
    )


@pytest.mark.parametrize("members", [1, 3])
def test_candidates_of_different_days_run_at_once_as_each_alone(bundle: Bundle, members: int) -> None:
    simulator = BundleSimulator(bundle, Greenhouse(), members=members)
    weather, setpoints, start = starts()
    initial = {"air_temperature": np.array([17.0, 18.0, 19.0])}
    both = simulator.simulate(initial, weather, setpoints, start)
    for row in range(3):
        mine = {"air_temperature": initial["air_temperature"][row]}
        alone = simulator.simulate(mine, weather[row], setpoints[[row]], start[row])
        for name in ("air_temperature", "air_humidity", "heat", "net_growth"):
            found, expected = getattr(both.of(slice(row, row + 1)), name), getattr(alone, name)
            np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6)


def test_a_graph_with_one_clock_runs_days_one_after_the_other(bundle: Bundle, tmp_path: Path) -> None:
    model = onnx.load(str(bundle.graph("simulator")))
    (clock,) = (one for one in model.graph.input if one.name == "clock")
    clock.type.tensor_type.shape.dim[-1].dim_value = 1
    onnx.save(model, str(tmp_path / "simulator.onnx"))
    old = BundleSimulator(replace(bundle, folder=tmp_path), Greenhouse(), members=2)
    new = BundleSimulator(bundle, Greenhouse(), members=2)
    initial: Initial = {"air_temperature": np.array([17.0, 18.0, 19.0]), "air_co2": 700.0}
    found, expected = (one.simulate(initial, *starts()) for one in (old, new))
    for name in ("air_temperature", "air_humidity", "heat", "net_growth"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-5, atol=1e-6)
