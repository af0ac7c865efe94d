"""Which column is the time, and how it is written."""

from __future__ import annotations

import datetime
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from igrow.trainer.data import vocabulary
from igrow.trainer.data.day_halves import with_english_halves
from igrow.trainer.data.timestamps import (
    EXCEL,
    ISO,
    UNIX,
    ZONE,
    dates_alone,
    parser,
    wall_parser,
    with_english_months,
    without_weekday,
)
from igrow.trainer.data.zone_abbreviations import split

_SAMPLE = 1500
_LEAST_READ = 0.98
"""Share of a column's texts that a form must read."""
_LEAST_DATED = 0.8
"""Share of a column's texts that have a digit, if it is a time."""
_CLOCK = re.compile(r"\d{1,2}[:.h]\d{2}([:.]\d{2})?([.,]\d+)?(\s?[ap]m)?(\s?(uhr|hrs?|hs?|u))?", re.IGNORECASE)
_DATE = re.compile(
    r"(\d{1,4}[-/.年]\s?\d{1,2}[-/.月]\s?\d{1,4}日?|\d{8}|(?:19|20)\d\d-[0-3]\d\d|\d{1,2}[-\s.]+[^\W\d_]{3,}\.?[-\s]+\d{2,4}|"
    r"[^\W\d_]{3,}\.?\s+\d{1,2},?\s+\d{4})(\D.*)?"
)
_DAY_AND_PART = re.compile(r"[3-7]\d{4} ([01]|0?[.,]\d+)")
"""Excel's day and its part, from two columns."""
_COMPACT = re.compile(r"(19|20)\d\d(0[1-9]|1[0-2])(0[1-9]|[12]\d|3[01])([01]\d|2[0-4])[0-5]\d([0-5]\d)?")
"""Year to minute or second without a sign between them."""
_TOKEN = re.compile(r"\d+|[^\W\d_]+|[^\w]+|_")


@dataclass(frozen=True)
class TimeForm:
    """How times are written."""

    column: str
    time_of_day: str | None
    form: str
    alternatives: tuple[str, ...] = ()
    """Other forms that read all texts as well, and make no worse times of them."""


def looks_like_time(text: str) -> bool:
    """Tell whether a cell may be a date, or a date and a time."""
    text = with_english_months(without_weekday(text.strip()))
    if _COMPACT.fullmatch(text) or (_DATE.fullmatch(text) and not re.fullmatch(r"\d{8}", text)):
        return True
    if re.fullmatch(r"\d{8}", text) and not 1900 <= int(text[:4]) <= 2100:
        return False
    try:
        moment = datetime.datetime.fromisoformat(text)
    except ValueError:
        number = re.fullmatch(r"\d+([.,]\d+)?", text)
        return number is not None and _serial(float(text.replace(",", "."))) is not None
    return 1990 <= moment.year <= 2100


def is_clock(text: str) -> bool:
    """Tell whether a cell is a time of day."""
    return _CLOCK.fullmatch(with_english_halves(text)) is not None


def has_clock(text: str) -> bool:
    """Tell whether a cell has a time of day in it."""
    return re.search(r"(?<!\d)\d{1,2}:\d{2}(?!\d)", text) is not None


def find_time(columns: dict[str, Sequence[str]]) -> TimeForm | None:
    """Return the time of a table's columns (name -> texts), or None where no column is one."""
    found: list[tuple[float, TimeForm]] = []
    names = list(columns)
    for position, name in enumerate(names):
        texts = _sample(columns[name])
        if len(texts) < 2 or not looks_like_time(texts[0]):
            continue
        forms = _forms(texts)
        if not forms:
            continue
        likely = 1.0 + vocabulary.is_time(name, "date_and_time") - 0.02 * position
        if all(_midnight(texts, form) for form in forms):
            clock = _clock_column(columns, names, name)
            if clock is not None:
                joined = [
                    f"{day} {hour}" for day, hour in zip(columns[name], columns[clock], strict=True) if day and hour
                ]
                both = _forms(_sample(joined))
                if both:
                    likely += 0.5 + vocabulary.is_time(name, "date")
                    found.append((likely, _best(name, clock, both, _sample(joined))))
                    continue
        found.append((likely, _best(name, None, forms, texts)))
    return max(found, key=lambda one: one[0])[1] if found else None


def _sample(texts: Sequence[str]) -> list[str]:
    """Return texts from the beginning, in their order (so that midnight is passed), and some from all along."""
    alone = dates_alone(texts)
    filled = [text for row, text in enumerate(texts) if text and row not in alone and not vocabulary.is_total(text)]
    # The header once more, or a line of sums.
    dated = [text for text in filled if any(map(str.isdigit, text))]
    kept = dated if len(dated) >= _LEAST_DATED * len(filled) else filled
    return kept if len(kept) <= 2 * _SAMPLE else kept[:_SAMPLE] + kept[_SAMPLE :: max(1, len(kept) // _SAMPLE)]


def _clock_column(columns: dict[str, Sequence[str]], names: Sequence[str], date: str) -> str | None:
    """Return the column of the time of day that goes with a column of dates."""
    clocks = [
        name
        for name in names
        if name != date
        and (texts := _sample(columns[name]))
        and (all(map(is_clock, texts[:50])) or _is_hour(name, texts) or _is_part_of_day(texts))
    ]
    return min(
        clocks,
        key=lambda name: (not vocabulary.is_time(name, "time_of_day"), abs(names.index(name) - names.index(date))),
        default=None,
    )


def _is_hour(name: str, texts: Sequence[str]) -> bool:
    """Tell whether a column counts the hours of the day, from 0 or from 1."""
    whole = all(re.fullmatch(r"\d{1,2}", text) and int(text) <= 24 for text in texts[:50])
    return whole and len(set(texts)) in (23, 24, 25) and vocabulary.is_time(name, "time_of_day")


def _is_part_of_day(texts: Sequence[str]) -> bool:
    """Tell whether a column goes from 0 to 1 day after day, in even steps, as a spreadsheet keeps times of day."""
    if not all(re.fullmatch(r"[01]|0?[.,]\d+", text) for text in texts):
        return False
    parts = np.array([float(text.replace(",", ".")) for text in texts])
    forwards = np.diff(parts)[np.diff(parts) > 0.0]
    return len(forwards) > 2 and bool(np.ptp(forwards) < 1e-3) and float(np.ptp(parts)) > 0.5


def _forms(texts: Sequence[str]) -> list[str]:
    """Return the forms that read (nearly) all texts."""
    if all(_DAY_AND_PART.fullmatch(text) for text in texts[:50]):
        return [EXCEL]
    if split(texts[0])[1]:
        return [f"{form} {ZONE}" for form in _forms([split(text)[0] for text in texts])]
    if all(_COMPACT.fullmatch(text) for text in texts[:50]):
        forms = ["%Y%m%d%H%M" if len(texts[0]) == 12 else "%Y%m%d%H%M%S"]
        return [form for form in forms if _reads(texts, form)]
    if all(re.fullmatch(r"\d+([.,]\d+)?", text) for text in texts[:50]) and not all(
        len(text) == 8 for text in texts[:50]
    ):
        kinds = {_serial(float(text.replace(",", "."))) for text in texts[:50]}
        form = kinds.pop() if len(kinds) == 1 else None
        return [form] if form is not None else []
    return [form for form in dict.fromkeys((ISO, *_written_forms(texts))) if _reads(texts, form)]


def _serial(number: float) -> str | None:
    """Return what kind of count a number is: days since 1899, or seconds and parts of them since 1970."""
    if 32_000.0 < number < 74_000.0:
        return EXCEL
    return next((form for form, unit in UNIX.items() if 6e8 < number * unit < 4.2e9), None)


def _reads(texts: Sequence[str], form: str) -> bool:
    read, wrong = parser(form), 0
    allowed = (1.0 - _LEAST_READ) * len(texts)
    for text in texts:
        try:
            moment = read(text)
            wrong += not 1980 <= moment.year <= 2110
        except (ValueError, OverflowError):
            wrong += 1
        if wrong > allowed:
            return False
    return True


def _written_forms(texts: Sequence[str]) -> list[str]:
    """Return the strptime forms that the first text may have, by the order of day, month and year."""
    tokens = _TOKEN.findall(with_english_halves(with_english_months(without_weekday(texts[0]))))
    numbers = [position for position, token in enumerate(tokens) if token.isdigit()]
    months = [p for p, token in enumerate(tokens) if vocabulary.folded(token) in vocabulary.month_names()]
    if numbers and len(tokens[numbers[0]]) == 8:
        return _clock_after(tokens, numbers[0] + 1, "%Y%m%d")
    if re.match(r"(19|20)\d\d-\d{3}(?!\d)", texts[0]):
        return _clock_after(tokens, 3, "%Y-%j")
    date = sorted([*numbers, *months[:1]])[:3]
    if len(date) < 3:
        return []
    if months:
        orders = [("%d", "%b", "Y"), ("%b", "%d", "Y"), ("Y", "%b", "%d")]
    else:
        orders = [("%d", "%m", "Y"), ("%m", "%d", "Y"), ("Y", "%m", "%d"), ("Y", "%d", "%m")]
    forms: list[str] = []
    for order in orders:
        parts = list(tokens[: date[2] + 1])
        fits = True
        for position, sign in zip(date, order, strict=True):
            long = tokens[position].isdigit() and len(tokens[position]) == 4
            fits &= (sign == "Y" or not long) and ((sign == "%b") == (position in months))
            parts[position] = ("%Y" if long else "%y") if sign == "Y" else sign
        forms += _clock_after(tokens, date[2] + 1, "".join(parts)) if fits else []
    return forms


def _clock_after(tokens: Sequence[str], start: int, form: str) -> list[str]:
    """Return a form with the time of day that follows the date; none for what is no time of day."""
    signs = iter(("%H", "%M", "%S", "%f"))
    half = any(re.fullmatch(r"[ap]m", token, re.IGNORECASE) for token in tokens[start:])
    compact = [token for token in tokens[start:] if token.isdigit()]
    if len(compact) == 1 and len(compact[0]) in (4, 6):
        signs = iter(("%H%M" if len(compact[0]) == 4 else "%H%M%S",))
    for token in tokens[start:]:
        if token.isdigit():
            sign = next(signs, None)
            if sign is None:
                return []
            form += "%I" if half and sign == "%H" else sign
        else:
            form += "%p" if re.fullmatch(r"[ap]m", token, re.IGNORECASE) else token
    return [form]


def _midnight(texts: Sequence[str], form: str) -> bool:
    """Tell whether all texts are dates without a time of day."""
    read = wall_parser(form)
    try:
        return all(read(text).time() == datetime.time() for text in texts[:200])
    except ValueError:
        return False


def _best(column: str, clock: str | None, forms: Sequence[str], texts: Sequence[str]) -> TimeForm:
    """Return the form under which the rows follow each other most evenly."""
    evenness = {form: _evenness(texts, form) for form in forms}
    best = max(evenness.values())
    # Nobody writes a year before the day: what is ISO 8601 is meant so, even where another form is a little more even.
    ranked = sorted(
        forms, key=lambda form: (not (form.startswith(ISO) and evenness[form] >= best - 0.01), -evenness[form])
    )
    rivals = tuple(form for form in ranked[1:] if evenness[form] > evenness[ranked[0]] - 0.01)
    return TimeForm(column, clock, ranked[0], rivals if not ranked[0].startswith(ISO) else ())


def _evenness(texts: Sequence[str], form: str) -> float:
    """Return the share of steps between rows that are the usual one."""
    read = wall_parser(form)
    seconds = []
    for text in texts[:_SAMPLE]:
        try:
            moment = read(text)
        except (ValueError, OverflowError):
            continue
        zone = moment.tzinfo or datetime.UTC
        seconds.append(moment.replace(tzinfo=zone).timestamp())
    steps = np.array([abs(later - earlier) for earlier, later in pairwise(seconds)])
    if len(steps) == 0:
        return 0.0
    usual = float(np.median(steps))
    return float(np.mean(np.abs(steps - usual) <= 0.5 * max(usual, 1.0)))
