"""Lines that were made of a known text and values, told in another language.

What the daemon says stands in its ledger and its state as plain English: programs read it, and a ledger of years ago
can still be read. Its texts are messages of the catalogues as all others are, with numbered places ("no reading for {0}
s"): `make translations` finds them in the code, and lists them in `sentences.json`. A line is told by the text that it
was made of, and so are its values, which may be such lines again.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources

PLACE = re.compile(r"\{\d+\}")
_PARTS = re.compile(r"(; | \(|\))")
_JOINTS = re.compile(r"(: |, | and | -> )")
"""Between lines that were put together; the first part more than a text of few letters holds, such as "{0} is {1}"."""
_SURE = 7
"""Letters of a text that is hardly found by chance."""
_DEPTH = 8
"""Values within values, at most."""


@dataclass(frozen=True)
class Sentence:
    """One text with its places."""

    message: str
    pattern: re.Pattern[str]
    certainty: int
    """Letters that a line must have to be made of it."""


def told(line: str, text: Callable[[str], str], value: Callable[[str], str], depth: int = _DEPTH) -> str:
    """Return a line in another language.

    Args:
        line: in English.
        text: from a message of the catalogues to the language's.
        value: what becomes of a part that is no message: a name, a number, a time, or words from elsewhere.
        depth: values within values, at most.
    """
    if not line:
        return ""
    if (whole := text(line)) != line:
        return whole
    if depth == 0 or not any(letter.isalpha() for letter in line):
        return value(line)
    for joints, candidates in zip((_PARTS, _JOINTS), (sentences()[0], sentences()[1]), strict=True):
        for one in candidates:
            if (found := one.pattern.fullmatch(line)) is not None:
                return _filled(text(one.message), [told(part, text, value, depth - 1) for part in found.groups()])
        parts = joints.split(line)
        if len(parts) > 1:
            return "".join(part if joints.fullmatch(part) else told(part, text, value, depth - 1) for part in parts)
    return value(line)


def _filled(text: str, parts: Sequence[str]) -> str:
    # Not `str.format`: a text may hold braces of its own, as YAML has them.
    return PLACE.sub(lambda place: parts[int(place[0][1:-1])], text)


@cache
def sentences() -> tuple[Sequence[Sentence], Sequence[Sentence]]:
    """Return the texts with places that leave little to chance, and the others; within each the surest first."""
    listed = json.loads(resources.files(__package__).joinpath("sentences.json").read_text(encoding="utf-8"))
    found = []
    for message in listed:
        literal = PLACE.split(message)
        pattern = re.compile("(.*?)".join(map(re.escape, literal)), re.DOTALL)
        found.append(Sentence(message, pattern, sum(letter.isalpha() for part in literal for letter in part)))
    found.sort(key=lambda one: (-one.certainty, -len(one.message)))
    sure = [one for one in found if one.certainty >= _SURE]
    return sure, found[len(sure) :]
