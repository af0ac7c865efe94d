"""A greenhouse in spring as the page meets it: its files, a month of log, and a daemon that says what a test wants."""

from __future__ import annotations

import asyncio
import contextlib
import re
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from igrow.core.errors import IgrowError
from igrow.edge.image import Quality, Value
from igrow.edge.page.pages import Pages
from igrow.edge.page.server import PageServer
from igrow.edge.page.state import Daemon
from igrow.edge.store import SqliteStore

ROOT = Path(__file__).resolve().parents[2]
NOW = 1_773_500_400.0
"""Saturday 14 March 2026, 16:00 in Amsterdam."""
PASSWORD = "tomatoes are red"
DAEMON = f"""
site: site.yaml
register_map: {ROOT}/config/register-maps/virtual-plc.yaml
state: state
cycle: {{clock: plc}}
"""
SITE = """
name: hillside-3
latitude: 52.03
longitude: 4.52
time_zone: Europe/Amsterdam
greenhouse: {floor_area: 1000}
crop: {planting_date: 2025-12-16}
"""


TESTS = """
separating_tests: {permitted: true}
guard:
  points:
    vent_lee: {low: 0, high: 60, safe: 0, slew: 200, dead_band: 1, minimum_interval: 3 min}
"""
"""Lets the grower approve tests."""
CONFOUNDED = ["vent_backlash", "wind_infiltration"]
"""What the diagnosis could not tell apart, where a test wants that."""


def found_in(pattern: str, text: str) -> str:
    """The part of the text that stands where the pattern's parentheses are."""
    found = re.search(pattern, text, re.MULTILINE)
    assert found is not None
    return found[1]


def write_greenhouse(folder: Path, daemon: str = "", site: str = "") -> Path:
    """Write the files of a greenhouse; returns the daemon's."""
    (folder / "state").mkdir(parents=True, exist_ok=True)
    (folder / "site.yaml").write_text(SITE + site)
    path = folder / "daemon.yaml"
    path.write_text(DAEMON + daemon)
    return path


def fill_log(folder: Path, days: float = 31.0, step: float = 300.0) -> None:
    """Leave a log that ends now."""
    store, random = SqliteStore(folder / "state" / "store"), np.random.default_rng(1)
    for time in np.arange(NOW - days * 86_400.0, NOW + 1.0, step):
        hour = (time / 3600.0 + 1.0) % 24.0
        sun = max(0.0, np.sin((hour - 6.5) / 11.5 * np.pi)) * (0.75 + 0.25 * np.sin(time / 2e5))
        heating = 20.5 if 7 <= hour < 17 else 19.0 if 17 <= hour < 20 else 17.0 if hour >= 20 or hour < 1 else 18.5
        values = {
            "air_temperature": heating + 2.2 * sun + 0.1 * random.standard_normal(),
            "air_humidity": 86.0 - 9.0 * sun + 0.6 * random.standard_normal(),
            "air_co2": (780.0 if 1 <= hour < 17 else 470.0) - 120.0 * sun + 8.0 * random.standard_normal(),
            "par": 380.0 * sun + (100.0 if 1 <= hour < 9 else 0.0),
            "global_radiation": 520.0 * sun,
            "outdoor_temperature": 6.0 + 4.0 * sun + 2.0 * np.sin(time / 3e5),
            "wind_speed": 4.0 + np.sin(time / 5e4) + 0.2 * random.standard_normal(),
            "rail_pipe_temperature": 48.0 - 18.0 * sun,
            "grow_pipe_temperature": 34.0 - 8.0 * sun,
            "vent_lee": 25.0 * sun,
            "vent_wind": 8.0 * sun,
            "energy_screen": 0.0 if sun else 95.0,
            "lamp_power": 81.0 if 1 <= hour < 9 else 0.0,
            "co2_dosing": 0.004 if 1 <= hour < 17 else 0.0,
            "heating_setpoint": heating,
            "co2_setpoint": 800.0 if 1 <= hour < 17 else 400.0,
            "lamp_on": float(1 <= hour < 9),
            "irrigation_on": float(3 <= hour < 16),
        }
        store.append(float(time), {name: Value(float(value), Quality.GOOD, 0.0) for name, value in values.items()})
    store.close()


def amount(mean: float, deviation: float = 0.0) -> dict[str, float]:
    return {"mean": mean, "deviation": deviation}


def change(setpoint: str, first: int, last: int, plan: float, recipe: float, **parts: float) -> dict[str, Any]:
    """A change of the plan below, from one of its hours to another."""
    every = {"income": 0.0, "heat": 0.0, "electricity": 0.0, "co2": 0.0} | parts
    gain = every["income"] - every["heat"] - every["electricity"] - every["co2"]
    return {
        "setpoint": setpoint, "start": NOW + 3600.0 * first, "end": NOW + 3600.0 * last, "plan": plan,
        "recipe": recipe, "parts": every, "gain": amount(gain, 0.1 * abs(gain)),
    }  # fmt: skip


def plan(**changes: Any) -> dict[str, Any]:
    """A plan of 24 hours that begins now, as the daemon's JSON holds it."""
    hours = np.arange(24)
    clock = (hours + 16) % 24
    heating = np.where(clock < 7, 17.5, np.where(clock < 17, 20.5, np.where(clock < 20, 19.0, 17.0)))
    heating[4:8] = 16.0
    lamps = ((clock >= 1) & (clock < 17)).astype(float)
    lamps[2:6] = 1.0
    co2 = np.where((clock >= 1) & (clock < 17), 900.0, 400.0)
    return {
        "created": NOW, "start": NOW, "step_seconds": 3600.0, "valid_until": NOW + 86_400.0,
        "bundle": "hillside-3-20260314-3f2a9c1d", "expected_profit": 0.214, "recipe_profit": 0.176, "co2_before": 21.0,
        "leaves_range": False, "note": "", "problem": "",
        "setpoints": {
            "heating_setpoint": heating.tolist(), "co2_setpoint": co2.tolist(), "lamp_on": lamps.tolist(),
            "irrigation_on": ((clock >= 3) & (clock < 16)).astype(float).tolist(),
        },
        "predicted": {
            "air_temperature": (heating + 0.4).tolist(),
            "air_humidity": (84.0 + 3.0 * np.sin(hours / 4.0)).tolist(),
            "air_co2": (0.92 * co2 + 40.0).tolist(),
        },
        "binding": {"heating_setpoint": [["night_temperature"] if 4 <= hour < 8 else [] for hour in range(24)]},
        "explanation": {
            "plan": {
                "income": amount(0.392, 0.02), "heat": amount(0.041, 0.003), "electricity": amount(0.093),
                "co2": amount(0.018, 0.001), "profit": amount(0.214, 0.02),
            },
            "recipe": {
                "income": amount(0.334, 0.02), "heat": amount(0.052, 0.003), "electricity": amount(0.067),
                "co2": amount(0.013, 0.001), "profit": amount(0.176, 0.02),
            },
            "gain": amount(0.038, 0.004),
            "changes": [
                change("lamp_on", 2, 6, 1.0, 0.0, income=0.046, heat=-0.004, electricity=0.026),
                change("heating_setpoint", 4, 8, 16.0, 17.4, income=-0.003, heat=-0.009),
                change("co2_setpoint", 9, 24, 900.0, 800.0, income=0.015, co2=0.005),
            ],
        },
    } | changes  # fmt: skip


def good(value: float) -> dict[str, Any]:
    return {"value": value, "quality": "good", "age": 3.0, "why": ""}


def setpoint(value: float, **more: Any) -> dict[str, Any]:
    return {
        "requested": value, "applied": value, "shown": value, "source": "plan", "why": "the plan of 14 Mar 15:00 UTC",
        "held_until": None,
    } | more  # fmt: skip


def alarm(name: str, text: str, level: str, ago: float = 900.0) -> dict[str, Any]:
    return {"time": NOW - ago, "monotonic": 0.0, "name": name, "active": True, "text": text, "level": level}


def clamp(point: str, asked: float, applied: float, reason: str, ago: float = 600.0) -> dict[str, Any]:
    return {
        "time": NOW - ago, "monotonic": 0.0, "point": point, "requested": asked, "applied": applied,
        "source": "plan", "reason": reason, "outcome": "clamped",
    }  # fmt: skip


def state(**changes: Any) -> dict[str, Any]:
    """What a daemon says on a quiet afternoon."""
    return {
        "site": "hillside-3", "time": NOW, "monotonic": 5000.0, "clock_ok": True, "cycle": 12345,
        "cycle_seconds": 0.0042, "link_ok": True, "source": "plan", "why": "the plan of 14 Mar 15:00 UTC",
        "values": {
            "air_temperature": good(21.3), "air_humidity": good(79.0), "air_co2": good(742.0), "par": good(214.0),
            "global_radiation": good(288.0), "outdoor_temperature": good(9.4), "vent_lee": good(12.0),
            "wind_speed": {"value": 4.1, "quality": "frozen", "age": 3.0, "why": "exactly 4.1 m s-1 for 0.7 h"},
            "sky_temperature": {"value": None, "quality": "missing", "age": None, "why": "never read"},
        },
        "setpoints": {
            "heating_setpoint": setpoint(20.5), "co2_setpoint": setpoint(900.0, shown=850.0), "lamp_on": setpoint(1.0),
            "irrigation_on": setpoint(0.0),
        },
        "clamps": [
            clamp("heating_setpoint", 31.0, 28.0, "above the limit of 28 degC"),
            clamp("co2_setpoint", 900.0, 850.0, "slew of 600 ppm per hour on the way to 900 ppm"),
            clamp("heating_setpoint", 20.5, 19.0, "the crop's temperature_drift", 4000.0),
        ],
        "alarms": [alarm("sensor wind_speed", "wind_speed is frozen: exactly 4.1 m s-1 for 0.7 h", "warning")],
        "plan": plan(),
        "bundle": {
            "name": "hillside-3-20260314-3f2a9c1d", "effects": ["wind_infiltration"], "candidate": None, "refusal": "",
            "live_errors": {"air_temperature 1_h": 0.31, "air_temperature 24_h": 0.54},
            "confounded": [],
            "last_verdict": "adopted: errors in the shadow run are 0.61 times those before",
        },
        "problems": [], "writes_left": {},
    } | changes  # fmt: skip


class Told:
    """A daemon that says what a test wants it to."""

    def __init__(self, said: dict[str, Any] | None = None) -> None:
        self.said = state() if said is None else said
        self.silent = False
        self.cycles = 0

    def __call__(self, port: int) -> dict[str, Any]:
        if self.silent:
            raise IgrowError("no daemon answers on port 8420 of this machine; is igrow-edge running?")
        self.cycles += 1
        return {**self.said, "cycle": self.said["cycle"] + self.cycles}


def pages_of(path: Path, told: Told) -> Pages:
    """The pages of a greenhouse whose daemon is played; each look asks it."""
    clock = iter(range(10**9))
    return Pages(path, Daemon(0, path.parent / "none", late_after=1e9, ask=told, monotonic=lambda: 10.0 * next(clock)))


@contextlib.contextmanager
def served(pages: Pages) -> Iterator[PageServer]:
    """Serve pages from a thread of their own."""
    loop, server = asyncio.new_event_loop(), PageServer(pages)
    thread = threading.Thread(target=loop.run_forever, daemon=True)
    thread.start()
    asyncio.run_coroutine_threadsafe(server.start("127.0.0.1", 0), loop).result(30)
    try:
        yield server
    finally:
        asyncio.run_coroutine_threadsafe(server.close(), loop).result(30)
        loop.call_soon_threadsafe(loop.stop)
        thread.join(10)
