"""The halves of the day, AM and PM, as languages have them: before the hour or behind it."""

from __future__ import annotations

import re
from functools import cache

from igrow.trainer.data.vocabulary import halves_of_day


def with_english_halves(text: str) -> str:
    """Return a time with ``am`` or ``pm`` behind the hour: ``下午 1:30``, ``1:30 nachm.`` and ``1:30 p. m.`` alike."""

    def english(found: re.Match[str]) -> str:
        word = found["before"] or found["behind"]
        if word is None:
            return found[0]
        # A clock that counts from 0 to 11 has no 12.
        hour = re.sub(r"^0?0(?=\D)", "12", found["clock"])
        return f"{hour}{' ' if found['before'] else found['blank']}{_half(word)}"

    return text if text.isascii() and not any(map(str.isalpha, text)) else _clock().sub(english, text)


def is_half(text: str) -> bool:
    """Tell whether a text is a word for a half of the day, and nothing else."""
    return re.fullmatch("|".join(map(_pattern, halves_of_day())), text, re.IGNORECASE) is not None


@cache
def _half(word: str) -> str:
    """Return ``am`` or ``pm`` for one of the words that `_clock` finds, as it is written."""
    spellings = halves_of_day().items()
    return next(half for spelling, half in spellings if re.fullmatch(_pattern(spelling), word, re.IGNORECASE))


@cache
def _clock() -> re.Pattern[str]:
    words = "|".join(map(_pattern, sorted(halves_of_day(), key=len, reverse=True)))
    return re.compile(
        rf"(?:(?<![^\W\d_])(?P<before>{words})\s*)?(?<!\d)(?P<clock>\d{{1,2}}(?:[:.h]\d{{2}}){{1,2}})"
        rf"(?:(?P<blank>\s*)(?P<behind>{words})(?!\w))?",
        re.IGNORECASE,
    )


def _pattern(word: str) -> str:
    """Return what matches a word with or without its full stops and blanks."""
    return re.escape(word).replace(r"\.", r"\.?").replace(r"\ ", r"\s?")
