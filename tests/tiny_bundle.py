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
    return model.SerializeToString()


def write_tiny_bundle(
    folder: Path,
    *,
    site: str = "demo",
    offset: float = 5.0,
    golden_offset: float | None = None,
    quantity: str = "outdoor_temperature",
    created: datetime = datetime(2026, 3, 14, tzinfo=UTC),
) -> Bundle:
    """Write a bundle whose simulator adds `offset`; another `golden_offset` makes the self-test fail."""
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
    graph = linear_graph(1.0, offset)
    assert onnx.load_from_string(graph)
    return write_bundle(
        folder,
        manifest,
        {"simulator.onnx": graph, "optimizer.onnx": graph},
        {"simulator": golden, "optimizer": golden},
    )
