"""The wiring of a graph: calls of traced blocks and plain ONNX operators, tensors known by their names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from onnx import GraphProto, ModelProto, NodeProto, TensorProto, checker, helper, numpy_helper

from igrow.trainer.exporting.blocks import DOMAIN, OPSET, Block, Shape

IR_VERSION = 10


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

    def first(self, tensor: str) -> str:
        """Return the first entry along the first axis."""
        (entry,) = self.add("Gather", [tensor, self.constant("first", [0])], axis=0)
        return self.add("Squeeze", [entry, self.constant("axis", [0])])[0]

    def output(self, name: str, *tensors: str, operator: str = "Identity") -> None:
        """Let the graph's output of this name be a tensor, or what an operator makes of tensors."""
        self.nodes.append(helper.make_node(operator, list(tensors), [name]))

    def graph(self, name: str, inputs: Mapping[str, Shape], outputs: Mapping[str, Shape]) -> GraphProto:
        """Return the graph of all nodes so far, with its inputs and outputs, float32, by name."""
        return helper.make_graph(
            self.nodes,
            name,
            [helper.make_tensor_value_info(key, TensorProto.FLOAT, list(shape)) for key, shape in inputs.items()],
            [helper.make_tensor_value_info(key, TensorProto.FLOAT, list(shape)) for key, shape in outputs.items()],
            self.initializers,
        )


def finished_model(graph: GraphProto, blocks: Sequence[Block]) -> ModelProto:
    """Return the checked model of a graph with the blocks that it calls."""
    model = helper.make_model(
        graph,
        opset_imports=[helper.make_opsetid("", OPSET), helper.make_opsetid(DOMAIN, 1)],
        functions=[block.function for block in blocks],
        ir_version=IR_VERSION,
        producer_name="igrow",
    )
    checker.check_model(model)
    return model
