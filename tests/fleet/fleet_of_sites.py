"""A fleet in a folder: site files, an exchange with sealed segments, and functions that tasks call."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np

from igrow.core.exchange import FolderPlace, Seal, pack_segment
from igrow.core.telemetry import Telemetry

DAY = 86_400
START = 20_500 * DAY
"""2026-02-16, a midnight."""


def make_fleet(folder: Path, names: list[str], **settings: object) -> Path:
    """Write fleet.yaml and the site files; returns the fleet's folder."""
    fleet = folder / "fleet"
    (fleet / "sites").mkdir(parents=True)
    lines = [
        "# the growers' cooperative",
        "exchange: ../exchange",
        *(f"{key}: {value}" for key, value in settings.items()),
    ]
    (fleet / "fleet.yaml").write_text("\n".join(lines) + "\n")
    for name in names:
        (fleet / "sites" / f"{name}.yaml").write_text(f"name: {name}  # ours\nlatitude: 52\nlongitude: 4.5\n")
    return fleet


def leave_day(exchange: Path, site: str, number: int, previous: str = "", *, step: int = 600) -> str:
    """Leave one day's segment in the exchange; returns its digest."""
    start = START + (number - 1) * DAY
    time = np.arange(start, start + DAY, step).astype("datetime64[s]")
    values = 20.0 + np.sin(np.arange(len(time)) / 20.0 + len(site))
    seal = Seal(
        site, "c" * 12, number, previous, start, start + DAY, start + DAY, "0.1.0",
        {"air_temperature": "degC"}, 0, "", 0, "", 0,
    )  # fmt: skip
    name, data = pack_segment(seal, Telemetry(time, {"air_temperature": values}), [])
    FolderPlace(exchange).put(f"{site}/segments/{name}", data)
    return name.digest


# --- what tasks of the tests do --------------------------------------------------------------------------------


def compute(seed: int, marks: str = "") -> dict[str, Any]:
    """Return digits that depend on every one before them."""
    if marks:
        with Path(marks).open("a") as file:
            file.write(f"{seed}\n")
    values = np.random.default_rng(seed).normal(size=400).reshape(20, 20)
    return {"sum": float(np.linalg.svd(values)[1].sum()), "determinant": float(np.linalg.det(values))}


def fail(sentence: str) -> None:
    from igrow.core.errors import IgrowError

    raise IgrowError(sentence)


def divide() -> float:
    return 1 / 0


def eat_memory() -> int:
    return len(b"x" * (2 * 2**30))


def sleep(seconds: float) -> None:
    time.sleep(seconds)


def end_by_force(marks: str, times: int) -> dict[str, Any]:
    """Kill this very process, the first `times` times."""
    path = Path(marks)
    done = len(path.read_text()) if path.exists() else 0
    path.write_text("x" * (done + 1))
    if done < times:
        os.kill(os.getpid(), signal.SIGKILL)
    return {"attempt": done + 1}
