"""Units that a segment may have been written in, and how they become those of the registry."""

from __future__ import annotations

from igrow.core.quantities import QUANTITIES

_TO: dict[tuple[str, str], tuple[float, float]] = {
    ("degF", "degC"): (5.0 / 9.0, -160.0 / 9.0),
    ("K", "degC"): (1.0, -273.15),
    ("1", "%"): (100.0, 0.0),
    ("%", "1"): (0.01, 0.0),
    ("km h-1", "m s-1"): (1.0 / 3.6, 0.0),
    ("kW m-2", "W m-2"): (1000.0, 0.0),
    ("g m-2 h-1", "kg m-2 h-1"): (0.001, 0.0),
    ("kg m-2 h-1", "L m-2 h-1"): (1.0, 0.0),
    ("mm h-1", "L m-2 h-1"): (1.0, 0.0),
}
"""(written, wanted) -> factor and offset: wanted = factor * written + offset."""


def conversion(name: str, unit: str) -> tuple[float, float] | None:
    """Return factor and offset from `unit` to the registry's unit of quantity `name`.

    None where the registry lacks the quantity or nothing leads from one unit to the other: the values are then kept
    apart under their own name and unit, never guessed.
    """
    quantity = QUANTITIES.get(name)
    if quantity is None:
        return None
    return (1.0, 0.0) if unit == quantity.unit else _TO.get((unit, quantity.unit))
