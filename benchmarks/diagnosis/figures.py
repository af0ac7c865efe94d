"""The figures of judged cases: what was told of them, beside what was wanted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.diagnosis.cases import CHANGES
from benchmarks.diagnosis.scoring import Outcome, has_all, is_first
from igrow.trainer.diagnosis.learned.null_gains import NullGains

MATTERS = 1.1
"""Times the error of a model with the true cause that a recalibrated one makes, from which on the cause matters."""
NOTHING = {"nothing": "nothing missing", "noise": "wrong noise", "clean": "a cleaned cover"}
"""Groups of cases in which nothing is missing."""


@dataclass(frozen=True)
class Row:
    """One figure."""

    what: str
    value: float
    """No number where there is no case."""
    cases: int
    bound: str = "-"


def of(outcomes: Sequence[Outcome], *groups: str, size: float | None = None) -> list[Outcome]:
    """Return the outcomes of some groups, and of an ENR."""
    return [one for one in outcomes if one.case.group in groups and (size is None or one.case.size == size)]


def share(what: str, chosen: Sequence[Outcome], right: Callable[[Outcome], bool], bound: str = "-") -> Row:
    """Return the share of outcomes of which something is so."""
    return Row(what, float(np.mean([right(one) for one in chosen])) if chosen else np.nan, len(chosen), bound)


def median(what: str, values: Sequence[float], bound: str = "-") -> Row:
    """Return the median of figures."""
    return Row(what, float(np.median(values)) if values else np.nan, len(values), bound)


def false_claims(outcomes: Sequence[Outcome]) -> list[Row]:
    """Return how often something is told where nothing is missing."""
    return [
        share(f"false claims, {what}", of(outcomes, group), lambda one: one.verdict != "nothing", "<= .02")
        for group, what in NOTHING.items()
    ]


def names(outcomes: Sequence[Outcome]) -> list[Row]:
    """Return how often a lone cause is named."""
    alone = of(outcomes, "single", "onset")
    named = [one for one in alone if one.confounded]
    return [
        *(
            share(f"right cause first, ENR {size:g}", of(outcomes, "single", size=size), is_first, bound)
            for size, bound in ((3.0, "-"), (1.0, ">= .80"), (0.3, ">= .35"))
        ),
        *(
            share(
                f"right first, where recalibration {where}",
                [one for one in alone if (one.recalibrated >= MATTERS * one.perfect) == matters],
                is_first,
            )
            for matters, where in ((True, "errs a tenth more"), (False, "does not"))
        ),
        share("right cause first, where a name was given", named, is_first, ">= .95"),
        share("a pattern in place of a cause", alone, lambda one: one.verdict == "unexplained"),
    ]


def changed_parameters(outcomes: Sequence[Outcome]) -> list[Row]:
    """Return how often the change of a parameter is named."""
    own = of(outcomes, "parameter")
    return [
        *(
            share(f"right: {change} times {factor:g}", [one for one in own if one.case.changed == change], is_first)
            for change, (factor, _) in CHANGES.items()
        ),
        share("a wrong name for a parameter's change", own, lambda one: bool(one.confounded) and not is_first(one)),
    ]


def oracle(outcomes: Sequence[Outcome], bounds: NullGains) -> list[Row]:
    """Return how many lone causes gain what they must, were the model's structure the plant's own.

    Args:
        outcomes: of all cases.
        bounds: what they must gain.
    """
    found = []
    for size in (1.0, 0.3):
        seen = [one for one in of(outcomes, "single", size=size) if one.expected_gain is not None]
        known = [one for one in seen if one.known_gain is not None]
        found += [
            share(
                f"oracle: gain enough at ENR {size:g}, were the structure right",
                seen,
                lambda one: (one.expected_gain or 0.0) >= bounds.least,
            ),
            share("oracle: the same, parameters known", known, lambda one: (one.known_gain or 0.0) >= bounds.least),
            share(
                "oracle: gain enough, by what its effect must gain",
                seen,
                lambda one: (one.expected_gain or 0.0) >= bounds.needed(one.case.causes[0]),
            ),
        ]
    return found


def estimates(outcomes: Sequence[Outcome]) -> list[Row]:
    """Return how well sizes and beginnings are known, what else is told, and what correction brings."""
    sizes = [abs(one.relative_size - 1.0) for one in outcomes if one.relative_size is not None]
    fluxes = [abs(one.relative_flux - 1.0) for one in outcomes if one.relative_flux is not None]
    widths = [one.half_width for one in outcomes if one.half_width is not None]
    covered = [one for one in outcomes if one.covered is not None]
    begun = [one for one in of(outcomes, "onset") if one.onset_error is not None]
    outside, caused = of(outcomes, "outside"), of(outcomes, "single", "onset", "pair")
    possible = sum(max(one.recalibrated - one.perfect, 0.0) for one in caused)
    gained = sum(one.recalibrated - one.corrected for one in caused)
    return [
        share("both of a pair", of(outcomes, "pair"), has_all, ">= .45"),
        median("size, median relative error", sizes, "<= .10"),
        median("what it adds, RMS, median relative error", fluxes),
        share("90 % intervals that cover", covered, lambda one: bool(one.covered), ".85 to .95"),
        median("half of the interval over the size, median", widths),
        share("beginning within 2 days, where found", begun, lambda one: (one.onset_error or 0.0) <= 2.0, ">= .90"),
        share("outside the catalogue: wrong name", outside, lambda one: bool(one.confounded), "<= .05"),
        share("outside the catalogue: silence", outside, lambda one: one.verdict == "nothing", "<= .30"),
        Row("recoverable error recovered", gained / possible if possible else np.nan, len(caused), ">= .85"),
        median("seconds a log, median", [one.seconds for one in outcomes]),
    ]
