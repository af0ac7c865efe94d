"""What a grower who is signed in may do; each the same call as on the command line, and with his name."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from igrow.core.errors import IgrowError
from igrow.core.language import N_
from igrow.edge.configuration import Configuration
from igrow.edge.notifications.acknowledged import ACKNOWLEDGED_FILE, acknowledge
from igrow.edge.overriding import override
from igrow.edge.page.words import Words
from igrow.edge.separating_tests import approve, withdraw
from igrow.edge.sources.override import RECIPE

HOURS = (1, 2, 4, 8, 12, 24, 48)
"""For how long something may be taken."""


@dataclass(frozen=True)
class Actions:
    """Does what forms ask for. Raises IgrowError with one line for people."""

    configuration: Configuration
    active_alarms: Sequence[str]
    say: Words
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
            "approve": self._approve,
            "withdraw": self._withdraw,
        }
        wanted = known.get(form.get("do", ""))
        if wanted is None:
            raise IgrowError(self.say.text("the page asked for something that is not known"))
        return wanted(form, by)

    def _override(self, form: Mapping[str, str], by: str) -> str:
        name = form.get("setpoint", "")
        seconds = self._seconds(form)
        try:
            value = float(form.get("value", "").replace(",", "."))
        except ValueError:
            raise IgrowError(self.say.text("{setpoint}: no number", setpoint=self.say.title(name[:40]))) from None
        # Rounded, as a limit that was shown and typed in must come back as the limit. NaN and infinities lie in none.
        wanted = round(self.say.how(name).back(value), 6)
        override(self.configuration, {name: wanted}, seconds, by=by)
        said = N_("{setpoint}: {value} by hand for {time}. The PLC shows it after the next cycles.")
        title, shown = self.say.title(name), self.say.shown(name, wanted)
        return self.say.text(said, setpoint=title, value=shown, time=self.say.lasting(seconds))

    def _release(self, form: Mapping[str, str], by: str) -> str:
        name = self._setpoint(form)
        override(self.configuration, {}, 1.0, (name,), by=by)
        return self.say.text("{setpoint} is given back.", setpoint=self.say.title(name))

    def _recipe(self, form: Mapping[str, str], by: str) -> str:
        seconds = self._seconds(form)
        override(self.configuration, {}, seconds, by=by, recipe=True)
        said = N_("Your recipe decides for {time}. Plans are made, and wait.")
        return self.say.text(said, time=self.say.lasting(seconds))

    def _plan(self, form: Mapping[str, str], by: str) -> str:
        override(self.configuration, {}, 1.0, (RECIPE,), by=by)
        return self.say.text("Plans decide again.")

    def _acknowledge(self, form: Mapping[str, str], by: str) -> str:
        name = form.get("alarm", "")
        if name not in self.active_alarms:
            raise IgrowError(self.say.text("that alarm is over already"))
        path = self.configuration.state_folder / ACKNOWLEDGED_FILE
        problem = acknowledge(path, [name], by, self.clock(), self.active_alarms)
        if problem:
            raise IgrowError(problem)
        return self.say.text("Noted: you know of the alarm. It stays here until it is over.")

    def _approve(self, form: Mapping[str, str], by: str) -> str:
        approval = approve(self.configuration, form.get("test", ""), by=by)
        said = N_("{test}: approved for one run within {time}. It begins by itself when its weather comes.")
        return self.say.text(said, test=self.say.title(approval.test), time=self.say.lasting(approval.seconds))

    def _withdraw(self, form: Mapping[str, str], by: str) -> str:
        approval = withdraw(self.configuration, by=by)
        if approval is None:
            raise IgrowError(self.say.text("no test is approved any more"))
        return self.say.text("{test}: withdrawn.", test=self.say.title(approval.test))

    def _setpoint(self, form: Mapping[str, str]) -> str:
        name = form.get("setpoint", "")
        if name not in self.configuration.setpoints:
            raise IgrowError(self.say.text("{name} is no setpoint of this site", name=name[:40]))
        return name

    def _seconds(self, form: Mapping[str, str]) -> float:
        text = form.get("hours", "")
        if text not in {str(hours) for hours in HOURS}:
            raise IgrowError(self.say.text("for how long? {hours} hours are right", hours=", ".join(map(str, HOURS))))
        return 3600.0 * float(text)
