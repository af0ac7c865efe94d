"""Inputs of a hybrid bundle's self-test: a plausible day."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from igrow.core.arrays import Floats
from igrow.core.planner.evolution import EvolutionSettings
from igrow.core.simulator.plan import CLOCK, EQUIPMENT
from igrow.trainer.exporting.optimizer import optimizer_inputs
from igrow.trainer.exporting.plan import PlanBlocks


def golden_inputs(
    blocks: PlanBlocks, values: Mapping[str, float], settings: EvolutionSettings, random: np.random.Generator
) -> dict[str, dict[str, NDArray[Any]]]:
    """Return inputs of each graph by name, float32.

    Args:
        blocks: of the planning graph.
        values: of each row of the graphs' input `parameters`.
        settings: of the optimizer.
        random: draws the wind, and the optimizer's inputs.
    """
    hours, batch = 24, 2
    hour = np.arange(hours)
    sun = np.maximum(np.sin((hour - 6) / 12 * np.pi), 0.0)
    course = {
        "outdoor_temperature": 8.0 + 4.0 * sun,
        "outdoor_humidity": 85.0 - 20.0 * sun,
        "outdoor_co2": np.full(hours, 415.0),
        "global_radiation": 450.0 * sun,
        "wind_speed": 4.0 + random.uniform(-2, 2, hours),
        "sky_temperature": np.full(hours, -4.0),
        "wind_direction": np.full(hours, 225.0),
        "rain": np.zeros(hours),
        "sun_elevation": 40.0 * sun - 5.0,
        "sun_azimuth": 15.0 * hour,
        "hour": hour.astype(np.float64),
        "vent_lee": 20.0 * sun,
        "rail_pipe_temperature": 45.0 * (1 - sun),
        "leaf_area_index": np.full(hours, 3.0),
    }

    def columns(names: tuple[str, ...]) -> Floats:
        return np.stack([course.get(name, np.zeros(hours)) for name in names], axis=1)[:, :, None]

    def parameters(names: tuple[str, ...]) -> Floats:
        return np.array([[values[name]] for name in names])

    climate = np.array([[18.0, 21.0], [75.0, 82.0], [450.0, 800.0]])
    beginning = np.vstack([climate, [[19.0, 20.0]]])
    asked = {
        "heating_setpoint": 18.0 + 3 * sun,
        "co2_setpoint": 400.0 + 400 * sun,
        "lamp_on": sun > 0,
        "irrigation_on": 0.3 * sun,
        "humidity_setpoint": 85.0 - 5.0 * sun,
        "ventilation_setpoint": 22.0 + 3.0 * sun,
        "minimum_pipe_setpoint": 40.0 * (1.0 - sun),
        "energy_screen_setpoint": 100.0 - 40.0 * sun,
    }
    setpoints = np.stack([asked[name] for name in blocks.setpoints], axis=1)[:, :, None]
    inputs: dict[str, dict[str, NDArray[Any]]] = {
        "simulator": {
            "climate": beginning,
            "growth": np.array([[2.5, 3.0], [80.0, 120.0], [0.5, 1.0]]),
            "harvest": np.array([[0.0, 3.0]]),
            "equipment": np.zeros((len(EQUIPMENT), batch)),
            "weather": columns(blocks.weather),
            "clock": columns(CLOCK),
            "day": np.full((hours, 1), 30.0),
            "setpoints": np.tile(setpoints, (1, 1, batch)),
            "parameters": parameters(blocks.parameters),
        },
        "hindcast": {
            "climate": beginning,
            "inputs": np.tile(columns(blocks.climate.inputs), (1, 1, batch)),
            "measured": np.tile(climate, (hours, 1, 1)),
            "follow": (hour < 4).astype(np.float64)[:, None],
            "day": np.full((hours, 1), 30.0),
            "seconds": np.array([300.0]),
            "parameters": parameters(blocks.climate.parameters),
        },
        "optimizer": optimizer_inputs(settings, random),
    }
    return {
        graph: {name: np.ascontiguousarray(array, dtype=np.float32) for name, array in tensors.items()}
        for graph, tensors in inputs.items()
    }
