"""`hindcast.onnx`: the climate stage driven by what weather and actuators did, for shadow runs and live errors.

Row by row the graph predicts what the sensors will show at the end of the row's step. Where `follow` is 1 it
then takes what they did show as its state, so that floor and memories settle; where `follow` is 0 it runs on
freely. See `ports` for the shapes; everything is float32.
"""

from __future__ import annotations

from collections.abc import Mapping

from onnx import GraphProto, ModelProto

from igrow.core.simulator.hybrid.measurement import BEGINNING, PREDICTED
from igrow.trainer.exporting.blocks import Ports, shapes
from igrow.trainer.exporting.climate import ClimateBlocks
from igrow.trainer.exporting.climate_wiring import ClimateWiring
from igrow.trainer.exporting.wiring import Wiring, finished_model


def ports(blocks: ClimateBlocks) -> tuple[Ports, Ports]:
    """Return the graph's inputs and outputs; members is 1 or batch.

    Measured climate at the first row; drivers of each row; measured climate at each row's end, and what was predicted.
    """
    climate = (PREDICTED, ("rows", len(PREDICTED), "batch"))
    inputs: Ports = {
        "climate": (BEGINNING, (len(BEGINNING), "batch")),
        "inputs": (blocks.inputs, ("rows", "inputs", "batch")),
        "measured": climate,
        "follow": (("follow",), ("rows", 1)),
        "day": (("day",), ("rows", 1)),
        "seconds": (("seconds",), (1,)),
        "parameters": (blocks.parameters, ("parameters", "members")),
    }
    return inputs, {"predicted": climate}


def hindcast_model(blocks: ClimateBlocks) -> ModelProto:
    """Return the hindcast graph of a climate stage."""
    outer = Wiring("hindcast")
    parameters = outer.rows("parameters", blocks.parameters)
    first_inputs, first_day = outer.first("inputs"), outer.first("day")
    measured, inputs = outer.rows("climate", BEGINNING), outer.rows(first_inputs, blocks.inputs)
    state = ClimateWiring(outer, blocks, parameters, first_day).rest(measured, inputs)
    packed = outer.matrix([state[name] for name in blocks.states], like=state["air_temperature"])
    body = _row_graph(blocks, parameters)
    _final, predicted = outer.add(
        "Scan", [packed, "inputs", "measured", "follow", "day"], 2, body=body, num_scan_inputs=4
    )
    outer.output("predicted", predicted)
    return finished_model(outer.graph("hindcast", *map(shapes, ports(blocks))), blocks.blocks)


def _row_graph(blocks: ClimateBlocks, parameters: Mapping[str, str]) -> GraphProto:
    """Return the body of the scan: one row."""
    wiring = Wiring("row")
    stage = ClimateWiring(wiring, blocks, parameters, "row_day")
    state = wiring.rows("state", blocks.states)
    inputs = wiring.rows("row_inputs", blocks.inputs)
    following = stage.step(state, inputs, "seconds")
    drivers = stage.drivers(following, inputs)
    shown = stage.measured(drivers, following)
    wiring.output("row_predicted", wiring.matrix([shown[name] for name in PREDICTED]))
    errors = stage.errors(drivers, following)
    measured = wiring.rows("row_measured", PREDICTED)
    clean = {
        name: wiring.add("Sub", [measured[name], errors[name]])[0] if name in errors else measured[name]
        for name in PREDICTED
    }
    (followed,) = wiring.add("Greater", ["row_follow", wiring.constant("half", [0.5])])
    for name, tensor in wiring.call(blocks.from_measured, clean).items():
        (following[name],) = wiring.add("Where", [followed, tensor, following[name]])
    wiring.output("state_next", wiring.matrix([following[name] for name in blocks.states]))
    states, climate = (len(blocks.states), "batch"), (len(PREDICTED), "batch")
    return wiring.graph(
        "row",
        {
            "state": states,
            "row_inputs": (len(blocks.inputs), "batch"),
            "row_measured": climate,
            "row_follow": (1,),
            "row_day": (1,),
        },
        {"state_next": states, "row_predicted": climate},
    )
