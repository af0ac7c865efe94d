"""The bundle's graph as the planner's simulator: what a plan is charged for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import helper

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
