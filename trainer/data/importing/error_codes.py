"""Numbers that stand for a fault: 9999, -999, 65535. No sensor jumps that far and back, to the very same value."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from igrow.trainer.data.importing.columns import WEATHER
from igrow.trainer.data.mapping import MISSING
from igrow.trainer.data.number_texts import number

MEASURED = frozenset({*WEATHER, "air_temperature", "air_humidity", "air_co2", "par"} - {"rain"})
"""Quantities that change by small steps; a vent or a pipe may jump."""
_LEAST_TIMES, _LEAST_OTHERS = 3, 20
"""How often a code stands there at least, and how many different readings beside it."""
_AWAY = 1.5
"""Spans of all other readings that a code lies away from the next of them."""


def error_codes(cells: Sequence[str], decimal: str) -> tuple[str, ...]:
    """Return the texts of a measured column that are numbers for a fault.

    Args:
        cells: as they are written, (n,).
        decimal: sign before decimals.
    """
    count = Counter(text for text in cells if text not in MISSING)
    values = {text: value for text in count if (value := number(text, decimal)) is not None}
    ranked = sorted(values, key=lambda text: values[text])
    codes: list[str] = []
    while len(ranked) > _LEAST_OTHERS:
        low, high = ranked[0], ranked[-1]
        above = values[high] - values[ranked[-2]]
        below = values[ranked[1]] - values[low]
        code, gap, rest = (high, above, ranked[:-1]) if above > below else (low, below, ranked[1:])
        if count[code] < _LEAST_TIMES or gap <= _AWAY * (values[rest[-1]] - values[rest[0]]):
            break
        codes.append(code)
        ranked = rest
    return tuple(codes)
