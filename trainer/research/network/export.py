"""The network variant as a bundle: `simulator.onnx` runs a day of all three stages, unrolled, for any batch.

A call takes what the day before handed on, the day's weather and setpoints, and the hours of the day; it gives the
course of every state and what the next day needs, so that a season is one call a day. The graph is traced from
the functions that run in numpy (`igrow_core/simulator/network_run.py`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from onnx import ModelProto

from igrow import __version__
from igrow.core.bundle import Bundle, Golden, GraphSignature, Manifest, Tensor, run_graph, write_bundle
from igrow.core.planner.evolution import EvolutionSettings
from igrow.core.quantities import QUANTITIES
from igrow.core.simulator.network import HOURS, NetworkSimulator
from igrow.core.simulator.network_run import Carried, begin, known_inputs, run_harvest, run_hour
from igrow.trainer.exporting.blocks import OPSET, Block, Shape, open_model, trace_shaped, traceable
from igrow.trainer.exporting.optimizer import export_optimizer, optimizer_inputs, optimizer_signature
from igrow.trainer.exporting.wiring import Wiring, finished_model
from igrow.trainer.research.network.checkpoint import FILE_NAME, STAGES, simulator_to_bytes

CARRIED = tuple(field.name for field in fields(Carried))
UNITS = {
    "hour": "h",
    "thermal_time": "degC d",
    "crop_age": "d",
    "ventilation_offset": "K",
    "lamp_radiation_limit": "W m-2",
}
"""Of inputs that are no quantities of the registry."""
NEXT = "next_"
"""Prefix of the outputs that the next call takes in."""


def hourly_outputs(simulator: NetworkSimulator) -> tuple[str, ...]:
    """Return the rows of the output `hourly`."""
    return (*simulator.climate.states, *simulator.growth.states, "par", "thermal_time", "crop_age")


def carried_widths(simulator: NetworkSimulator) -> dict[str, int]:
    """Return the last axis of each carried tensor."""
    widths = dict.fromkeys(CARRIED, 1)
    for name in STAGES:
        stage = getattr(simulator, name)
        widths |= {name: len(stage.states), f"{name}_memory": stage.memory_size}
    return widths


def day_model(simulator: NetworkSimulator) -> ModelProto:
    """Return the graph of one day: the block of an hour, 24 times, and the block of the harvest.

    Inputs, float32: the fields of `Carried` (batch, w), `known` (24, batch, names) and `hour` (24, 1), the hour of the
    day at each hour's end. Outputs: `hourly` (24, batch, names), `daily` (batch, states of the harvest) and the carried
    tensors, their names with `next_` before them.
    """
    widths = carried_widths(simulator)
    hour_block, day_block = _hour_block(simulator), _harvest_block(simulator)
    wiring = Wiring("day")
    carried = {name: name for name in widths}
    axis = wiring.constant("axis", [0])
    rows = []
    for row in range(HOURS):
        number = wiring.constant("row", np.array(row))
        (known,) = wiring.add("Gather", ["known", number], axis=0)
        (hour,) = wiring.add("Gather", ["hour", number], axis=0)
        out = wiring.call(hour_block, {**carried, "known": known, "hour": hour})
        carried |= {name: out[NEXT + name] for name in widths if NEXT + name in out}
        rows.append(wiring.add("Unsqueeze", [out["row"], axis])[0])
    (hourly,) = wiring.add("Concat", rows, axis=0)
    (means,) = wiring.add("ReduceMean", [hourly, axis], keepdims=0)
    out = wiring.call(day_block, {"means": means, "harvest": "harvest", "harvest_memory": "harvest_memory"})
    carried |= {name: out[NEXT + name] for name in ("harvest", "harvest_memory")}
    finals = {"hourly": hourly, "daily": out[NEXT + "harvest"]}
    finals |= {NEXT + name: tensor for name, tensor in carried.items()}
    for name, tensor in finals.items():
        wiring.output(name, tensor)
    outputs = {"hourly": (HOURS, "batch", len(hourly_outputs(simulator))), "daily": ("batch", widths["harvest"])}
    outputs |= {NEXT + name: ("batch", width) for name, width in widths.items()}
    inputs: dict[str, Shape] = {name: ("batch", width) for name, width in widths.items()}
    inputs |= {"known": (HOURS, "batch", len(known_inputs(simulator))), "hour": (HOURS, 1)}
    return finished_model(wiring.graph("simulator", inputs, outputs), [hour_block, day_block])


def _hour_block(simulator: NetworkSimulator) -> Block:
    """Trace `run_hour`."""
    names, widths = known_inputs(simulator), carried_widths(simulator)

    def formula(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
        carried = Carried(**{name: arrays[name] for name in widths})
        known = {name: arrays["known"][:, row : row + 1] for row, name in enumerate(names)}
        hour = arrays["hour"] + 0.0 * known[names[0]]
        following, values = run_hour(xp, _traceable(simulator), carried, known, hour)
        row = xp.concat([values[name] for name in hourly_outputs(simulator)], axis=-1)
        parts = {NEXT + name: getattr(following, name) for name in widths if not name.startswith("harvest")}
        return parts | {"row": row}

    shapes: dict[str, Shape] = {name: ("batch", width) for name, width in widths.items()}
    return trace_shaped("hour", formula, {**shapes, "known": ("batch", len(names)), "hour": (1,)})


def _harvest_block(simulator: NetworkSimulator) -> Block:
    """Trace the harvest of a day from the means of its hours."""
    names, widths = hourly_outputs(simulator), carried_widths(simulator)

    def formula(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
        means = {name: arrays["means"][:, row : row + 1] for row, name in enumerate(names)}
        harvest, memory = run_harvest(
            xp, _traceable(simulator).harvest, arrays["harvest"], arrays["harvest_memory"], means
        )
        return {NEXT + "harvest": harvest, NEXT + "harvest_memory": memory}

    shapes: dict[str, Shape] = {name: ("batch", widths[name]) for name in ("harvest", "harvest_memory")}
    return trace_shaped("harvest", formula, {**shapes, "means": ("batch", len(names))})


def write_network_bundle(
    folder: Path,
    simulator: NetworkSimulator,
    *,
    site: str,
    created: datetime,
    training_range: Mapping[str, tuple[float, float]],
) -> Bundle:
    """Export a simulator and write its bundle to `folder`, which must not exist yet.

    Raises:
        BundleError: the bundle cannot be written.
    """
    random = np.random.default_rng(0)
    settings = EvolutionSettings()
    graphs = {"simulator": day_model(simulator), "optimizer": export_optimizer(settings)}
    inputs = {
        "simulator": _golden_day(simulator, training_range, random),
        "optimizer": optimizer_inputs(settings, random),
    }
    golden = {name: Golden(given, run_graph(open_model(graphs[name]), given)) for name, given in inputs.items()}
    manifest = Manifest(
        site=site,
        created=created.astimezone(UTC),
        igrow_version=__version__,
        variant="network",
        opset=OPSET,
        graphs={"simulator": _signature(simulator), "optimizer": optimizer_signature(graphs["optimizer"])},
        training_range=training_range,
    )
    files = {f"{name}.onnx": graph.SerializeToString() for name, graph in graphs.items()}
    files[FILE_NAME] = simulator_to_bytes(simulator)
    return write_bundle(folder, manifest, files, golden)


def _traceable(simulator: NetworkSimulator) -> NetworkSimulator:
    """Return the simulator with stages that can be traced."""
    stages: dict[str, Any] = {name: traceable(getattr(simulator, name)) for name in STAGES}
    return replace(simulator, **stages)


def _golden_day(
    simulator: NetworkSimulator, training_range: Mapping[str, tuple[float, float]], random: np.random.Generator
) -> dict[str, NDArray[np.float32]]:
    """Return two days somewhere in the range of the training data."""
    runs = 2

    def within(name: str, hours: int) -> NDArray[np.float32]:
        low, high = training_range[name]
        return random.uniform(low, high, (runs, hours)).astype(np.float32)

    names = known_inputs(simulator)
    states = (*simulator.climate.states, *simulator.growth.states, *simulator.harvest.states)
    known = {name: within(name, HOURS) for name in names} | {name: within(name, 1) for name in states}
    carried = begin(simulator, {name: values.astype(np.float64) for name, values in known.items()})
    return {name: np.asarray(value, dtype=np.float32) for name, value in vars(carried).items()} | {
        "known": np.stack([known[name].T for name in names], axis=-1),
        "hour": np.arange(1.0, HOURS + 1.0, dtype=np.float32)[:, None] % HOURS,
    }


def _signature(simulator: NetworkSimulator) -> GraphSignature:
    rows = {
        "known": known_inputs(simulator),
        "hour": ("hour",),
        "hourly": hourly_outputs(simulator),
        "daily": simulator.harvest.states,
    }
    axes = {"known": ("hour", "batch", "quantity"), "hour": ("hour", "1"), "hourly": ("hour", "batch", "quantity")}

    def tensor(name: str) -> Tensor:
        quantities = rows.get(name, ())
        units = tuple(QUANTITIES[one].unit if one in QUANTITIES else UNITS[one] for one in quantities)
        return Tensor(name, axes.get(name, ("batch", "quantity")), quantities, units)

    inputs = (*CARRIED, "known", "hour")
    outputs = ("hourly", "daily", *(NEXT + name for name in CARRIED))
    return GraphSignature(tuple(map(tensor, inputs)), tuple(map(tensor, outputs)))
