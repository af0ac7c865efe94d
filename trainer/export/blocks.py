"""Named ONNX blocks, traced from the very functions that run in numpy, and the wiring between them.

A block is an ONNX function: `igrow.wind_infiltration`, say, stands in the graph as one node that a viewer can
open. All tensors between blocks are one-dimensional, (batch,) or (1,), float32.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import ndonnx as ndx
import numpy as np
import onnxruntime
from numpy.typing import NDArray
from onnx import FunctionProto, ModelProto, NodeProto, TensorProto, helper, numpy_helper

DOMAIN = "igrow"
OPSET = 21
IR_VERSION = 10

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


def trace_shaped(name: str, formula: Formula, inputs: Mapping[str, tuple[str | int, ...]]) -> Block:
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


def _einsum_to_product(node: NodeProto) -> None:
    """Make a product of two matrices, which ndonnx writes as an Einsum, the operator that runtimes are fast at."""
    if node.op_type == "Einsum" and node.attribute[0].s == b"ab,bc->ac":
        node.op_type = "MatMul"
        del node.attribute[:]


def open_model(model: ModelProto) -> Any:
    """Open a finished model in onnxruntime, on one thread."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])


def grouped(arrays: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return arrays named ``group:name`` as {group: {name: array}}; others are left out."""
    groups: dict[str, dict[str, Any]] = {}
    for key, value in arrays.items():
        group, colon, name = key.partition(":")
        if colon:
            groups.setdefault(group, {})[name] = value
    return groups


class Wiring:
    """The nodes of one graph as they are put together; tensors are known by their names."""

    def __init__(self, prefix: str) -> None:
        self.nodes: list[NodeProto] = []
        self.initializers: list[TensorProto] = []
        self._prefix = prefix
        self._count = 0

    def fresh(self, stem: str) -> str:
        """Return a tensor name that no other tensor has."""
        self._count += 1
        return f"{self._prefix}/{stem}_{self._count}"

    def constant(self, stem: str, values: NDArray[Any] | Sequence[int] | Sequence[float]) -> str:
        """Add a constant: float32, or int64 for integers."""
        array = np.asarray(values)
        array = array.astype(np.int64 if array.dtype.kind == "i" else np.float32)
        name = self.fresh(stem)
        self.initializers.append(numpy_helper.from_array(array, name))
        return name

    def add(self, operator: str, inputs: Sequence[str], outputs: int = 1, **attributes: Any) -> list[str]:
        """Add one ONNX operator and return the names of its outputs."""
        names = [self.fresh(operator.lower()) for _ in range(outputs)]
        self.nodes.append(helper.make_node(operator, list(inputs), names, **attributes))
        return names

    def call(self, block: Block, tensors: Mapping[str, str], label: str | None = None) -> dict[str, str]:
        """Add a call of a block; returns the names of its outputs by the block's own names for them."""
        outputs = {key: self.fresh(f"{block.name}.{key}") for key in block.outputs}
        self.nodes.append(
            helper.make_node(
                block.name,
                [tensors[key] for key in block.inputs],
                list(outputs.values()),
                name=self.fresh(label or block.name),
                domain=DOMAIN,
            )
        )
        return outputs

    def total(self, tensors: Sequence[str]) -> str:
        """Add up tensors that broadcast."""
        sum_ = tensors[0]
        for other in tensors[1:]:
            (sum_,) = self.add("Add", [sum_, other])
        return sum_

    def rows(self, matrix: str, names: Sequence[str]) -> dict[str, str]:
        """Split a (len(names), batch) matrix into tensors of (batch,)."""
        count = len(names)
        parts = [matrix] if count == 1 else self.add("Split", [matrix], count, axis=0, num_outputs=count)
        axis = self.constant("axis", [0])
        return {name: self.add("Squeeze", [part, axis])[0] for name, part in zip(names, parts, strict=True)}

    def matrix(self, tensors: Sequence[str], like: str | None = None) -> str:
        """Stack tensors of (batch,) to (len(tensors), batch); those of (1,) are spread to the shape of `like`."""
        axis = self.constant("axis", [0])
        rows = []
        zero = self.add("Mul", [like, self.constant("zero", [0.0])]) if like is not None else []
        for tensor in tensors:
            spread = self.add("Add", [tensor, *zero])[0] if zero else tensor
            rows += self.add("Unsqueeze", [spread, axis])
        return self.add("Concat", rows, axis=0)[0]
