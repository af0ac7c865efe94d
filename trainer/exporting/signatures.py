"""What the manifest of a hybrid bundle says of its graphs: inputs and outputs, with axes, quantities and units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.bundle import GraphSignature, Tensor
from igrow.core.effects import EFFECTS
from igrow.core.quantities import QUANTITIES
from igrow.core.simulator import actuation, holding
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.trainer.exporting import hindcast, plan
from igrow.trainer.exporting.blocks import Ports

_UNITS = {"vent_lee": "%", "vent_wind": "%", "rail_pipe_excess": "K", "heat": "MJ m-2", "electricity": "kWh m-2"}
_UNITS |= {"co2": "kg m-2", "sun_elevation": "deg", "sun_azimuth": "deg", "hour": "h"}
_DEFINED: Mapping[str, Mapping[str, Any]] = {
    "parameter": PARAMETERS, "actuation": actuation.RULES, "holding": holding.PARAMETERS
}  # fmt: skip
"""What stands in the input `parameters`, by its group."""


def signatures(blocks: plan.PlanBlocks) -> dict[str, GraphSignature]:
    """Return the signatures of the simulator and the hindcast."""
    graphs = {"simulator": plan.ports(blocks), "hindcast": hindcast.ports(blocks.climate)}
    return {name: GraphSignature(*map(_tensors, ports)) for name, ports in graphs.items()}


def _tensors(ports: Ports) -> tuple[Tensor, ...]:
    return tuple(
        Tensor(name, tuple(map(str, shape)), held, tuple(map(_unit, held))) for name, (held, shape) in ports.items()
    )


def _unit(name: str) -> str:
    if name in QUANTITIES:
        return QUANTITIES[name].unit
    group, _, rest = name.partition(":")
    if group in _DEFINED:
        return str(_DEFINED[group][rest].unit)
    if group == "effect":
        effect, _, parameter = rest.partition(":")
        return next((one.unit for one in EFFECTS[effect].parameters if one.name == parameter), "d")
    return _UNITS.get(name, "1")
