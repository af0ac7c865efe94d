"""The grower's override: a setpoint by hand, or the recipe instead of plans, for a lease that ends by itself.

`igrow-edge override` and the page leave a small file; the daemon looks at it in each cycle. A lease counts from when
the daemon first sees it, on the monotonic clock; the daemon then notes in the file when that was, so that a restart
does not begin it again, and a date that jumps does not end it. The file is read and written aside: while its disk
hangs, what was last read from it goes on. Who asked is told to the journal when it takes effect.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from igrow.edge.hand_off import LateError
from igrow.edge.image import Image
from igrow.edge.moment import Moment, from_json, to_json
from igrow.edge.sources.decision import Offer, Source
from igrow.edge.state_file import StateFile, read_state, write_state

RECIPE = "recipe"
"""In the place of a setpoint: the recipe rules, and no plan. No setpoint has this name."""
GIVEN_BACK_BY = "given_back_by"
"""Key of the file: who last gave something back, a plain text and so no lease."""


@dataclass(frozen=True, slots=True)
class Lease:
    """One overridden setpoint, or the wish for the recipe."""

    value: float
    """In the setpoint's unit; of no meaning for the recipe."""
    seconds: float
    """Length of the lease when it was asked for."""
    until: float | None = None
    """Seconds since 1970 UTC at which it ends, once the daemon has seen it with a trusted clock."""
    seen: Moment | None = None
    """When the daemon first saw it."""
    by: str = ""
    """Who asked for it."""
    asked: int | None = None
    """Tells one wish from another that is the same in all else."""

    def is_that_of(self, known: Lease | None) -> bool:
        """Tell whether the daemon knows this lease already, though the file may not say so yet."""
        undated = known is not None and self.seen is None and self.asked is not None
        return self == known or (undated and known is not None and self.asked == known.asked)


def read_leases(path: Path) -> dict[str, Lease]:
    """Return the leases in the file by setpoint; entries that make no sense are left out."""
    return _leases(read_state(path))


def _leases(content: Mapping[str, object]) -> dict[str, Lease]:
    leases: dict[str, Lease] = {}
    for name, entry in content.items():
        if not isinstance(entry, Mapping):
            continue
        value, seconds, until = entry.get("value"), entry.get("seconds"), entry.get("until")
        if not isinstance(value, int | float) or not isinstance(seconds, int | float):
            continue
        if math.isfinite(value) and math.isfinite(seconds):
            end = float(until) if isinstance(until, int | float) else None
            by, asked = str(entry.get("by") or ""), entry.get("asked")
            asked = asked if isinstance(asked, int) else None
            leases[name] = Lease(float(value), float(seconds), end, from_json(entry.get("seen")), by, asked)
    return leases


def write_leases(path: Path, leases: Mapping[str, Lease], given_back_by: str = "") -> str:
    """Replace the file; return an empty text or one line that says why it could not be written."""
    return write_state(path, _plain(leases, given_back_by))


def _plain(leases: Mapping[str, Lease], given_back_by: str = "") -> dict[str, object]:
    entries: dict[str, object] = {
        name: {
            "value": x.value, "seconds": x.seconds, "until": x.until, "seen": x.seen and to_json(x.seen), "by": x.by,
            "asked": x.asked,
        }
        for name, x in leases.items()
    }  # fmt: skip
    return entries | {GIVEN_BACK_BY: given_back_by} if given_back_by else entries


def _nobody(kind: str, **detail: object) -> None:
    """Tell nobody."""


class GrowerOverride:
    """Offers what the grower has overridden and not yet been given back."""

    name = "override"

    def __init__(self, file: StateFile, boot: str = "", tell: Callable[..., None] = _nobody) -> None:
        """Prepare to look.

        Args:
            file: where the leases are left.
            boot: names this start of the machine, while its monotonic clock is the daemon's.
            tell: takes what begins and what is given back: the kind of the event, and its details by name.
        """
        self._file = file
        self._boot = boot
        self._tell = tell
        self._leases: dict[str, Lease] = {}
        self._ends: dict[str, float] = {}

    @property
    def problem(self) -> str:
        """Empty while the file can be read and written, else one line."""
        return self._file.problem

    def offer(self, image: Image) -> Offer:
        """Return the setpoints whose lease runs."""
        self._look(image)
        running = {name: lease for name, lease in self._leases.items() if self._left(name, image) > 0.0}
        running.pop(RECIPE, None)
        if not running:
            return Offer("")
        left = min(self._left(name, image) for name in running)
        why = f"overridden by the grower for {left / 60:.0f} min more"
        return Offer(why, {name: lease.value for name, lease in running.items()})

    def recipe_for(self, image: Image) -> float:
        """Return the seconds for which the grower still wants the recipe, 0 where he does not."""
        return max(0.0, self._left(RECIPE, image)) if RECIPE in self._leases else 0.0

    def _left(self, name: str, image: Image) -> float:
        return self._ends[name] - image.monotonic

    def _look(self, image: Image) -> None:
        """Take over what the file holds when it has changed."""
        with contextlib.suppress(LateError):
            content = self._file.news()
            if content is not None:
                leases = _leases(content)
                self._say(leases, str(content.get(GIVEN_BACK_BY) or ""), image)
                self._take(leases, image)

    def _say(self, leases: Mapping[str, Lease], given_back_by: str, image: Image) -> None:
        """Tell what is new, and what was given back before its time; what a restart finds again is neither."""
        for name, lease in leases.items():
            if lease.seen is None and not lease.is_that_of(self._leases.get(name)):
                by, seconds = lease.by or "unknown", lease.seconds
                if name == RECIPE:
                    self._tell("recipe_wanted", seconds=seconds, by=by)
                else:
                    self._tell("overridden", setpoint=name, value=lease.value, seconds=seconds, by=by)
        for name in self._leases.keys() - leases.keys():
            if self._left(name, image) > 0.0:
                by = given_back_by or "unknown"
                if name == RECIPE:
                    self._tell("plans_wanted", by=by)
                else:
                    self._tell("given_back", setpoint=name, by=by)

    def _take(self, leases: dict[str, Lease], image: Image) -> None:
        now = Moment(self._boot, image.monotonic, image.true_time)
        dated: dict[str, Lease] = {}
        for name, lease in leases.items():
            known = self._leases.get(name)
            if known is not None and lease.is_that_of(known):
                dated[name] = known
                continue
            passed = None if lease.seen is None else now.since(lease.seen)
            left = lease.seconds - (passed or 0.0)
            self._ends[name] = now.monotonic + left
            end = None if now.time is None else now.time + left
            dated[name] = replace(lease, until=end if lease.until is None else lease.until, seen=lease.seen or now)
        self._leases = dated
        if dated != leases:
            self._file.answer(_plain(dated))


class WantedRecipe:
    """Offers the recipe, before any plan, for as long as the grower wants it."""

    name = RECIPE

    def __init__(self, override: GrowerOverride, recipe: Source, otherwise: Source) -> None:
        """`override` knows of the wish; what `recipe` leaves open is what `otherwise` offers, and no plan's."""
        self._override = override
        self._sources: Sequence[Source] = (otherwise, recipe)

    def offer(self, image: Image) -> Offer:
        """Return the recipe's setpoints while they are wanted."""
        left = self._override.recipe_for(image)
        if left <= 0.0:
            return Offer("")
        offers = [source.offer(image) for source in self._sources]
        setpoints = {name: value for offer in offers for name, value in offer.setpoints.items()}
        return Offer(f"{offers[-1].why}, wanted by the grower for {left / 60:.0f} min more", setpoints)
