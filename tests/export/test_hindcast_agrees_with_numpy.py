"""The exported graph and the numpy formulas are one model: same drivers in, same climate out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid import climate
from igrow.core.simulator.hybrid.measurement import PREDICTED, measured
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.trainer.exporting.blocks import open_model
from igrow.trainer.exporting.climate import ClimateBlocks, climate_blocks, effect_parameter
from igrow.trainer.exporting.hindcast import hindcast_model

SECONDS, ROWS, BATCH = 300.0, 288, 3
HEIGHT, EFFICACY = 5.0, 1.3
Table = NDArray[np.float64]


def drivers_of_a_day(blocks: ClimateBlocks, seed: int) -> Table:
    """Smooth random weather and actuators, (rows, inputs, batch)."""
    random = np.random.default_rng(seed)
    day = 2 * np.pi * np.arange(ROWS)[:, None] / ROWS + random.uniform(0, 6, (1, BATCH))
    ranges = {
        "outdoor_temperature": (-5, 20), "outdoor_humidity": (50, 99), "outdoor_co2": (400, 430),
        "global_radiation": (-400, 700), "wind_speed": (0, 12), "sky_temperature": (-20, 5),
        "rail_pipe_temperature": (0, 60), "grow_pipe_temperature": (0, 50), "vent_lee": (-40, 60),
        "vent_wind": (-60, 40), "energy_screen": (-50, 100), "blackout_screen": (-90, 90), "lamp_power": (-80, 81),
        "co2_dosing": (-0.01, 0.01), "leaf_area_index": (2, 3.5), "wind_direction": (0, 360), "rain": (-1, 1),
        "irrigation": (-1, 1), "sun_elevation": (-50, 50), "sun_azimuth": (60, 300), "hour": (0, 24),
    }  # fmt: skip
    signed = {"outdoor_temperature", "sky_temperature", "sun_elevation"}
    columns = []
    for name in blocks.inputs:
        low, high = ranges[name]
        wave = low + (high - low) * (0.5 + 0.5 * np.sin(day * random.integers(1, 4)))
        columns.append(wave if name in signed else np.maximum(wave, 0.0))
    return np.stack(columns, axis=1)


def values_of(blocks: ClimateBlocks, amplitude: float) -> dict[str, float]:
    """The graph's parameters at their usual values, effects at a share of their typical amplitude."""
    values = {"mean_height": HEIGHT, "lamp_efficacy": EFFICACY}
    for name in blocks.parameters:
        if name.startswith("parameter:"):
            values[name] = PARAMETERS[name.removeprefix("parameter:")].value
        elif name.startswith("effect:"):
            _, effect, part = name.split(":")
            if part != "onset":
                definition = next(one for one in EFFECTS[effect].parameters if one.name == part)
                scale = amplitude if definition is EFFECTS[effect].amplitude else 1.0
                values[name] = definition.typical * scale
            else:
                values[name] = -30.0
    return values


NOWHERE = np.zeros(ROWS, dtype=bool)
MEAN = np.array([19.0, 19.5, 20.0])
"""Air temperature of the day before, degC."""


def run_graph(
    blocks: ClimateBlocks,
    inputs: Table,
    start: Table,
    values: dict[str, float],
    followed: NDArray[np.bool_] = NOWHERE,
) -> Table:
    """Run the graph for a day; where `followed`, the measured climate is `start` again."""
    session = open_model(hindcast_model(blocks))
    feed = {
        "climate": np.vstack([start, MEAN]),
        "inputs": inputs,
        "measured": np.broadcast_to(start, (ROWS, *start.shape)),
        "follow": followed[:, None],
        "day": np.arange(ROWS)[:, None] * SECONDS / 86_400,
        "seconds": np.array([SECONDS]),
        "parameters": np.array([[values[name]] for name in blocks.parameters]),
    }
    result: Table = session.run(None, {name: array.astype(np.float32) for name, array in feed.items()})[0]
    return result


def run_numpy(
    blocks: ClimateBlocks,
    inputs: Table,
    start: Table,
    values: dict[str, float],
    names: list[str],
    followed: NDArray[np.bool_] = NOWHERE,
) -> Table:
    parameters = {name: values[f"parameter:{name}"] for name in PARAMETERS}
    effects: dict[str, dict[str, Any]] = {
        name: {one.name: values[effect_parameter(name, one.name)] for one in EFFECTS[name].parameters} for name in names
    }

    def row(k: int) -> dict[str, Any]:
        elapsed = k * SECONDS / 86_400 + 30.0
        named = dict(zip(blocks.inputs, inputs[k], strict=True))
        return named | {"mean_height": HEIGHT, "elapsed_days": elapsed}

    given = dict(zip(PREDICTED, start, strict=True)) | {"mass_temperature": MEAN, "soil_temperature": MEAN}
    state = climate.initial_state(np, given, row(0), parameters, effects, EFFICACY)
    shown = []
    for k in range(ROWS):
        state = climate.advance(np, state, row(k), parameters, effects, seconds=SECONDS, lamp_efficacy=EFFICACY)
        drivers = climate.derive(np, state, row(k), parameters, EFFICACY)
        shown.append(np.stack([measured(np, drivers, state, effects)[name] for name in PREDICTED]))
        if followed[k]:
            given |= {name: state[name] for name in ("mass_temperature", "soil_temperature")}
            state = climate.initial_state(np, given, row(k), parameters, effects, EFFICACY)
    return np.stack(shown)


START = np.array([[18.0, 20.0, 22.0], [70.0, 80.0, 85.0], [450.0, 700.0, 900.0]])
PROCESSES_AND_SENSORS = [name for name in EFFECTS if name != "pipe_temperature_offset"]


@pytest.mark.parametrize("names", [[], PROCESSES_AND_SENSORS], ids=["no effect", "every effect"])
def test_a_free_day_in_onnx_is_the_free_day_in_numpy(names: list[str]) -> None:
    blocks = climate_blocks(names)
    inputs, values = drivers_of_a_day(blocks, seed=1), values_of(blocks, amplitude=0.3)
    graph = run_graph(blocks, inputs, START, values)
    expected = run_numpy(blocks, inputs, START, values, names)
    for column, tolerance in enumerate((0.01, 0.05, 0.5)):
        assert np.abs(graph[:, column] - expected[:, column]).max() < tolerance, PREDICTED[column]


def test_effects_of_amplitude_zero_leave_the_output_identical() -> None:
    bare, loaded = climate_blocks([]), climate_blocks(list(EFFECTS))
    inputs = drivers_of_a_day(loaded, seed=2)
    known = [loaded.inputs.index(name) for name in bare.inputs]
    without = run_graph(bare, inputs[:, known], START, values_of(bare, amplitude=0.0))
    with_all = run_graph(loaded, inputs, START, values_of(loaded, amplitude=0.0))
    np.testing.assert_array_equal(with_all, without)


@pytest.mark.parametrize("name", list(EFFECTS))
def test_every_effect_stands_in_the_graph_as_a_node_of_its_own(name: str) -> None:
    model = hindcast_model(climate_blocks([name]))
    functions = {function.name for function in model.functions}
    assert {name, "climate", "balances"} <= functions


def test_where_it_follows_it_takes_the_measured_climate_and_keeps_the_floor() -> None:
    blocks = climate_blocks([])
    inputs, values = drivers_of_a_day(blocks, seed=3), values_of(blocks, amplitude=0.0)
    followed = np.arange(ROWS) < ROWS // 2
    graph = run_graph(blocks, inputs, START, values, followed)
    expected = run_numpy(blocks, inputs, START, values, [], followed)
    free = run_numpy(blocks, inputs, START, values, [])
    assert np.abs(graph[:, 0] - expected[:, 0]).max() < 0.01
    assert np.abs(expected[:, 0] - free[:, 0]).max() > 0.5
