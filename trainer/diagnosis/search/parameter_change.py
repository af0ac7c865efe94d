"""A parameter's own change: what the model has, but no longer as it is in the greenhouse.

A whitened cover, lamps that were taken down, a blocked dosing line: the model has all of it, and only its numbers are
no longer those of the greenhouse. Recalibration follows such a change without saying so. Asked here is which parameter
alone explains it: each is left free while everything else has changed since the calibration as physics alone lets
expect, and must gain more than in this greenhouse's own calibration log, and in any in which nothing had changed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.bundle import Estimate
from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis.design import linear, sensitivity
from igrow.trainer.diagnosis.design.design import Block, Design
from igrow.trainer.diagnosis.design.linear import Fit
from igrow.trainer.diagnosis.search import change, scan
from igrow.trainer.diagnosis.search.estimate import OnsetInterval, onset_interval, reach
from igrow.trainer.diagnosis.search.scan import Hypothesis
from igrow.trainer.diagnosis.visible_parameters import TOGETHER, VISIBLE, members
from igrow.trainer.fit.climate import bounds

SECANTS = 2
"""Turns in which the size of a change is found by the change of before: the first is that of the slope."""


@dataclass(frozen=True)
class ParameterChange:
    """A parameter that is not what it was at the calibration."""

    parameter: str
    share: Estimate
    """Of its value then: -0.3 is 30 % less."""
    onset: OnsetInterval | None
    p_value: float
    confounded: tuple[str, ...]
    """Parameters that would explain the log as well, itself first."""
    leads: bool
    """It explains the log better than any effect does."""
    gain: float = 0.0
    """Log-likelihood that it gains."""


def find(design: Design, rng: np.random.Generator) -> ParameterChange | None:
    """Return the parameter that has changed; None where none stands out, or clearly one that nobody can look at.

    Args:
        design: of the log.
        rng: for the flips.
    """
    rules, unasked, design = design.rules, design.known.without, joined(design)
    null, onsets = linear.fit(design.grams, design.null_model()), scan.onset_days(design)
    scored = score(design, null, onsets, rng)
    net = {one.parameter: change.proven_gain(design, one) - _needed_gain(design, one) for one in scored}
    # Of what is none at the calibration there is no share.
    visible = [
        one
        for one in scored
        if one.parameter in VISIBLE
        and unasked.isdisjoint(members(one.parameter))
        and _range(design, one.parameter)[0] > 0.0
    ]
    # What each must gain tells which may be told, and not which.
    proven = (one for one in visible if net[one.parameter] >= 0.0)
    best = max(proven, key=lambda one: change.proven_gain(design, one), default=None)
    if best is None:
        return None
    # Of what one thing changes together, and each of it alone, that which explains most, at its size: a slope says too
    # little of what changes much. What explains as much alone is still what one thing changes together.
    family = [one for one in visible if set(members(one.parameter)) & set(members(best.parameter))]
    sized = [at_its_size(design, one, onsets, rng) for one in family if _may_be(one, net)]
    # What stands by its slope stands.
    net |= {
        one.parameter: max(net[one.parameter], change.proven_gain(its, one) - _needed_gain(its, one))
        for its, one in sized
    }
    together = dict.fromkeys(TOGETHER, rules.confounded_gain)
    sized.sort(key=lambda two: change.net_gain(*two) + together.get(two[1].parameter, 0.0), reverse=True)
    effects = {one.effect: change.net_gain(design, one) for one in change.scored(design, null, rng)}
    by_slope = {one.parameter: change.net_gain(design, one) for one in scored}

    def leads(its: Design, one: Hypothesis) -> bool:
        # An effect that is more of the same is as little linear: these two are compared by their slopes.
        gains = {True: by_slope[one.parameter], False: change.net_gain(its, one)}
        same = {name: not set(EFFECTS[name].resembles).isdisjoint(members(one.parameter)) for name in effects}
        return all(gains[same[name]] >= rules.parameter_over_effect * gain for name, gain in effects.items())

    told = (_told(its, one, scored, net, leads=leads(its, one)) for its, one in sized if net[one.parameter] >= 0.0)
    return next((one for one in told if one is not None), None)


def _may_be(one: Hypothesis, net: Mapping[str, float]) -> bool:
    """Tell whether a parameter may gain what it must; of what changes together a slope alone does not tell."""
    return one.parameter in TOGETHER or net[one.parameter] >= 0.0


def _told(
    design: Design, best: Hypothesis, scored: Sequence[Hypothesis], net: Mapping[str, float], *, leads: bool
) -> ParameterChange | None:
    """Return a parameter's change; None where it cannot be, or one that nobody can look at explains more.

    Args:
        design: of the log, with the change at its size.
        best: the change.
        scored: changes of all parameters.
        net: by parameter, what each gains beyond what it must.
        leads: it goes before all effects.
    """
    rules = design.rules
    margin = rules.confounded_within(best.gain)
    if max(net.values()) > net[best.parameter] + margin:
        # One that nobody can look at explains it clearly better.
        return None
    null = linear.fit(design.grams, design.null_model())
    named = linear.fit(design.grams, null.model.with_term(best.term))
    value, low, high = _range(design, best.parameter)
    wide = reach(rules) * linear.deviation_by_day(design.grams, named)
    size = float(named.amplitudes[0])
    beyond, least = rules.beyond_bound, rules.least_parameter_change(leads=leads)
    if abs(size) < least * value or not beyond * (low - value) < size < beyond * (high - value):
        # What asks for more than there can be is something else.
        return None
    lowest, highest = sorted(((size - wide) / value, (size + wide) / value))
    as_good = [
        one.parameter
        for one in scored
        if one.parameter in VISIBLE
        and not set(members(one.parameter)) & set(members(best.parameter))
        and net[one.parameter] >= max(0.0, net[best.parameter] - margin)
    ]
    return ParameterChange(
        best.parameter,
        Estimate(size / value, lowest, highest, "1"),
        onset_interval(design, null, best.term),
        best.p_value,
        (best.parameter, *as_good),
        leads,
        best.gain,
    )


def at_its_size(
    design: Design, one: Hypothesis, onsets: Sequence[int | None], rng: np.random.Generator
) -> tuple[Design, Hypothesis]:
    """Return a parameter's change as what it is at its size, and not as what a slope makes of it; and a design with it.

    Effects are nearly linear in their amplitude; a third of the light, or half of what a crop transpires, is not in a
    parameter, and explains less along its slope than it does.
    """
    place = design.values.shape[0]
    value, low, high = _range(design, one.parameter)
    told = design, one
    for _ in range(SECANTS):
        column = sensitivity.parameter_secant(
            design.line, members(one.parameter), one.amplitude, one.parameter in TOGETHER
        )
        if not design.line.stays_bounded(column[None], np.array([abs(one.amplitude)])).all():
            break
        block = Block((one.parameter,), range(place, place + 1))
        wider = replace(
            design,
            blocks={**design.blocks, "changed": block},
            values=np.concatenate([design.values, design.balances(column[None])]),
        ).whitened(design.whitening)
        null = linear.fit(wider.grams, wider.null_model())
        limits = np.array([[low - value, high - value]])
        scanned = scan.scan(wider.grams, null, [place], [None], onsets, limits, rng, design.rules.flips)
        found = scan.best_of_each(scanned, [one.parameter], [None], [one.parameter], design.rules.onset_price)
        if not found or found[0].gain < one.gain:
            break
        one = found[0]
        told = wider, one
    return told


def joined(design: Design) -> Design:
    """Return a design with a further block, `together`: of parameters that change by the same share, by that share."""
    block, products = design.block("parameter"), design.grams.products
    values, size = design.prior.values, products.shape[1]
    names = [name for name in TOGETHER if all(values.get(one) for one in members(name))]
    weights = np.array([[values[one] * (one in members(name)) for one in block.labels] for name in names])
    weights = weights.reshape(len(names), len(block))
    crossed = np.einsum("dqp,gp->dqg", products[:, :, block.columns], weights)
    own = np.einsum("gp,dph->dgh", weights, crossed[:, block.columns, :])
    together = Block(tuple(names), range(size, size + len(names)))
    return replace(
        design,
        blocks={**design.blocks, "together": together},
        values=np.concatenate([design.values, np.tensordot(weights, design.values[block.columns], axes=1)]),
        grams=replace(design.grams, products=np.block([[products, crossed], [crossed.transpose(0, 2, 1), own]])),
    )


def score(design: Design, current: Fit, onsets: Sequence[int | None], rng: np.random.Generator) -> list[Hypothesis]:
    """Return every parameter, and those that change together, as a hypothesis within its bounds, the likeliest first.

    Args:
        design: of `joined`.
        current: the fit so far.
        onsets: days of beginning that are tried; None is always.
        rng: for the flips.
    """
    blocks = [design.block(name) for name in ("parameter", "together")]
    labels = [name for block in blocks for name in block.labels]
    columns = [column for block in blocks for column in block.columns]
    reaches = np.array([_range(design, name) for name in labels])
    none: list[int | None] = [None] * len(labels)
    limits = reaches[:, 1:] - reaches[:, :1]
    scanned = scan.scan(design.grams, current, columns, none, onsets, limits, rng, design.rules.flips)
    return scan.best_of_each(scanned, labels, none, labels, design.rules.onset_price)


def _range(design: Design, name: str) -> tuple[float, float, float]:
    """Return the value of a parameter and its bounds; of those that change together in shares of what they are."""
    values, names = design.prior.values, members(name)
    low, high = bounds(names)
    if name not in TOGETHER:
        return values[name], float(low[0]), float(high[0])
    now = np.array([values[one] for one in names])
    ends = np.sort(np.stack([low / now, high / now]), axis=0)
    return 1.0, float(ends[0].max()), float(ends[1].min())


def _needed_gain(design: Design, one: Hypothesis) -> float:
    """Return what a parameter must gain: much more than it did in any greenhouse in which nothing had changed."""
    known = design.known.null_gains
    assert known is not None
    usual = known.largest.get(one.key, 0.0)
    return max(design.rules.least_parameter_gain, design.rules.parameter_over_null * usual)
