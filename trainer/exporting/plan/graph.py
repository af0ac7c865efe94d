"""The planning graph as a whole: its inputs and outputs, the start of a run, and the scans over hours and days."""

from __future__ import annotations

from onnx import ModelProto

from igrow.core.quantities import GROWTH, YIELD
from igrow.core.simulator.hybrid.measurement import BEGINNING
from igrow.core.simulator.plan import CLIMATE_OUT, CLOCK, EQUIPMENT, RESOURCES
from igrow.trainer.exporting.blocks import Ports, shapes
from igrow.trainer.exporting.climate_wiring import ClimateWiring
from igrow.trainer.exporting.plan.blocks import PlanBlocks
from igrow.trainer.exporting.plan.days import wire_days
from igrow.trainer.exporting.plan.hour import carried_names, climate_inputs, hour_graph
from igrow.trainer.exporting.wiring import Wiring, finished_model


def ports(blocks: PlanBlocks) -> tuple[Ports, Ports]:
    """Return the graph's inputs and outputs; `w` and `members` are 1 or batch."""
    inputs: Ports = {
        "climate": (BEGINNING, (len(BEGINNING), "batch")),
        "growth": (GROWTH, (len(GROWTH), "batch")),
        "harvest": (YIELD, (len(YIELD), "batch")),
        "equipment": (EQUIPMENT, (len(EQUIPMENT), "batch")),
        "weather": (blocks.weather, ("hours", len(blocks.weather), "w")),
        "clock": (CLOCK, ("hours", len(CLOCK), "w")),
        "day": (("day",), ("hours", "w")),
        "setpoints": (blocks.setpoints, ("hours", len(blocks.setpoints), "batch")),
        "parameters": (blocks.parameters, (len(blocks.parameters), "members")),
    }
    outputs: Ports = {
        "climate_out": (CLIMATE_OUT, ("hours", len(CLIMATE_OUT), "batch")),
        "resources": (RESOURCES, ("hours", len(RESOURCES), "batch")),
        "growth_out": (GROWTH, ("hours", len(GROWTH), "batch")),
        "harvest_out": (YIELD, ("days", len(YIELD), "batch")),
        "outside": (("outside",), ("hours", "batch")),
    }
    return inputs, outputs


def plan_model(blocks: PlanBlocks) -> ModelProto:
    """Return the planning graph."""
    outer = Wiring("plan")
    parameters = outer.rows("parameters", blocks.parameters)
    growth = outer.rows("growth", GROWTH)
    equipment = outer.rows("equipment", EQUIPMENT)
    weather = outer.rows(outer.first("weather"), blocks.weather)
    clock = outer.rows(outer.first("clock"), CLOCK)
    zero = outer.constant("zero", [0.0])
    inputs = climate_inputs(blocks, weather, clock, growth["leaf_area_index"], zero) | equipment
    measured = outer.rows("climate", BEGINNING)
    state = ClimateWiring(outer, blocks.climate, parameters, outer.first("day")).rest(measured, inputs)
    carried = state | growth | equipment
    packed = outer.matrix([carried[name] for name in carried_names(blocks)], like=state["air_temperature"])
    (_, hourly) = outer.add(
        "Scan",
        [packed, "weather", "clock", "day", "setpoints"],
        2,
        body=hour_graph(blocks, parameters),
        num_scan_inputs=4,
    )
    widths = outer.constant("parts", [len(CLIMATE_OUT), len(RESOURCES), len(GROWTH), 1])
    climate_out, resources, growth_out, outside = outer.add("Split", [hourly, widths], 4, axis=1)
    outer.output("climate_out", climate_out)
    outer.output("resources", resources)
    outer.output("growth_out", growth_out)
    outer.output("outside", outside, outer.constant("axis", [1]), operator="Squeeze")
    outer.output("harvest_out", wire_days(outer, blocks.harvest, climate_out, growth_out))
    return finished_model(outer.graph("simulator", *map(shapes, ports(blocks))), blocks.blocks)
