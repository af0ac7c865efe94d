"""A bundle of a few kilobytes for tests of everything that carries, checks or adopts bundles."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper

from igrow.core.bundle import (
    Bundle,
    EffectRecord,
    Estimate,
    Golden,
    GraphSignature,
    Manifest,
    Tensor,
    write_bundle,
)

OPSET = 18


def linear_graph(slope: float, offset: float) -> bytes:
    """Return a graph that computes `air_temperature = slope * weather + offset`, batch dynamic."""
    graph = helper.make_graph(
        [
            helper.make_node("Mul", ["weather", "slope"], ["scaled"]),
            helper.make_node("Add", ["scaled", "offset"], ["air_temperature"]),
        ],
        "linear",
        [helper.make_tensor_value_info("weather", TensorProto.FLOAT, ["batch", 24])],
        [helper.make_tensor_value_info("air_temperature", TensorProto.FLOAT, ["batch", 24])],
        [
            helper.make_tensor("slope", TensorProto.FLOAT, [], [slope]),
            helper.make_tensor("offset", TensorProto.FLOAT, [], [offset]),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=9)
    return bytes(model.SerializeToString())


def endless_graph() -> bytes:
    """Return a graph of the same inputs and outputs that is right, and that nobody lives to see the end of."""
    body = helper.make_graph(
        [helper.make_node("Identity", ["go_on"], ["again"]), helper.make_node("Sin", ["value"], ["next"])],
        "body",
        [
            helper.make_tensor_value_info("turn", TensorProto.INT64, []),
            helper.make_tensor_value_info("go_on", TensorProto.BOOL, []),
            helper.make_tensor_value_info("value", TensorProto.FLOAT, ["batch", 24]),
        ],
        [
            helper.make_tensor_value_info("again", TensorProto.BOOL, []),
            helper.make_tensor_value_info("next", TensorProto.FLOAT, ["batch", 24]),
        ],
    )
    return _graph_of(
        [helper.make_node("Loop", ["turns", "true", "weather"], ["air_temperature"], body=body)],
        [
            helper.make_tensor("turns", TensorProto.INT64, [], [2**62]),
            helper.make_tensor("true", TensorProto.BOOL, [], [True]),
        ],
    )


def greedy_graph(gigabytes: int) -> bytes:
    """Return a graph of the same inputs and outputs that needs so much memory on its way."""
    return _graph_of(
        [
            helper.make_node("ReduceSum", ["weather"], ["sum"], keepdims=0),
            helper.make_node("Expand", ["sum", "shape"], ["much"]),
            helper.make_node("Sin", ["much"], ["more"]),
            helper.make_node("ReduceSum", ["more"], ["number"], keepdims=0),
            helper.make_node("Add", ["weather", "number"], ["air_temperature"]),
        ],
        [helper.make_tensor("shape", TensorProto.INT64, [1], [gigabytes * 2**28])],
    )


def _graph_of(nodes: list[onnx.NodeProto], constants: list[onnx.TensorProto]) -> bytes:
    graph = helper.make_graph(
        nodes,
        "bad",
        [helper.make_tensor_value_info("weather", TensorProto.FLOAT, ["batch", 24])],
        [helper.make_tensor_value_info("air_temperature", TensorProto.FLOAT, ["batch", 24])],
        constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=9)
    return bytes(model.SerializeToString())


def write_tiny_bundle(
    folder: Path,
    *,
    site: str = "demo",
    offset: float = 5.0,
    golden_offset: float | None = None,
    quantity: str = "outdoor_temperature",
    created: datetime = datetime(2026, 3, 14, tzinfo=UTC),
    graph: bytes | None = None,
) -> Bundle:
    """Write a bundle whose simulator adds `offset`; another `golden_offset` makes the self-test fail.

    `graph` takes the place of both graphs.
    """
    signature = GraphSignature(
        inputs=(Tensor("weather", ("batch", "hour"), (quantity,), ("degC",)),),
        outputs=(Tensor("air_temperature", ("batch", "hour"), ("air_temperature",), ("degC",)),),
    )
    weather = np.linspace(0.0, 20.0, 48, dtype=np.float32).reshape(2, 24)
    golden = Golden(
        {"weather": weather},
        {"air_temperature": weather + np.float32(offset if golden_offset is None else golden_offset)},
    )
    manifest = Manifest(
        site=site,
        created=created,
        igrow_version="0.1.0",
        variant="hybrid",
        opset=OPSET,
        graphs={"simulator": signature, "optimizer": signature},
        effects=(
            EffectRecord("wind_infiltration", "process", {"amplitude": Estimate(0.05, 0.04, 0.06, "m s-1")}, ("heat",)),
        ),
    )
    graph = graph or linear_graph(1.0, offset)
    assert onnx.load_from_string(graph)
    return write_bundle(
        folder,
        manifest,
        {"simulator.onnx": graph, "optimizer.onnx": graph},
        {"simulator": golden, "optimizer": golden},
    )
