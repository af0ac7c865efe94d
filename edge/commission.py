"""Commissioning: a person and the daemon check together that a PLC does what the register map says.

Nothing is toggled without being asked for. Each write goes through the guard and its writer, as in control. Last,
the daemon pulls the plug on itself: it stops its heartbeat and checks that the PLC falls back to safe setpoints.
"""

from __future__ import annotations

import asyncio
import math
import time
from datetime import timedelta
from typing import Protocol

from igrow.core.yaml_scalars import duration
from igrow.edge.bus.errors import OtherUnitError
from igrow.edge.bus.plc import Reading, RegisterPlc
from igrow.edge.configuration import Configuration
from igrow.edge.guard import GuardedWriter, GuardRules, GuardState, Request, guard
from igrow.edge.image import Image
from igrow.edge.point_rules import highest_beat
from igrow.edge.registers.model import expected_unit

READ_AGAIN = 2.0
"""Seconds after a write until it is read again."""
LINE_SECONDS = 10.0
"""Seconds that the line may take to come up."""
MOVING = ("plc_clock", "heartbeat")
"""Points that differ at every look."""
SCREENFUL = 8
"""Values that a person compares at once."""
PATIENCE = 10.0
"""Seconds beyond the PLC's heartbeat timeout until a fallback that did not come is a failure."""


class Dialogue(Protocol):
    """The person at the other end."""

    def tell(self, line: str) -> None:
        """Show one line."""

    def ask(self, question: str) -> bool:
        """Return the answer to a yes-or-no question."""


class Console:
    """A person at a terminal; the end of the input means no."""

    def tell(self, line: str) -> None:
        """Print."""
        print(line, flush=True)

    def ask(self, question: str) -> bool:
        """Ask until the answer is yes or no."""
        while True:
            try:
                answer = input(f"{question} [y/n] ").strip().lower()
            except EOFError:
                return False
            if answer in ("y", "yes", "n", "no"):
                return answer.startswith("y")


class Commissioning:
    """One walk through the checks."""

    def __init__(
        self,
        configuration: Configuration,
        dialogue: Dialogue,
        *,
        fallback_after: float = 900.0,
        only_read: bool = False,
        settle: float = READ_AGAIN,
    ) -> None:
        """`fallback_after` is the PLC's heartbeat timeout, `settle` the wait after a write, both in seconds."""
        self._configuration = configuration
        self._dialogue = dialogue
        self._fallback_after = fallback_after
        self._only_read = only_read
        self._settle = settle
        self._wrong: list[str] = []

    async def run(self) -> bool:
        """Walk through all checks; tell whether every one was passed."""
        plc = RegisterPlc(self._configuration.register_map)
        plc.start()
        heartbeat = self._configuration.register_map.points.get("heartbeat")
        writer = GuardedWriter(
            plc, has_heartbeat=heartbeat is not None, highest_beat=highest_beat(heartbeat) if heartbeat else 1
        )
        tell = self._dialogue.tell
        try:
            if not await self._line_is_up(plc):
                return False
            await self._ask_who_they_are(plc)
            await self._confirm_readings(plc)
            if self._only_read:
                tell("setpoints and heartbeat were left alone (--only-read)")
            else:
                await self._try_setpoints(plc, writer)
                await self._pull_the_plug(plc, writer)
        finally:
            await plc.close()
        for line in self._wrong:
            tell(f"NOT PASSED  {line}")
        tell("all checks were passed" if not self._wrong else f"checks not passed: {len(self._wrong)}")
        return not self._wrong

    async def _line_is_up(self, plc: RegisterPlc) -> bool:
        """Wait a little for the line; without it nothing can be checked."""
        ends = time.monotonic() + LINE_SECONDS
        while True:
            readings = await plc.read(list(self._configuration.register_map.points))
            errors = [reading.error for reading in readings.values()]
            if any(error is None for error in errors):
                return True
            if time.monotonic() > ends:
                self._dialogue.tell(f"NOT PASSED  no point can be read: {errors[0] if errors else 'the map is empty'}")
                return False
            await asyncio.sleep(0.5)

    async def _ask_who_they_are(self, plc: RegisterPlc) -> None:
        """Compare what each unit says of itself with the map."""
        for name, device in self._configuration.register_map.devices.items():
            error = await plc.not_itself(name)
            if error is not None:
                self._wrong.append(str(error))
            elif device.identity is not None:
                self._dialogue.tell(f"  unit {name} shows its identity: {device.identity}")

    async def _confirm_readings(self, plc: RegisterPlc) -> None:
        """Compare the values with the PLC's own display, a screenful at a time, each read when it is shown."""
        names = [name for name in self._configuration.register_map.points if name not in MOVING]
        await self._check_ranges(plc, list(self._configuration.register_map.points))
        for first in range(0, len(names), SCREENFUL):
            readings = await plc.read(names[first : first + SCREENFUL])
            seen = {name: reading for name, reading in readings.items() if reading.value is not None}
            for name, reading in seen.items():
                self._dialogue.tell(f"  {_shown(name, reading)}")
            if not seen or self._dialogue.ask("Does the PLC show the same, all of them?"):
                continue
            for name in seen:
                text = _shown(name, (await plc.read([name]))[name])
                if not self._dialogue.ask(f"{text}. Does the PLC show the same?"):
                    self._wrong.append(f"{text}, but the PLC shows something else")

    async def _check_ranges(self, plc: RegisterPlc, names: list[str]) -> None:
        """Find what cannot be read, or cannot be true; nobody has to be asked for that."""
        for name, reading in (await plc.read(names)).items():
            rule = self._configuration.sensor_rules[name]
            if isinstance(reading.error, OtherUnitError):
                continue  # said of its unit
            if reading.value is None:
                self._wrong.append(f"{name} cannot be read: {reading.error}")
            elif not rule.low <= reading.value <= rule.high:
                text = _shown(name, reading)
                self._wrong.append(f"{text} is outside {rule.low:g} to {rule.high:g}: look at scale and byte order")

    async def _try_setpoints(self, plc: RegisterPlc, writer: GuardedWriter) -> None:
        for name in self._configuration.setpoints:
            rule = self._configuration.guard_rules.points[name]
            before = (await plc.read([name]))[name].value
            if before is None:
                continue
            # In whole steps of the register, so that the person is asked for the very value that it will show.
            step = rule.resolution * math.ceil(max(rule.dead_band, 0.02 * (rule.high - rule.low)) / rule.resolution)
            target = before + step if before + step <= rule.high else before - step
            target = min(max(target, rule.low), rule.high)
            if not self._dialogue.ask(f"May {name} be set from {before:g} to {target:g} for a moment, and back?"):
                self._wrong.append(f"{name} was not tried")
                continue
            if not await self._set(plc, writer, name, target):
                continue
            if not self._dialogue.ask(f"Does the PLC show {name} = {target:g}?"):
                self._wrong.append(f"{name} reads back as written, but the PLC shows something else")
            await self._set(plc, writer, name, before)

    async def _set(self, plc: RegisterPlc, writer: GuardedWriter, name: str, value: float) -> bool:
        """Write through the guard and read again; tell whether the PLC took it."""
        rules = self._configuration.guard_rules.points
        # One point alone and no waiting: the person has just agreed to this very step.
        rule = rules[name]
        free = type(rule)(low=rule.low, high=rule.high, safe=rule.safe, resolution=rule.resolution)
        image = Image(time.monotonic(), None)
        verdict = guard({name: Request(value, "commission")}, {}, {}, image, GuardState(), GuardRules({name: free}))
        outcomes = await writer.carry_out(verdict.writes)
        await asyncio.sleep(self._settle)
        shown = (await plc.read([name]))[name].value
        for outcome in outcomes:
            if outcome.error is not None:
                self._wrong.append(f"{name} cannot be written: {outcome.error}")
                return False
            if shown is None or not rule.same(shown, outcome.write.value):
                self._wrong.append(f"{name}: {outcome.write.value:g} was written, but {shown} is read back")
                return False
        return True

    async def _pull_the_plug(self, plc: RegisterPlc, writer: GuardedWriter) -> None:
        points = self._configuration.register_map.points
        if "heartbeat" not in points:
            self._wrong.append("the map has no heartbeat: the PLC cannot know that the daemon is gone")
            return
        question = (
            f"Now the heartbeat stops for {duration(timedelta(seconds=self._fallback_after))}, so that the PLC falls "
            "back to its own safe setpoints. Go on?"
        )
        if not self._dialogue.ask(question):
            self._wrong.append("the fallback was not tried")
            return
        error = await writer.heartbeat()
        if error is not None:
            self._wrong.append(f"the heartbeat cannot be written: {error}")
            return
        if "plc_fallback" not in points:
            self._dialogue.tell("the map has no plc_fallback: look at the PLC's own display")
            await asyncio.sleep(1.2 * self._fallback_after)
            if not self._dialogue.ask("Is the PLC on its own safe setpoints?"):
                self._wrong.append("the PLC did not fall back when the heartbeat stopped")
            elif others := await self._own_setpoints(plc):
                self._wrong.append(
                    f"without plc_fallback a fallback is known by `safe` alone, and {others} differ from it"
                )
            return
        await self._watch_fallback(plc)
        await writer.heartbeat()
        await asyncio.sleep(self._settle)
        if _is_set((await plc.read(["plc_fallback"]))["plc_fallback"]):
            self._wrong.append("the PLC stays in its fallback although the heartbeat is back")

    async def _watch_fallback(self, plc: RegisterPlc) -> None:
        began = time.monotonic()
        while not _is_set((await plc.read(["plc_fallback"]))["plc_fallback"]):
            if time.monotonic() - began > 1.2 * self._fallback_after + PATIENCE:
                self._wrong.append("the PLC did not fall back when the heartbeat stopped")
                return
            await asyncio.sleep(min(5.0, self._fallback_after / 20.0))
        self._dialogue.tell(f"the PLC fell back after {time.monotonic() - began:.0f} s")
        await self._own_setpoints(plc)

    async def _own_setpoints(self, plc: RegisterPlc) -> str:
        """Show the setpoints that the PLC uses in its fallback; return those that are not the site's safe ones."""
        others = []
        for name, reading in (await plc.read(self._configuration.setpoints)).items():
            rule = self._configuration.guard_rules.points[name]
            told = ""
            if reading.value is not None and not rule.same(reading.value, rule.safe):
                told = f"; `safe` in the site's file is {rule.safe:g}: best the same"
                others.append(name)
            self._dialogue.tell(f"  its own {_shown(name, reading)}{told}")
        return ", ".join(others)


def _shown(name: str, reading: Reading) -> str:
    unit = expected_unit(name)
    value = "nothing" if reading.value is None else f"{reading.value:.6g}"
    return f"{name} = {value}" + ("" if unit == "1" else f" {unit}")


def _is_set(reading: Reading) -> bool:
    return reading.value is not None and reading.value >= 0.5
