"""One hour of the planning graph: the body of its scan over hours."""

from __future__ import annotations

from collections.abc import Mapping

from onnx import GraphProto

from igrow.core.quantities import GROWTH
from igrow.core.simulator.crop import GROWTH_DRIVERS
from igrow.core.simulator.hybrid.balances import STATES
from igrow.core.simulator.hybrid.measurement import PREDICTED
from igrow.core.simulator.plan import CLOCK, EQUIPMENT, RESOURCES, STEPS_PER_HOUR
from igrow.trainer.exporting.blocks import tagged
from igrow.trainer.exporting.climate_wiring import ClimateWiring
from igrow.trainer.exporting.plan.blocks import PlanBlocks
from igrow.trainer.exporting.plan.control import AFFECTED, CARRIED, SECONDS
from igrow.trainer.exporting.plan.training_range import RANGED
from igrow.trainer.exporting.wiring import Wiring

_PER_HOUR = {"heat": 3.6e-3, "electricity": 1e-3, "co2": 1.0}
"""From W m-2, W m-2 and kg m-2 h-1 over an hour to MJ m-2, kWh m-2 and kg m-2."""


def carried_names(blocks: PlanBlocks) -> tuple[str, ...]:
    """Return what an hour hands to the next."""
    return (*blocks.climate.states, *GROWTH, *EQUIPMENT)


def climate_inputs(
    blocks: PlanBlocks, weather: Mapping[str, str], clock: Mapping[str, str], leaf_area_index: str, zero: str
) -> dict[str, str]:
    """Return the climate stage's inputs with the equipment at rest; pipes and CO2 come from the control block."""
    offered = dict(weather) | dict(clock) | {"leaf_area_index": leaf_area_index}
    return {name: offered.get(name, zero) for name in blocks.climate.inputs}


def hour_graph(blocks: PlanBlocks, parameters: Mapping[str, str]) -> GraphProto:
    """Return the body of the scan over hours."""
    wiring = Wiring("hour")
    stage = ClimateWiring(wiring, blocks.climate, parameters, "hour_day")
    carried = wiring.rows("carried", carried_names(blocks))
    weather = wiring.rows("hour_weather", blocks.weather)
    clock = wiring.rows("hour_clock", CLOCK)
    setpoints = tagged("setpoint", wiring.rows("hour_setpoints", blocks.setpoints))
    seconds = wiring.constant("seconds", [SECONDS])
    zero = wiring.constant("zero", [0.0])
    growth = {name: carried[name] for name in GROWTH}
    base = climate_inputs(blocks, weather, clock, growth["leaf_area_index"], zero)

    state = {name: carried[name] for name in blocks.climate.states}
    equipment = {name: carried[name] for name in EQUIPMENT}
    used: dict[str, list[str]] = {name: [] for name in RESOURCES}
    means: dict[str, list[str]] = {name: [] for name in (*GROWTH_DRIVERS, "assimilation")}
    for _ in range(STEPS_PER_HOUR):
        before = stage.derived(state, base | {name: equipment[name] for name in CARRIED})
        shown = stage.measured(before, state)
        set_ = wiring.call(
            blocks.equipment,
            setpoints
            | tagged("weather", weather)
            | tagged("climate", shown | {"par": before["par"]})
            | {f"memory:{name}": equipment[name] for name in CARRIED}
            | dict(parameters),
        )
        drivers = stage.derived(state, base | set_)
        # Effects see pipes and dosing as they were in the step before; this step's follow from the control block.
        drivers |= {name: equipment[name] for name in ("rail_pipe_excess", "co2_dosing")}
        added, memories = stage.effects(drivers, state, seconds)
        step = wiring.call(
            blocks.control,
            {f"state:{name}": state[name] for name in STATES}
            | tagged("driver", drivers)
            | added
            | dict(parameters)
            | setpoints
            | {"shown_temperature": shown["air_temperature"], "shown_co2": shown["air_co2"]},
        )
        state = memories | {name: step[name] for name in STATES}
        equipment = {name: set_[name] for name in CARRIED} | {
            "rail_pipe_excess": step["rail_pipe_excess"],
            "co2_dosing": step["co2"],
        }
        used["heat"].append(step["heat"])
        used["co2"].append(step["co2"])
        used["electricity"].append(set_["lamp_power"])
        for name, parts in means.items():
            parts.append(step[name] if name in AFFECTED else drivers[name])

    end = stage.derived(state, base | {name: equipment[name] for name in CARRIED})
    shown = stage.measured(end, state)
    share = wiring.constant("share", [1.0 / STEPS_PER_HOUR])
    mean = {name: wiring.add("Mul", [wiring.total(parts), share])[0] for name, parts in means.items()}
    resources = [
        wiring.add("Mul", [wiring.total(used[name]), wiring.constant("unit", [_PER_HOUR[name] / STEPS_PER_HOUR])])[0]
        for name in RESOURCES
    ]
    balance = {name: mean[name] for name in ("assimilation", "air_temperature")}
    grown = wiring.call(blocks.net_growth, balance | {"net_growth": growth["net_growth"]})
    growth = wiring.call(blocks.growth, tagged("driver", mean) | tagged("state", growth)) | grown
    outside = wiring.call(blocks.range, {name: {**shown, **weather}[name] for name in RANGED})["outside"]
    like = state["air_temperature"]
    following = state | growth | equipment
    rows = [*(shown[name] for name in PREDICTED), mean["par"], *resources, *(growth[name] for name in GROWTH), outside]
    wiring.output("carried_next", wiring.matrix([following[name] for name in carried_names(blocks)], like=like))
    wiring.output("hour_out", wiring.matrix(rows, like=like))
    width = (len(carried_names(blocks)), "batch")
    return wiring.graph(
        "hour",
        {
            "carried": width,
            "hour_weather": (len(blocks.weather), "w"),
            "hour_clock": (len(CLOCK), "w"),
            "hour_day": ("w",),
            "hour_setpoints": (len(blocks.setpoints), "batch"),
        },
        {"carried_next": width, "hour_out": (len(rows), "batch")},
    )
