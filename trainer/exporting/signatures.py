"""What the manifest of a hybrid bundle says of its graphs: inputs and outputs, with axes, quantities and units."""

from __future__ import annotations

from igrow.core.bundle import GraphSignature, Tensor
from igrow.core.effects import EFFECTS
from igrow.core.quantities import GROWTH, QUANTITIES, SETPOINTS, YIELD
from igrow.core.simulator import actuation, holding
from igrow.core.simulator.hybrid.measurement import PREDICTED
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.core.simulator.plan import CLIMATE_OUT, CLOCK, EQUIPMENT, RESOURCES
from igrow.trainer.exporting import hindcast, plan

_UNITS = {"vent_lee": "%", "vent_wind": "%", "rail_pipe_excess": "K", "heat": "MJ m-2", "electricity": "kWh m-2"}
_UNITS |= {"co2": "kg m-2", "sun_elevation": "deg", "sun_azimuth": "deg", "hour": "h"}


def signatures(blocks: plan.PlanBlocks) -> dict[str, GraphSignature]:
    """Return the signatures of the simulator and the hindcast."""

    def tensor(name: str, axes: tuple[str | int, ...], quantities: tuple[str, ...]) -> Tensor:
        return Tensor(name, tuple(str(axis) for axis in axes), quantities, tuple(_unit(one) for one in quantities))

    rows = {
        "climate": PREDICTED,
        "growth": GROWTH,
        "harvest": YIELD,
        "equipment": EQUIPMENT,
        "weather": blocks.weather,
        "clock": CLOCK,
        "day": ("day",),
        "setpoints": SETPOINTS,
        "parameters": blocks.parameters,
        "climate_out": CLIMATE_OUT,
        "resources": RESOURCES,
        "growth_out": GROWTH,
        "harvest_out": YIELD,
        "outside": ("outside",),
    }
    traced = {
        "climate": PREDICTED,
        "inputs": blocks.climate.inputs,
        "measured": PREDICTED,
        "follow": ("follow",),
        "day": ("day",),
        "seconds": ("seconds",),
        "parameters": blocks.climate.parameters,
        "predicted": PREDICTED,
    }
    return {
        "simulator": GraphSignature(
            tuple(tensor(name, axes, rows[name]) for name, axes in plan.input_shapes(blocks).items()),
            tuple(tensor(name, axes, rows[name]) for name, axes in plan.OUTPUTS.items()),
        ),
        "hindcast": GraphSignature(
            tuple(tensor(name, axes, traced[name]) for name, axes in hindcast.INPUTS.items()),
            tuple(tensor(name, axes, traced[name]) for name, axes in hindcast.OUTPUTS.items()),
        ),
    }


def _unit(name: str) -> str:
    if name in QUANTITIES:
        return QUANTITIES[name].unit
    group, _, rest = name.partition(":")
    if group == "parameter":
        return PARAMETERS[rest].unit
    if group == "actuation":
        return actuation.RULES[rest].unit
    if group == "holding":
        return holding.PARAMETERS[rest].unit
    if group == "effect":
        effect, _, parameter = rest.partition(":")
        return next((one.unit for one in EFFECTS[effect].parameters if one.name == parameter), "d")
    return _UNITS.get(name, "1")
