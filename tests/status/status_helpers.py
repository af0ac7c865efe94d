"""A snapshot of a greenhouse in spring."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from igrow.edge.image import Quality, Value
from igrow.edge.ports import Plan, SetpointStatus, Snapshot
from igrow.edge.records import AlarmRecord, WriteRecord

NOW = 1_773_500_400.0


def good(value: float) -> Value:
    return Value(value, Quality.GOOD, 3.0)


def plan() -> Plan:
    hours = np.arange(24)
    warm = 18.0 + 2.5 * np.sin((hours - 2) / 24 * 2 * np.pi)
    return Plan(
        created=NOW,
        start=NOW,
        step_seconds=3600.0,
        setpoints={"heating_setpoint": tuple(np.round(warm, 1)), "co2_setpoint": (800.0,) * 24},
        valid_until=NOW + 86400,
        bundle="demo-20260314-3f2a9c1d",
        expected_profit=0.214,
        recipe_profit=0.176,
        predicted={"air_temperature": tuple(warm + 1.0 + np.sin(hours / 3))},
    )


def snapshot(**changes: Any) -> Snapshot:
    made = Snapshot(
        site="Hillside 3",
        time=NOW,
        monotonic=5000.0,
        clock_ok=True,
        cycle=12345,
        cycle_seconds=0.0042,
        link_ok=True,
        source="plan",
        why="The plan of 15:00 is valid and every sensor it needs is good.",
        values={
            "air_temperature": good(20.6),
            "air_humidity": good(81.0),
            "air_co2": good(742.0),
            "global_radiation": good(388.0),
            "outdoor_temperature": good(9.4),
            "wind_speed": Value(4.1, Quality.FROZEN, 3.0, "unchanged for 42 min"),
            "vent_lee": good(12.0),
            "rail_pipe_temperature": good(43.0),
            "sky_temperature": Value(None, Quality.MISSING, float("inf"), "never read"),
        },
        setpoints={
            "heating_setpoint": SetpointStatus(19.4, 19.4, 19.4, "plan", "cheap heat now, less at the evening's price"),
            "co2_setpoint": SetpointStatus(1200.0, 1000.0, 1000.0, "plan", "vents are almost shut"),
            "lamp_on": SetpointStatus(0.0, 0.0, 0.0, "recipe", "the PLC holds no plan for lamps", 5900.0),
        },
        clamps=(
            WriteRecord(
                NOW - 600, 4400.0, "co2_setpoint", 1200.0, 1000.0, "plan", "above the limit of 1000 ppm", "written"
            ),
        ),
        alarms=(AlarmRecord(NOW, 5000.0, "frozen", True, "Wind speed has not changed for 42 minutes: check it."),),
        plan=plan(),
        bundle={
            "name": "demo-20260314-3f2a9c1d",
            "effects": ["wind_infiltration"],
            "live_errors": {
                "air_temperature 1_h": 0.31,
                "air_temperature 24_h": 0.54,
                "air_humidity 1_h": 1.7,
                "air_humidity 24_h": 2.6,
            },
            "live_error_history": [
                [NOW - 21600 * (40 - k), {"air_temperature 24_h": 0.9 - 0.4 * (k > 25) + 0.08 * np.sin(k)}]
                for k in range(40)
            ],
            "last_verdict": "demo-20260314-3f2a9c1d adopted: errors in the shadow run are 0.61 times those before",
            "candidate": None,
            "refusal": "",
        },
        problems=(),
        writes_left={"heating_setpoint": 31},
    )
    return dataclasses.replace(made, **changes)
