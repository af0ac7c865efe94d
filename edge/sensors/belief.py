"""When a sensor's bad readings are believed: not the first one, and good ones after them not at once either.

A single bad reading moves nothing: it is marked as in doubt, the last good value still guards, and the guard leaves
alone what hangs on it. `SensorRule.bad_samples` bad readings in a row make the sensor bad, with all that
follows; as many good ones in a row make it good again. What time alone shows (stale, frozen, missing for minutes) is
believed at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from igrow.edge.image import Quality, Value
from igrow.edge.sensors.rules import SensorRule


@dataclass(slots=True)
class Belief:
    """What was seen of one sensor lately."""

    bad: int = 0
    good: int = 0
    """Readings in a row."""
    distrusted: Quality | None = None
    """How the sensor is bad, while it is."""
    last: float | None = None
    """The last value that was believed, and when it was read."""
    last_at: float = -math.inf

    def weigh(self, judged: Value, rule: SensorRule, now: float, *, news: bool, tried: bool) -> Value:
        """Return what is to be believed of a value that was judged by itself.

        `news`: the sensor has answered since the last time; `tried`: it was at least asked.
        """
        if judged.quality is Quality.GOOD:
            return self._good(judged, rule, now, news=news)
        if math.isinf(judged.age):
            self.bad += tried
            return judged if self.bad >= rule.bad_samples else replace(judged, in_doubt=True)
        if not _shown_by_a_reading(judged, rule):
            return judged
        return self._bad(judged, rule, now, news=news)

    def _good(self, judged: Value, rule: SensorRule, now: float, *, news: bool) -> Value:
        if news:
            self.bad, self.good = 0, self.good + 1
        if self.distrusted is not None and self.good < rule.bad_samples:
            why = f"good again, in {self.good} of {rule.bad_samples} readings"
            return Value(judged.value, self.distrusted, judged.age, why)
        self.distrusted = None
        self.last, self.last_at = judged.value, now - judged.age
        return judged

    def _bad(self, judged: Value, rule: SensorRule, now: float, *, news: bool) -> Value:
        if news:
            self.bad, self.good = self.bad + 1, 0
        age = now - self.last_at
        known = self.last is None or age <= rule.missing_after
        if self.distrusted is not None or self.bad >= rule.bad_samples or not known:
            self.distrusted = judged.quality
            return judged
        why = f"{judged.why}, in {self.bad} of {rule.bad_samples} readings"
        return replace(judged, why=why, in_doubt=True, believed=self.last)


def _shown_by_a_reading(judged: Value, rule: SensorRule) -> bool:
    """Tell whether a reading itself is bad, and not only old or unchanged."""
    if judged.quality is Quality.MISSING:
        return judged.age <= rule.missing_after
    return judged.quality in (Quality.OUT_OF_RANGE, Quality.IMPLAUSIBLE)
