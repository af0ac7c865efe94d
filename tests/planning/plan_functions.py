"""What the planning process is given to run in tests: planners that behave, hang, crash and grow."""

from __future__ import annotations

import os
import time
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.edge.ports import Plan


def good(site, request) -> Plan:
    print("a library that prints must not break the answer")
    return Plan(
        created=request.time,
        start=request.time,
        step_seconds=request.step_seconds,
        setpoints={"heating_setpoint": tuple(value + 1 for value in request.recipe["heating_setpoint"])},
        valid_until=request.time + 86400,
        bundle=f"{site.name} {os.getpid()}",
    )


def hang_once(site, request) -> Plan:
    if request.seed == 0:
        time.sleep(600)
    return good(site, request)


def crash_once(site, request) -> Plan:
    if request.seed == 0:
        os.kill(os.getpid(), 11)
    return good(site, request)


def grow_once(site, request) -> Plan:
    if request.seed == 0:
        held = []
        while True:
            held.append(bytearray(2**24))
    return good(site, request)


def refuse(site, request) -> Plan:
    raise IgrowError("the log of the last days holds no wind_speed")


def fail(site, request) -> Plan:
    raise ZeroDivisionError("a fault of ours")


def slow(site, request) -> Plan:
    time.sleep(1.5)
    return good(site, request)


def note_and_hang(path) -> None:
    Path(path).touch()
    time.sleep(600)


def burn() -> None:
    while True:
        pass


def oom_score() -> int:
    return int(Path("/proc/self/oom_score_adj").read_text())
