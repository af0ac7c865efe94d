"""Numbers as exports write them: decimal commas, thousands, units behind them."""

from __future__ import annotations

import re

_PLAIN = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)")
_POWER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)[eE][-+]?\d+")
_WITH_UNIT = re.compile(r"([-+]?[\d.,'\u00a0\u202f ]*\d[.,]?)\s*([^\d\s#][^\d#]*(?:m[23²³])?[^\d#]*)?")
"""No unit has a #: 1.#QNAN is what some programs write of no number."""
_MINUS_BEHIND = re.compile(r"([\d.,'\u00a0\u202f ]*\d)\s?-")


def number(text: str, decimal: str) -> float | None:
    """Return the number of a text, which a unit may follow, or None where it is none.

    Args:
        text: such as ``1.234,5``, ``21.5 °C``, ``8e-06`` or ``4,5-``, where the minus stands behind.
        decimal: the sign before its decimals, ``.`` or ``,``; the other one and blanks are between thousands.
    """
    # Most are plain, and there are many.
    if decimal == "." and _PLAIN.fullmatch(text):
        return float(text)
    text = text.replace("\u2212", "-")
    behind = _MINUS_BEHIND.fullmatch(text)
    if behind is not None:
        text = f"-{behind[1]}"
    if _POWER.fullmatch(text):
        return float(text.replace(",", "."))
    found = _WITH_UNIT.fullmatch(text)
    if found is None:
        return float(text) if _PLAIN.fullmatch(text) else None
    digits = re.sub(r"['\u00a0\u202f ]", "", found[1])
    group = "." if decimal == "," else ","
    if decimal in digits or re.fullmatch(rf"[-+]?\d{{1,3}}(\{group}\d{{3}})+", digits):
        digits = digits.replace(group, "")
    digits = digits.replace(",", ".")
    return float(digits) if _PLAIN.fullmatch(digits) else None


def unit_behind(text: str) -> str:
    """Return what stands behind the number of a text, such as ``°C``; empty where nothing does."""
    text = text.replace("\u2212", "-")
    found = None if _POWER.fullmatch(text) or _MINUS_BEHIND.fullmatch(text) else _WITH_UNIT.fullmatch(text)
    return (found[2] or "").strip() if found is not None else ""
