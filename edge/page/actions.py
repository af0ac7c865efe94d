"""What a grower who is signed in may do; each the same call as on the command line, and with his name."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from igrow.core.errors import IgrowError
from igrow.edge.configuration import Configuration
from igrow.edge.notifications.acknowledged import ACKNOWLEDGED_FILE, acknowledge
from igrow.edge.overriding import override
from igrow.edge.page import words
from igrow.edge.sources.override import RECIPE

HOURS = (1, 2, 4, 8, 12, 24, 48)
"""For how long something may be taken."""


@dataclass(frozen=True)
class Actions:
    """Does what forms ask for. Raises IgrowError with one line for people."""

    configuration: Configuration
    active_alarms: Sequence[str]
    clock: Callable[[], float] = time.time

    def do(self, form: Mapping[str, str], who: str) -> str:
        """Do one thing; returns one line on what was done."""
        by = f"{who} (page)"
        known = {
            "override": self._override,
            "release": self._release,
            "recipe": self._recipe,
            "plan": self._plan,
            "acknowledge": self._acknowledge,
        }
        wanted = known.get(form.get("do", ""))
        if wanted is None:
            raise IgrowError("the page asked for something that is not known")
        return wanted(form, by)

    def _override(self, form: Mapping[str, str], by: str) -> str:
        name = form.get("setpoint", "")
        seconds = _seconds(form)
        try:
            value = float(form.get("value", "").replace(",", "."))
        except ValueError:
            raise IgrowError(f"{words.title(name[:40])}: no number") from None
        # NaN and infinities lie in no limits, and are refused there.
        override(self.configuration, {name: value / words.scale(name)}, seconds, by=by)
        said = f"{words.title(name)}: {words.shown(name, value / words.scale(name))} by hand"
        return f"{said} for {words.lasting(seconds)}. The PLC shows it after the next cycles."

    def _release(self, form: Mapping[str, str], by: str) -> str:
        name = self._setpoint(form)
        override(self.configuration, {}, 1.0, (name,), by=by)
        return f"{words.title(name)} is given back."

    def _recipe(self, form: Mapping[str, str], by: str) -> str:
        seconds = _seconds(form)
        override(self.configuration, {}, seconds, by=by, recipe=True)
        return f"Your recipe decides for {words.lasting(seconds)}. Plans are made, and wait."

    def _plan(self, form: Mapping[str, str], by: str) -> str:
        override(self.configuration, {}, 1.0, (RECIPE,), by=by)
        return "Plans decide again."

    def _acknowledge(self, form: Mapping[str, str], by: str) -> str:
        name = form.get("alarm", "")
        if name not in self.active_alarms:
            raise IgrowError("that alarm is over already")
        path = self.configuration.state_folder / ACKNOWLEDGED_FILE
        problem = acknowledge(path, [name], by, self.clock(), self.active_alarms)
        if problem:
            raise IgrowError(problem)
        return "Noted: you know of the alarm. It stays here until it is over."

    def _setpoint(self, form: Mapping[str, str]) -> str:
        name = form.get("setpoint", "")
        if name not in self.configuration.setpoints:
            raise IgrowError(f"{name[:40]} is no setpoint of this site")
        return name


def _seconds(form: Mapping[str, str]) -> float:
    text = form.get("hours", "")
    if text not in {str(hours) for hours in HOURS}:
        raise IgrowError(f"for how long? {', '.join(map(str, HOURS))} hours are right")
    return 3600.0 * float(text)
