"""`simulator.onnx`: candidate strategies over whole days, climate -> growth -> yield, from setpoints to outcomes.

An hour is a few steps of the climate stage with the actuation stage in front, then one step of growth; a day ends
with one step of yield. Hours and days are scanned, so that one graph serves every horizon of whole days and every
number of candidates. Everything is float32 and the batch comes last; `input_shapes` and `OUTPUTS` tell the shapes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from onnx import GraphProto, ModelProto, helper

from igrow_core import air
from igrow_core.quantities import GROWTH, SETPOINTS, WEATHER, YIELD
from igrow_core.simulator import actuation, holding, network
from igrow_core.simulator.crop import GROWTH_DRIVERS, HARVEST_DRIVERS, CropStages, net_growth_rate
from igrow_core.simulator.hybrid import climate
from igrow_core.simulator.hybrid.measurement import PREDICTED
from igrow_core.simulator.hybrid.parameters import PARAMETERS
from igrow_core.simulator.plan import CLIMATE_OUT, CLOCK, EQUIPMENT, RESOURCES, STEPS_PER_HOUR
from trainer.export.blocks import Block, Wiring, grouped, trace
from trainer.export.climate import ClimateBlocks, wire_derived, wire_effects, wire_measured, wire_rest
from trainer.export.hindcast import finished_model, float_tensor

OUTPUTS: Mapping[str, tuple[str | int, ...]] = {
    "climate_out": ("hours", len(CLIMATE_OUT), "batch"),
    "resources": ("hours", len(RESOURCES), "batch"),
    "growth_out": ("hours", len(GROWTH), "batch"),
    "harvest_out": ("days", len(YIELD), "batch"),
    "outside": ("hours", "batch"),
}
CARRIED = ("vent_lee", "vent_wind", "energy_screen", "blackout_screen")
"""Positions of the equipment that an hour hands to the next."""
RANGED = ("air_temperature", "air_humidity", "air_co2", "outdoor_temperature", "global_radiation")
"""Quantities whose distance from the range of the training data is reported."""

_SECONDS = 3600.0 / STEPS_PER_HOUR
_EDGE = 3.0
"""Standard deviations of the training data within which a crop stage is believed."""


@dataclass(frozen=True)
class PlanBlocks:
    """All blocks of the planning graph."""

    climate: ClimateBlocks
    weather: tuple[str, ...]
    """Columns of the graph's input `weather`."""
    parameters: tuple[str, ...]
    """Rows of the graph's input `parameters`."""
    equipment: Block
    control: Block
    growth: Block
    net_growth: Block
    harvest: Block
    range: Block

    @property
    def blocks(self) -> list[Block]:
        """Every block, for the model's list of functions."""
        return [
            *self.climate.blocks,
            self.equipment,
            self.control,
            self.growth,
            self.net_growth,
            self.harvest,
            self.range,
        ]


def plan_blocks(stage: ClimateBlocks, crop: CropStages, known: Mapping[str, tuple[float, float]]) -> PlanBlocks:
    """Trace what planning needs beside the climate stage.

    Args:
        stage: the climate stage with its active effects.
        crop: growth and yield.
        known: smallest and largest value of quantities in the training data.
    """
    weather = tuple(name for name in WEATHER if name in stage.inputs)
    settings = [
        *(f"actuation:{name}" for name in actuation.RULES),
        *(f"holding:{name}" for name in holding.PARAMETERS),
    ]
    setpoints = [f"setpoint:{name}" for name in SETPOINTS]
    drivers = [*stage.inputs, *stage.derive.outputs, "mean_height"]
    return PlanBlocks(
        climate=stage,
        weather=weather,
        parameters=(*stage.parameters, *settings),
        equipment=trace(
            "equipment",
            _equipment,
            [
                *setpoints,
                *(f"weather:{name}" for name in weather),
                *(f"climate:{name}" for name in (*PREDICTED, "par")),
                *(f"memory:{name}" for name in CARRIED),
                *settings,
            ],
        ),
        control=trace(
            "control",
            _control,
            [
                *(f"state:{name}" for name in climate.STATES),
                *(f"driver:{name}" for name in drivers),
                *stage.channels,
                *(f"parameter:{name}" for name in PARAMETERS),
                *setpoints,
                *settings,
                "shown_temperature",
                "shown_co2",
            ],
        ),
        growth=_crop_block("growth", crop.growth, GROWTH_DRIVERS),
        net_growth=trace("net_growth", _net_growth_formula(crop), ["net_growth", "assimilation", "air_temperature"]),
        harvest=_crop_block("harvest", crop.harvest, HARVEST_DRIVERS),
        range=trace("training_range", _range_formula(known), [*RANGED]),
    )


def input_shapes(blocks: PlanBlocks) -> dict[str, tuple[str | int, ...]]:
    """Return the shapes of the graph's inputs; `w` and `members` are 1 or batch."""
    return {
        "climate": (len(PREDICTED), "batch"),
        "growth": (len(GROWTH), "batch"),
        "harvest": (len(YIELD), "batch"),
        "equipment": (len(EQUIPMENT), "batch"),
        "weather": ("hours", len(blocks.weather), "w"),
        "clock": ("hours", len(CLOCK), 1),
        "day": ("hours", 1),
        "setpoints": ("hours", len(SETPOINTS), "batch"),
        "parameters": (len(blocks.parameters), "members"),
    }


def plan_model(blocks: PlanBlocks) -> ModelProto:
    """Return the planning graph."""
    outer = Wiring("plan")
    parameters = outer.rows("parameters", blocks.parameters)
    growth = outer.rows("growth", GROWTH)
    equipment = outer.rows("equipment", EQUIPMENT)
    weather = outer.rows(_first(outer, "weather"), blocks.weather)
    clock = outer.rows(_first(outer, "clock"), CLOCK)
    zero = outer.constant("zero", [0.0])
    inputs = _climate_inputs(blocks, weather, clock, growth["leaf_area_index"], zero) | equipment
    state = wire_rest(outer, blocks.climate, outer.rows("climate", PREDICTED), inputs, parameters, _first(outer, "day"))
    carried = state | growth | equipment
    packed = outer.matrix([carried[name] for name in _carried(blocks)], like=state["air_temperature"])
    (_, hourly) = outer.add(
        "Scan",
        [packed, "weather", "clock", "day", "setpoints"],
        2,
        body=_hour_graph(blocks, parameters),
        num_scan_inputs=4,
    )
    parts = outer.add(
        "Split",
        [hourly, outer.constant("parts", [len(CLIMATE_OUT), len(RESOURCES), len(GROWTH), 1])],
        4,
        axis=1,
    )
    for name, part in zip(("climate_out", "resources", "growth_out"), parts, strict=False):
        outer.nodes.append(helper.make_node("Identity", [part], [name]))
    outer.nodes.append(helper.make_node("Squeeze", [parts[3], outer.constant("axis", [1])], ["outside"]))
    _wire_days(outer, blocks, parts[0], parts[2])
    graph = helper.make_graph(
        outer.nodes,
        "simulator",
        [float_tensor(name, shape) for name, shape in input_shapes(blocks).items()],
        [float_tensor(name, shape) for name, shape in OUTPUTS.items()],
        outer.initializers,
    )
    return finished_model(graph, blocks.blocks)


def _carried(blocks: PlanBlocks) -> tuple[str, ...]:
    """Return what an hour hands to the next."""
    return (*blocks.climate.states, *GROWTH, *EQUIPMENT)


def _hour_graph(blocks: PlanBlocks, parameters: Mapping[str, str]) -> GraphProto:
    """Return the body of the scan over hours."""
    wiring = Wiring("hour")
    carried = wiring.rows("carried", _carried(blocks))
    weather = wiring.rows("hour_weather", blocks.weather)
    clock = wiring.rows("hour_clock", CLOCK)
    setpoints = {f"setpoint:{name}": row for name, row in wiring.rows("hour_setpoints", SETPOINTS).items()}
    seconds = wiring.constant("seconds", [_SECONDS])
    zero = wiring.constant("zero", [0.0])
    growth = {name: carried[name] for name in GROWTH}
    base = _climate_inputs(blocks, weather, clock, growth["leaf_area_index"], zero)

    state = {name: carried[name] for name in blocks.climate.states}
    equipment = {name: carried[name] for name in EQUIPMENT}
    used: dict[str, list[str]] = {name: [] for name in RESOURCES}
    means: dict[str, list[str]] = {name: [] for name in (*GROWTH_DRIVERS, "assimilation")}
    for _ in range(STEPS_PER_HOUR):
        inputs = base | {name: equipment[name] for name in CARRIED}
        before = wire_derived(wiring, blocks.climate, state, inputs, parameters)
        shown = wire_measured(wiring, blocks.climate, before, state, parameters, "hour_day")
        set_ = wiring.call(
            blocks.equipment,
            setpoints
            | {f"weather:{name}": tensor for name, tensor in weather.items()}
            | {f"climate:{name}": tensor for name, tensor in (shown | {"par": before["par"]}).items()}
            | {f"memory:{name}": equipment[name] for name in CARRIED}
            | dict(parameters),
        )
        inputs = base | set_
        drivers = wire_derived(wiring, blocks.climate, state, inputs, parameters)
        # Effects see pipes and dosing as they were in the step before; this step's follow from the control block.
        drivers |= {name: equipment[name] for name in ("rail_pipe_excess", "co2_dosing")}
        added, memories = wire_effects(
            wiring, blocks.climate, drivers, state, parameters, seconds=seconds, day="hour_day"
        )
        step = wiring.call(
            blocks.control,
            {f"state:{name}": state[name] for name in climate.STATES}
            | {f"driver:{name}": tensor for name, tensor in drivers.items()}
            | added
            | dict(parameters)
            | setpoints
            | {"shown_temperature": shown["air_temperature"], "shown_co2": shown["air_co2"]},
        )
        state = memories | {name: step[name] for name in climate.STATES}
        equipment = {name: set_[name] for name in CARRIED} | {
            "rail_pipe_excess": step["rail_pipe_excess"],
            "co2_dosing": step["co2"],
        }
        used["heat"].append(step["heat"])
        used["co2"].append(step["co2"])
        used["electricity"].append(set_["lamp_power"])
        for name, parts in means.items():
            parts.append(drivers[name])

    end = wire_derived(wiring, blocks.climate, state, base | {name: equipment[name] for name in CARRIED}, parameters)
    shown = wire_measured(wiring, blocks.climate, end, state, parameters, "hour_day")
    share = wiring.constant("share", [1.0 / STEPS_PER_HOUR])
    mean = {name: wiring.add("Mul", [wiring.total(parts), share])[0] for name, parts in means.items()}
    per_hour = {"heat": 3.6e-3, "electricity": 1e-3, "co2": 1.0}
    resources = [
        wiring.add("Mul", [wiring.total(used[name]), wiring.constant("unit", [per_hour[name] / STEPS_PER_HOUR])])[0]
        for name in RESOURCES
    ]
    balance = {name: mean[name] for name in ("assimilation", "air_temperature")}
    grown = wiring.call(blocks.net_growth, balance | {"net_growth": growth["net_growth"]})
    growth = wiring.call(blocks.growth, _tagged("driver", mean) | _tagged("state", growth)) | grown
    outside = wiring.call(blocks.range, {name: {**shown, **weather}[name] for name in RANGED})["outside"]
    like = state["air_temperature"]
    following = state | growth | equipment
    rows = [*(shown[name] for name in PREDICTED), mean["par"], *resources, *(growth[name] for name in GROWTH), outside]
    for name, tensors in (("carried_next", [following[key] for key in _carried(blocks)]), ("hour_out", rows)):
        wiring.nodes.append(helper.make_node("Identity", [wiring.matrix(tensors, like=like)], [name]))
    return helper.make_graph(
        wiring.nodes,
        "hour",
        [
            float_tensor("carried", (len(_carried(blocks)), "batch")),
            float_tensor("hour_weather", (len(blocks.weather), "w")),
            float_tensor("hour_clock", (len(CLOCK), 1)),
            float_tensor("hour_day", (1,)),
            float_tensor("hour_setpoints", (len(SETPOINTS), "batch")),
        ],
        [
            float_tensor("carried_next", (len(_carried(blocks)), "batch")),
            float_tensor("hour_out", (len(rows), "batch")),
        ],
        wiring.initializers,
    )


def _wire_days(outer: Wiring, blocks: PlanBlocks, climate_out: str, growth_out: str) -> None:
    """Wire the yield stage: the scan over days, on the means of each day."""
    (both,) = outer.add("Concat", [climate_out, growth_out], axis=1)
    shape = outer.add("Shape", [both], start=2, end=3)
    (target,) = outer.add(
        "Concat", [outer.constant("day_shape", [-1, 24, len(CLIMATE_OUT) + len(GROWTH)]), *shape], axis=0
    )
    (days,) = outer.add("Reshape", [both, target])
    (means,) = outer.add("ReduceMean", [days, outer.constant("axis", [1])], keepdims=0)
    (lasts,) = outer.add("Gather", [days, outer.constant("last", [23])], axis=1)
    (lasts,) = outer.add("Squeeze", [lasts, outer.constant("axis", [1])])

    wiring = Wiring("day")
    mean = wiring.rows("day_mean", (*CLIMATE_OUT, *GROWTH))
    last = wiring.rows("day_last", (*CLIMATE_OUT, *GROWTH))
    carried = wiring.rows("day_carried", (*YIELD, "net_growth"))
    (grown,) = wiring.add("Sub", [last["net_growth"], carried["net_growth"]])
    drivers = mean | {"growth_of_day": grown}
    harvest = wiring.call(
        blocks.harvest, _tagged("driver", drivers) | _tagged("state", {name: carried[name] for name in YIELD})
    )
    outputs = {
        "day_carried_next": [*(harvest[name] for name in YIELD), last["net_growth"]],
        "day_out": list(harvest.values()),
    }
    for name, tensors in outputs.items():
        wiring.nodes.append(helper.make_node("Identity", [wiring.matrix(tensors)], [name]))
    count = len(CLIMATE_OUT) + len(GROWTH)
    body = helper.make_graph(
        wiring.nodes,
        "day",
        [
            float_tensor("day_carried", (len(YIELD) + 1, "batch")),
            float_tensor("day_mean", (count, "batch")),
            float_tensor("day_last", (count, "batch")),
        ],
        [float_tensor("day_carried_next", (len(YIELD) + 1, "batch")), float_tensor("day_out", (len(YIELD), "batch"))],
        wiring.initializers,
    )
    start = outer.matrix([*outer.rows("harvest", YIELD).values(), outer.rows("growth", GROWTH)["net_growth"]])
    _, harvested = outer.add("Scan", [start, means, lasts], 2, body=body, num_scan_inputs=2)
    outer.nodes.append(helper.make_node("Identity", [harvested], ["harvest_out"]))


def _climate_inputs(
    blocks: PlanBlocks, weather: Mapping[str, str], clock: Mapping[str, str], leaf_area_index: str, zero: str
) -> dict[str, str]:
    """Return the climate stage's inputs with the equipment at rest; pipes and CO2 come from the control block."""
    offered = dict(weather) | dict(clock) | {"leaf_area_index": leaf_area_index}
    return {name: offered.get(name, zero) for name in blocks.climate.inputs}


def _equipment(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
    """Lamps, screens, vents and irrigation by the fitted rules; the vents no faster than a step can bear."""
    named = grouped(arrays)
    slow = named["actuation"] | {"vent_lag": xp.maximum(named["actuation"]["vent_lag"], _SECONDS / 60.0)}
    climate_now = named["climate"]
    pipes = dict.fromkeys(("rail_pipe_temperature", "grow_pipe_temperature"), 0.0 * climate_now["air_temperature"])
    memory = named["memory"] | pipes
    result = actuation.act(xp, named["setpoint"], named["weather"], climate_now, memory, slow, seconds=_SECONDS)
    return {name: result[name] for name in (*CARRIED, "lamp_power", "irrigation")}


def _control(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
    """Heat and CO2 that hold the setpoints, and the state at the end of the step."""
    named = grouped(arrays)
    state, drivers, settings = named["state"], named["driver"], named["holding"]
    parameters, setpoints = named["parameter"], named["setpoint"]
    temperature = state["air_temperature"]
    zero = 0.0 * temperature
    idle = drivers | {"rail_pipe_excess": zero, "grow_pipe_excess": zero, "co2_dosing": zero}
    parts = climate.balances(xp, state, idle, parameters, named.get("added", {}))
    heat = holding.heat_to_hold(
        xp, setpoints["heating_setpoint"], arrays["shown_temperature"], parts["air_temperature"], settings, _SECONDS
    )
    wanted = setpoints["co2_setpoint"] + settings["co2_offset"]
    missing = air.co2_concentration(temperature, wanted) - air.co2_concentration(temperature, arrays["shown_co2"])
    vents = 0.005 * (drivers["vent_lee"] + drivers["vent_wind"])
    dose = holding.co2_to_hold(xp, missing, parts["co2_concentration"], vents, settings, _SECONDS)
    given = {"air_temperature": heat, "co2_concentration": parameters["dosing_share"] * dose / 3600.0}
    following = {}
    for name, (flux, conductance, capacity) in parts.items():
        decay = xp.exp(-_SECONDS * conductance / capacity)
        following[name] = state[name] + (flux + given.get(name, 0.0)) / conductance * (1.0 - decay)
    pipes = parameters["rail_pipe_heat_transfer"] + settings["grow_share"] * parameters["grow_pipe_heat_transfer"]
    return following | {"heat": heat, "co2": dose, "rail_pipe_excess": heat / pipes}


def _crop_block(name: str, stage: network.Stage, drivers: Sequence[str]) -> Block:
    """Trace one step of a crop stage over tensors of (batch,)."""
    if stage.drivers != tuple(drivers) or stage.time_constants or stage.clock:
        raise ValueError(f"the {name} stage must read {', '.join(drivers)} and nothing else")

    def formula(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
        named = grouped(arrays)
        like = 0.0 * named["state"][stage.states[0]]
        read = xp.stack([named["driver"][driver] + like for driver in stage.drivers], axis=-1)
        state = xp.stack([named["state"][one] + like for one in stage.states], axis=-1)
        bounds = {"low": xp.asarray(stage.low), "high": xp.asarray(stage.high)}
        # Beyond what it was trained on a network knows nothing: there it goes on as at the edge. How much was grown
        # or picked before is no reason to grow: of a cumulative state it sees the mean.
        edge = np.where(np.array(stage.cumulative), 0.0, _EDGE).astype(np.float32)
        inside = _clipped(xp, state, stage.state_offset, edge * stage.state_scale)
        read = _clipped(xp, read, stage.feature_offset, _EDGE * stage.feature_scale)
        following, _ = network.advance(xp, replace(stage, **bounds), inside, read, read[..., :0])
        following = following + (state - inside)
        return {one: following[..., column] for column, one in enumerate(stage.states)}

    return trace(name, formula, [f"driver:{one}" for one in drivers] + [f"state:{one}" for one in stage.states])


def _net_growth_formula(crop: CropStages) -> Any:
    def formula(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
        rate = net_growth_rate(xp, arrays["assimilation"], arrays["air_temperature"], crop.conversion, crop.maintenance)
        return {"net_growth": arrays["net_growth"] + rate}

    return formula


def _clipped(xp: Any, values: Any, middle: Any, width: Any) -> Any:
    low, high = xp.asarray(middle - width), xp.asarray(middle + width)
    return xp.minimum(xp.maximum(values, low), high)


def _range_formula(known: Mapping[str, tuple[float, float]]) -> Any:
    """Return the formula of the largest distance from the known ranges, in widths of the range."""

    def formula(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
        outside = 0.0 * arrays["air_temperature"]
        for name in RANGED:
            low, high = known.get(name, (-1e9, 1e9))
            width = max(high - low, 1e-6)
            outside = xp.maximum(outside, (arrays[name] - high) / width)
            outside = xp.maximum(outside, (low - arrays[name]) / width)
        return {"outside": outside}

    return formula


def _tagged(group: str, tensors: Mapping[str, str]) -> dict[str, str]:
    return {f"{group}:{name}": tensor for name, tensor in tensors.items()}


def _first(wiring: Wiring, tensor: str) -> str:
    """Return the first entry along the first axis."""
    (entry,) = wiring.add("Gather", [tensor, wiring.constant("first", [0])], axis=0)
    return wiring.add("Squeeze", [entry, wiring.constant("axis", [0])])[0]
