"""Which units answer: judged from the readings of each unit by itself, as one may be off while another is well."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol

from igrow.edge.bus.errors import (
    AddressRefusedError,
    GatewayRefusedError,
    NoValueError,
    OtherUnitError,
    QueueFullError,
    RefusedError,
    UnknownPointError,
)
from igrow.edge.image import Senseless

QUESTION = "does another device answer under its number or address?"


class RawReading(Protocol):
    """What the bus gives for one point: a value or an error, and when, on any clock."""

    @property
    def value(self) -> float | None: ...  # noqa: D102

    @property
    def error(self) -> Exception | None: ...  # noqa: D102

    @property
    def at(self) -> float: ...  # noqa: D102


class Contact:
    """Remembers of each unit whether it answered when it was last asked."""

    def __init__(self, names: Iterable[str], units: Mapping[str, str]) -> None:
        """`units` maps points to units; the points without one are one unit's."""
        self._points: dict[str, frozenset[str]] = {}
        for name in names:
            unit = units.get(name, "")
            self._points[unit] = self._points.get(unit, frozenset()) | {name}
        self._silent: set[str] = set()
        self._interrupted: set[str] = set()
        self._others: dict[str, str] = {}
        self.link_ok = True
        """A unit answers, or nobody was asked."""

    @property
    def silent(self) -> Mapping[str, frozenset[str]]:
        """The units that do not answer, each with its points."""
        return {unit: self._points[unit] for unit in sorted(self._silent)}

    @property
    def interrupted(self) -> Mapping[str, frozenset[str]]:
        """The units that did not answer each request of the last ones, each with its points."""
        return {unit: self._points[unit] for unit in sorted(self._interrupted)}

    @property
    def others(self) -> Mapping[str, Senseless]:
        """The units in whose place another one answers."""
        return {unit: Senseless(self._points[unit], what, QUESTION) for unit, what in self._others.items()}

    def hear(self, readings: Mapping[str, RawReading]) -> None:
        """Take note of who answered."""
        self._interrupted = set(self._silent)
        for unit, points in self._points.items():
            heard = {_answered(readings[name]) for name in points if name in readings}
            others = [str(readings[n].error) for n in points if n in readings and _is_other(readings[n])]
            if others:
                self._others[unit] = others[0]
                self._interrupted.add(unit)
            elif True in heard:
                self._others.pop(unit, None)
            if False in heard:
                self._interrupted.add(unit)
            if True in heard:
                self._silent.discard(unit)
            elif False in heard:
                self._silent.add(unit)
        self.link_ok = not readings or len(self._silent) < len(self._points)


def _is_other(reading: RawReading) -> bool:
    return isinstance(reading.error, OtherUnitError)


def _answered(reading: RawReading) -> bool | None:
    """Tell whether a reading shows that its unit is there; None where it says nothing about that."""
    error = reading.error
    if error is None:
        return reading.value is not None
    if isinstance(error, AddressRefusedError | UnknownPointError | QueueFullError | OtherUnitError):
        return None  # an address that was refused once is not asked for again for a while
    if isinstance(error, NoValueError):
        return True
    return isinstance(error, RefusedError) and not isinstance(error, GatewayRefusedError)
