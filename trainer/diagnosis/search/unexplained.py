"""What no cause of the catalogue explains, told by days that no fit has seen.

A pattern says at which hours, on which days or in which weather something acts, and in what: heat, vapour, CO2, air,
light, or water that evaporates. Asked of steps alone it must gain much, since greenhouses drift with the weather. What
such drift takes off the error of unseen days is known (`null_gains`), and what takes off more is there, if it gains
more than in the calibration's own weeks, and free runs bear it out (`correction.with_unexplained`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from igrow.core.arrays import Floats
from igrow.trainer.diagnosis.design import candidates, linear
from igrow.trainer.diagnosis.design.candidates import Pattern
from igrow.trainer.diagnosis.design.design import Design
from igrow.trainer.diagnosis.design.linear import Term
from igrow.trainer.diagnosis.learned.null_gains import read_null_pattern_skills
from igrow.trainer.diagnosis.search import scan
from igrow.trainer.diagnosis.search.change import net_gain
from igrow.trainer.diagnosis.search.cross_validation import CrossValidated, cross_validated
from igrow.trainer.diagnosis.search.scan import Hypothesis
from igrow.trainer.fit.gaussian import Gaussian


@dataclass(frozen=True)
class Unexplained:
    """Patterns of a log, each with what it takes off unseen days."""

    design: Design
    """Of the log, with a column for each."""
    found: tuple[CrossValidated, ...]


def judged(design: Design, longitude: float, by_physics: Gaussian) -> Unexplained:
    """Return every pattern, those of single weekdays and of evaporation too, with its skill.

    Args:
        design: of the log, with its greenhouse's history.
        longitude: degrees east.
        by_physics: where the parameters may lie if they have changed as physics alone lets expect.
    """
    finer, courses = candidates.finer_columns(design.line, longitude)
    columns = design.balances(courses)
    laid_out = replace(design, values=np.concatenate([design.values, columns]))
    places = [*design.block("pattern").columns, *range(len(design.values), len(laid_out.values))]
    every = zip((*design.patterns, *finer), places, strict=True)
    hypotheses = [Hypothesis(one, Term(place), 0.0, 0.0, 0.0, 1.0) for one, place in every]
    return Unexplained(laid_out, tuple(cross_validated(laid_out, by_physics, hypotheses)))


def find(design: Design, longitude: float, by_physics: Gaussian, rng: np.random.Generator) -> tuple[Hypothesis, ...]:
    """Return of each kind the pattern that takes most off unseen days, more than where nothing has changed.

    What gained as much in weeks of the calibration log is how this greenhouse always is, and no news.

    Args:
        design: of the log, with its greenhouse's history.
        longitude: degrees east.
        by_physics: where the parameters may lie if they have changed as physics alone lets expect.
        rng: for the draws of days.
    """
    asked = judged(design, longitude, by_physics)
    known = read_null_pattern_skills()
    told = dict[str, Hypothesis]()
    for one in sorted(asked.found, key=lambda one: -one.skill):
        kind = _pattern(one).kind
        if kind in told or one.skill < known.needed(kind, design.rules.days_over_null):
            continue
        column = scan.column_of(asked.design, one.hypothesis.term)
        sized = _sized(design, one.hypothesis, column, one.p_value(design.rules, rng))
        if net_gain(design, sized) > 0.0:
            told[kind] = sized
    return tuple(told.values())


def _pattern(one: CrossValidated) -> Pattern:
    assert isinstance(one.hypothesis.cause, Pattern)
    return one.hypothesis.cause


def _sized(design: Design, one: Hypothesis, column: Floats, p_value: float) -> Hypothesis:
    """Return a pattern with its size by the steps of the fitted days, beside everything else."""
    term = Term(len(design.values))
    seen = replace(design, values=np.concatenate([design.values, column[None]])).whitened(design.whitening)
    null = linear.fit(seen.grams, seen.null_model())
    named = linear.fit(seen.grams, null.model.with_term(term))
    (amplitude,) = named.amplitudes.tolist()
    deviation = linear.deviation_by_day(seen.grams, named)
    gain = named.solution.gain - null.solution.gain
    return replace(one, gain=gain, amplitude=amplitude, statistic=abs(amplitude) / deviation, p_value=p_value)
