"""Named ONNX blocks, traced from the very functions that run in numpy; `wiring.py` puts them into graphs.

A block is an ONNX function: `igrow.wind_infiltration`, say, stands in the graph as one node that a viewer can
open. All tensors between blocks are one-dimensional, (batch,) or (1,), float32.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import ndonnx as ndx
from onnx import FunctionProto, ModelProto, NodeProto, helper

from igrow.core.bundle import new_session
from igrow.core.simulator.network import Stage

DOMAIN = "igrow"
OPSET = 21

Shape = tuple[str | int, ...]
"""Of a tensor; a text names an axis whose length is free."""
Ports = Mapping[str, tuple[tuple[str, ...], Shape]]
"""Inputs or outputs of a graph: what stands in each, in order, and its shape."""
Formula = Callable[[Any, Mapping[str, Any]], Mapping[str, Any]]
"""`formula(xp, arrays by name) -> arrays by name`."""


@dataclass(frozen=True)
class Block:
    """One traced function."""

    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    function: FunctionProto


def trace(name: str, formula: Formula, inputs: Sequence[str]) -> Block:
    """Trace a formula over arrays of shape (batch,) into a block.

    Args:
        name: of the block, unique in a model.
        formula: pure and elementwise, or of matrix products with constants.
        inputs: names of what it may read; the block keeps those that its outputs depend on.
    """
    return trace_shaped(name, formula, dict.fromkeys(inputs, ("batch",)))


def trace_shaped(name: str, formula: Formula, inputs: Mapping[str, Shape]) -> Block:
    """Trace a formula over arrays of the shapes given by name into a block; see `trace`."""
    arguments = {key: ndx.argument(shape=shape, dtype=ndx.float32) for key, shape in inputs.items()}
    results = dict(formula(ndx, arguments))
    if not results:
        raise ValueError(f"block {name} returns nothing")
    model = ndx.build(
        {f"in_{key}": value for key, value in arguments.items()},
        {f"out_{key}": value for key, value in results.items()},
    )
    for node in model.graph.node:
        _einsum_to_product(node)
    read = {tensor for node in model.graph.node for tensor in node.input}
    kept = [key for key in inputs if f"in_{key}" in read]
    function = helper.make_function(
        DOMAIN,
        name,
        [f"in_{key}" for key in kept],
        [f"out_{key}" for key in results],
        model.graph.node,
        [helper.make_opsetid("", OPSET)],
    )
    return Block(name, tuple(kept), tuple(results), function)


def traceable(stage: Stage) -> Stage:
    """Return a network stage with bounds that ndonnx takes beside its own arrays."""
    bounds: dict[str, Any] = {"low": ndx.asarray(stage.low), "high": ndx.asarray(stage.high)}
    return replace(stage, **bounds)


def _einsum_to_product(node: NodeProto) -> None:
    """Make a product of two matrices, which ndonnx writes as an Einsum, the operator that runtimes are fast at."""
    if node.op_type == "Einsum" and node.attribute[0].s == b"ab,bc->ac":
        node.op_type = "MatMul"
        del node.attribute[:]


def open_model(model: ModelProto) -> Any:
    """Open a finished model in onnxruntime, on one thread."""
    return new_session(model.SerializeToString())


def grouped(arrays: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return arrays named ``group:name`` as {group: {name: array}}; others are left out."""
    groups: dict[str, dict[str, Any]] = {}
    for key, value in arrays.items():
        group, colon, name = key.partition(":")
        if colon:
            groups.setdefault(group, {})[name] = value
    return groups


def shapes(ports: Ports) -> dict[str, Shape]:
    """Return the shapes of inputs or outputs by name."""
    return {name: shape for name, (_, shape) in ports.items()}


def tags(group: str, names: Iterable[str]) -> list[str]:
    """Return names as ``group:name``."""
    return [f"{group}:{name}" for name in names]


def tagged(group: str, tensors: Mapping[str, str]) -> dict[str, str]:
    """Return tensors by ``group:name``."""
    return {f"{group}:{name}": tensor for name, tensor in tensors.items()}
