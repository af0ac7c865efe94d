"""`hindcast.onnx`: the climate stage driven by what weather and actuators did, for shadow runs and live errors.

Row by row the graph predicts what the sensors will show at the end of the row's step. Where `follow` is 1 it
then takes what they did show as its state, so that floor and memories settle; where `follow` is 0 it runs on
freely. See `INPUTS` and `OUTPUTS` for the shapes; everything is float32.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from onnx import GraphProto, ModelProto, TensorProto, ValueInfoProto, checker, helper

from igrow_core.simulator.hybrid.measurement import PREDICTED
from trainer.export.blocks import DOMAIN, IR_VERSION, OPSET, Block, Wiring
from trainer.export.climate import ClimateBlocks, wire_drivers, wire_errors, wire_measured, wire_rest, wire_step

INPUTS: Mapping[str, tuple[str | int, ...]] = {
    "climate": (len(PREDICTED), "batch"),
    "inputs": ("rows", "inputs", "batch"),
    "measured": ("rows", len(PREDICTED), "batch"),
    "follow": ("rows", 1),
    "day": ("rows", 1),
    "seconds": (1,),
    "parameters": ("parameters", "members"),
}
"""Measured climate at the first row; drivers of each row; measured climate at each row's end; members is 1 or batch."""
OUTPUTS: Mapping[str, tuple[str | int, ...]] = {"predicted": ("rows", len(PREDICTED), "batch")}


def hindcast_model(blocks: ClimateBlocks) -> ModelProto:
    """Return the hindcast graph of a climate stage."""
    outer = Wiring("hindcast")
    parameters = outer.rows("parameters", blocks.parameters)
    (first_inputs,) = outer.add("Gather", ["inputs", outer.constant("first", [0])], axis=0)
    (first_inputs,) = outer.add("Squeeze", [first_inputs, outer.constant("axis", [0])])
    (first_day,) = outer.add("Gather", ["day", outer.constant("first", [0])], axis=0)
    (first_day,) = outer.add("Squeeze", [first_day, outer.constant("axis", [0])])
    state = wire_rest(
        outer,
        blocks,
        outer.rows("climate", PREDICTED),
        outer.rows(first_inputs, blocks.inputs),
        parameters,
        first_day,
    )
    like = state["air_temperature"]
    packed = outer.matrix([state[name] for name in blocks.states], like=like)
    body = _row_graph(blocks, parameters)
    _final, predicted = outer.add(
        "Scan", [packed, "inputs", "measured", "follow", "day"], 2, body=body, num_scan_inputs=4
    )
    outer.nodes.append(helper.make_node("Identity", [predicted], ["predicted"]))
    graph = helper.make_graph(
        outer.nodes,
        "hindcast",
        [float_tensor(name, shape) for name, shape in INPUTS.items()],
        [float_tensor(name, shape) for name, shape in OUTPUTS.items()],
        outer.initializers,
    )
    return finished_model(graph, blocks.blocks)


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


def _row_graph(blocks: ClimateBlocks, parameters: Mapping[str, str]) -> GraphProto:
    """Return the body of the scan: one row."""
    wiring = Wiring("row")
    state = wiring.rows("state", blocks.states)
    inputs = wiring.rows("row_inputs", blocks.inputs)
    following, _drivers = wire_step(wiring, blocks, state, inputs, parameters, seconds="seconds", day="row_day")
    drivers = wire_drivers(wiring, blocks, following, inputs, parameters)
    shown = wire_measured(wiring, blocks, drivers, following, parameters, "row_day")
    wiring.nodes.append(
        helper.make_node("Identity", [wiring.matrix([shown[name] for name in PREDICTED])], ["row_predicted"])
    )
    errors = wire_errors(wiring, blocks, drivers, following, parameters, "row_day")
    measured = wiring.rows("row_measured", PREDICTED)
    clean = {
        name: wiring.add("Sub", [measured[name], errors[name]])[0] if name in errors else measured[name]
        for name in PREDICTED
    }
    (followed,) = wiring.add("Greater", ["row_follow", wiring.constant("half", [0.5])])
    for name, tensor in wiring.call(blocks.from_measured, clean).items():
        (following[name],) = wiring.add("Where", [followed, tensor, following[name]])
    wiring.nodes.append(
        helper.make_node("Identity", [wiring.matrix([following[name] for name in blocks.states])], ["state_next"])
    )
    return helper.make_graph(
        wiring.nodes,
        "row",
        [
            float_tensor("state", (len(blocks.states), "batch")),
            float_tensor("row_inputs", (len(blocks.inputs), "batch")),
            float_tensor("row_measured", (len(PREDICTED), "batch")),
            float_tensor("row_follow", (1,)),
            float_tensor("row_day", (1,)),
        ],
        [
            float_tensor("state_next", (len(blocks.states), "batch")),
            float_tensor("row_predicted", (len(PREDICTED), "batch")),
        ],
        wiring.initializers,
    )


def float_tensor(name: str, shape: tuple[str | int, ...]) -> ValueInfoProto:
    """Return the description of a float32 input or output."""
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, list(shape))
