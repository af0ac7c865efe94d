"""Units whose setpoints lie in the same registers, so that one could be taken for the other. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import permutations

from igrow.edge.registers.codec import NotEncodableError, decode, encode
from igrow.edge.registers.model import Function, Point, RegisterMap


@dataclass(frozen=True, slots=True)
class Counterpart:
    """A setpoint of one unit, and that of the other one which lies in the same register."""

    point: Point
    other: Point

    def would_show(self, value: float) -> float | None:
        """Return what the point would read in registers that hold this value of the other one."""
        try:
            return decode(self.point, encode(self.other, value))
        except NotEncodableError:
            return None


LookAlikes = Mapping[tuple[str, str], tuple[Counterpart, ...]]
"""For one unit and another one: what of the first lies where in the second, all that it has."""


def look_alikes(register_map: RegisterMap, setpoints: Iterable[str]) -> LookAlikes:
    """Return the units of one layout, as far as these setpoints go; each pair stands there both ways."""
    layouts: dict[str, dict[tuple[Function, int, int], Point]] = {}
    for name in setpoints:
        point = register_map.points[name]
        layouts.setdefault(point.device, {})[point.function, point.address, point.type.width] = point
    return {
        (unit, other): tuple(Counterpart(point, layouts[other][place]) for place, point in layouts[unit].items())
        for unit, other in permutations(layouts, 2)
        if layouts[unit].keys() == layouts[other].keys()
    }
