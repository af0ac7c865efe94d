"""Texts whose columns stand at fixed places, with blanks between them, as printers and old loggers write them.

A column is where some line of readings has a letter and all of them have a blank on either side; so that a reading that
is missing leaves its place empty, and moves no other.
"""

from __future__ import annotations

import re

_LEAST_COLUMNS = 3
_MOST_NAMES = 12
"""Lines without readings: names, units, a title, a rule."""
_TOKEN = re.compile(r"\S+")


def stands_at_fixed_places(text: str) -> bool:
    """Tell whether most lines of a text are numbers with blanks between them, and no sign stands between its names."""
    lines = [line for line in text.splitlines() if line.strip()]
    body = _readings(lines)
    names = [line for line in lines if line not in body] if len(lines) - len(body) < _MOST_NAMES else lines
    return len(body) >= 2 and bool(names) and not re.search(r"[;|\t,]", "".join(names)) and ";" not in body[0]


def split(text: str) -> list[tuple[list[str], int]]:
    """Return the cells of each line of a text, with its number from 1."""
    lines = text.expandtabs().splitlines()
    places = _places(_readings([line for line in lines if line.strip()]))
    return [(_cells(line, places), number) for number, line in enumerate(lines, 1)]


def _readings(lines: list[str]) -> list[str]:
    """Return the lines of which most words begin as numbers do."""
    found = []
    for line in lines:
        words = _TOKEN.findall(line)
        numbers = sum(re.match(r"[-+]?[.,]?\d", word) is not None for word in words)
        if len(words) >= _LEAST_COLUMNS and numbers > 0.6 * len(words):
            found.append(line)
    return found


def _places(lines: list[str]) -> list[tuple[int, int]]:
    """Return where each column begins and ends."""
    width = max(map(len, lines), default=0)
    taken = [False] * (width + 1)
    for line in lines:
        for word in _TOKEN.finditer(line):
            taken[word.start() : word.end()] = [True] * len(word[0])
    edges = [place for place in range(width + 1) if taken[place] != (place > 0 and taken[place - 1])]
    return list(zip(edges[::2], edges[1::2], strict=True))


def _cells(line: str, places: list[tuple[int, int]]) -> list[str]:
    """Return the cells of a line; a name that is wider than its column ends where the column ends, or begins there."""
    cells, start = [], 0
    for (_, end), (following, _) in zip(places, [*places[1:], (len(line), 0)], strict=True):
        cut = end if line[end : end + 1].strip() == "" else following
        cells.append(line[start:cut])
        start = cut
    return cells
