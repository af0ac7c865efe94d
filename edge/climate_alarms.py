"""Alarms of the climate itself: too cold, too hot, too damp, and for how long; the thresholds are the site's own."""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from igrow.core.quantities import QUANTITIES, with_unit
from igrow.core.site import Crop
from igrow.core.yaml_schema import SettingError, setting
from igrow.edge.alarm_levels import Level
from igrow.edge.image import Image
from igrow.edge.sensors.consequences import CONSEQUENCES

_DAY = datetime.timedelta(days=1)


@dataclass(frozen=True)
class ClimateAlarm:
    """One threshold of one quantity."""

    name: str = setting(help="short name, such as too_cold")
    quantity: str = setting(help="what it watches")
    above: float | None = setting(default=None, help="comes above this value")
    below: float | None = setting(default=None, help="or comes below this value")
    lasting: datetime.timedelta = setting(
        low=datetime.timedelta(0), high=_DAY, default=datetime.timedelta(minutes=15), help="once it has lasted so long"
    )
    release: float = setting(low=0, default=0.0, help="goes when the value is back by so much, in its unit")
    level: Level = setting(default=Level.WARNING, help="notice, warning or critical")

    def __post_init__(self) -> None:
        if self.quantity not in QUANTITIES:
            raise SettingError(f"quantity is {self.quantity}: a quantity such as air_temperature is needed", "quantity")
        if (self.above is None) == (self.below is None):
            raise SettingError("give either above or below", "above" if self.above is not None else "name")

    def is_beyond(self, value: float, active: bool) -> bool:
        """Tell whether a value is beyond the threshold; while the alarm is `active` it must come back further."""
        margin = self.release if active else 0.0
        if self.above is not None:
            return value > self.above - margin
        assert self.below is not None
        return value < self.below + margin


def usual_climate_alarms(crop: Crop) -> tuple[ClimateAlarm, ...]:
    """Return the alarms that follow from what the site's file says harms the crop."""
    return (
        ClimateAlarm("too_cold", "air_temperature", None, crop.temperature_low, release=0.5, level=Level.CRITICAL),
        ClimateAlarm("too_hot", "air_temperature", crop.temperature_high, None, release=0.5, level=Level.CRITICAL),
        ClimateAlarm(
            "too_damp", "air_humidity", crop.humidity_high, None, datetime.timedelta(hours=3), 1.0, Level.WARNING
        ),
    )


class ClimateAlarms:
    """Watches the thresholds; a value that cannot be believed neither raises nor ends an alarm."""

    def __init__(self, rules: Sequence[ClimateAlarm]) -> None:
        self._rules = rules
        self._since: dict[str, float] = {}
        """By alarm: since when (monotonic seconds) its threshold has been passed."""
        self._active: set[str] = set()

    def tick(self, image: Image, alarm: Callable[[str, str, Level], None]) -> None:
        """Look at one image, and tell `alarm(name, text, level)` of each threshold; an empty text ends an alarm."""
        for rule in self._rules:
            found = image.value_of(rule.quantity)
            if found.value is None or not CONSEQUENCES[found.quality].control:
                continue
            if not rule.is_beyond(found.value, rule.name in self._active):
                self._since.pop(rule.name, None)
                self._active.discard(rule.name)
                alarm(f"climate {rule.name}", "", rule.level)
                continue
            since = self._since.setdefault(rule.name, image.monotonic)
            if image.monotonic - since >= rule.lasting.total_seconds():
                self._active.add(rule.name)
                alarm(f"climate {rule.name}", self._text(rule, found.value), rule.level)

    @staticmethod
    def _text(rule: ClimateAlarm, value: float) -> str:
        limit = rule.above if rule.above is not None else rule.below
        assert limit is not None
        bound, now = with_unit(rule.quantity, limit), with_unit(rule.quantity, value, ".3g")
        side = f"above {bound}" if rule.above is not None else f"below {bound}"
        if rule.lasting:
            side = f"for {rule.lasting.total_seconds() / 60:.0f} min {side}"
        return f"{rule.name.replace('_', ' ')}: {rule.quantity} {side}, now {now}"
