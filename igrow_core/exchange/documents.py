"""JSON from elsewhere, read with mistrust: nothing in such a file may end the program that reads it."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from igrow.core.errors import IgrowError

LARGEST_DOCUMENT = 4 * 2**20
"""Bytes; receipts, seals and reports are a thousand times smaller."""


def parse_object(data: bytes, what: str) -> dict[str, Any]:
    """Return the JSON object in `data`; raises IgrowError that begins with `what` for anything else."""
    if len(data) > LARGEST_DOCUMENT:
        raise IgrowError(f"{what}: {len(data)} bytes long, at most {LARGEST_DOCUMENT} are right")
    try:
        document = json.loads(data, parse_int=_integer)
    except RecursionError:
        raise IgrowError(f"{what}: nested too deeply for anything that igrow writes") from None
    except ValueError as error:
        raise IgrowError(f"{what}: not JSON: {str(error).splitlines()[0]}") from None
    if not isinstance(document, dict):
        raise IgrowError(f"{what}: a {type(document).__name__} where an object with names is needed")
    return document


def read_object(path: Path) -> dict[str, Any]:
    """Return the JSON object in a file; empty where there is no file, or none that can be read."""
    try:
        return parse_object(path.read_bytes(), path.name)
    except (IgrowError, OSError):
        return {}


def _integer(digits: str) -> int:
    """Return an integer that is some number of the world; ValueError for one that no float64 holds."""
    number = int(digits)
    if abs(number) > sys.float_info.max:
        raise ValueError(f"a number of {len(digits)} digits")
    return number


def parse_lines(data: bytes, what: str) -> list[dict[str, Any]]:
    """Return the JSON objects in `data`, one a line; raises IgrowError with the line that is none."""
    return [parse_object(line, f"{what}:{number}") for number, line in enumerate(data.splitlines(), 1) if line.strip()]
