"""The history of a greenhouse: learned from the log of its calibration, carried on to each later log.

Two questions are told apart. What the model lacks is asked of the calibration log, under physical priors: every
parameter, every effect and every pattern together, linear about the calibrated parameters (`history_of`). What has
changed since is asked of a later log: a greenhouse drifts, its crop faster than its walls, and that drift alone stands
between what was learned and what may be expected now (`expected`). Of a greenhouse that no calibration has shown only
the priors are known (`unknown`).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from igrow.core.arrays import Floats
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.trainer.data.splits import DaySplit, split_days
from igrow.trainer.diagnosis.design import linear, noise
from igrow.trainer.diagnosis.design.amplitudes import columns, drift_over, drift_within, hardly_shown, keys, omission
from igrow.trainer.diagnosis.design.design import Design, History, lay_out
from igrow.trainer.diagnosis.design.freerun import LogDays
from igrow.trainer.diagnosis.design.linear import DailyGrams, LinearModel
from igrow.trainer.diagnosis.design.noise import Whitening
from igrow.trainer.diagnosis.knowledge import (
    PARAMETER_PREFIX,
    VENTS,
    ActiveTerm,
    Knowledge,
    activate,
    knowledge_of,
)
from igrow.trainer.diagnosis.learned.null_gains import NullGains, read_null_gains
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.search import parameter_change, scan
from igrow.trainer.fit.climate import site_prior
from igrow.trainer.fit.discrepancy import Discrepancy
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.model import FittedModel
from igrow.trainer.fit.population import Population

SURE = 1e-3
"""Standard deviation of a parameter, in that of the site's description, below which it was held and not fitted."""
PARTS = (2, 4)
"""Into so many windows a calibration log is cut, to see what gains in each though nothing has changed."""


def history_of(
    record: Record, model: FittedModel, rules: DecisionRules, population: Population | None = None
) -> Discrepancy:
    """Return what a calibrated model misses of its greenhouse, learned from all days of the calibration log.

    Args:
        record: of that log, on its working grid.
        model: calibrated on it; a change of its parameters is held to the site's description, not to their
            calibration, which has used this log already.
        rules: how much of everything may be missing.
        population: what other greenhouses of its owner have shown (None: the description and the rules alone).

    Raises:
        DivergenceError: the model runs out of all bounds on the log.
    """
    effects = activate(record, knowledge_of(model, model.site, rules).terms)
    found, design = jointly(record, model.site, model.posterior, rules, population, effects)
    numbers = design.balances.numbers
    return Discrepancy(
        parameters=model.posterior.values,
        amplitudes=found,
        filters={balance: one.raw for balance, one in zip(numbers, design.whitening.filters, strict=True)},
        step=record.step,
        own_gains=own_gains(design),
        middle=_middle(record),
        opening=opening_of(record),
        leaf_area=leaf_area_of(record),
        unseen=tuple(sorted(hardly_shown(design))),
    )


def opening_of(record: Record) -> float:
    """Return the mean opening of both rows of vents together, %."""
    return float(sum(record.inputs[row].mean() for row in ("vent_lee", "vent_wind")))


def leaf_area_of(record: Record) -> float:
    """Return the mean leaf area index, measured or by the usual course."""
    return float(np.mean(record.inputs["leaf_area_index"]))


def vents_hardly_open(known: Discrepancy | None, record: Record, rules: DecisionRules) -> bool:
    """Tell whether the vents stand open much less than in the calibration log, or hardly opened then.

    A law that wide openings taught says little of narrow ones, and one that none did says nothing: what changes then is
    its error, or the vents'.
    """
    if known is None:
        return False
    opening = opening_of(record)
    untried = opening > 0.0 and known.opening < rules.least_opening
    return untried or opening < rules.least_opening_share * known.opening


def with_vents(known: Discrepancy | None, record: Record, rules: DecisionRules) -> tuple[frozenset[str], DecisionRules]:
    """Return the parameters of vents that are not asked of a log, and the rules for it.

    Where vents hardly open their law may be off by more than physics lets drift.
    """
    if vents_hardly_open(known, record, rules):
        return VENTS, replace(rules, vent_drift=rules.narrow_vent_drift)
    return frozenset(), rules


def jointly(
    record: Record,
    site: Site,
    posterior: Gaussian,
    rules: DecisionRules,
    population: Population | None = None,
    effects: ActiveEffects | None = None,
) -> tuple[Gaussian, Design]:
    """Return all amplitudes of a calibration log, and its design under the noise beside them; see `history_of`."""
    days = split_days(record, site.longitude)
    whole = DaySplit(days.day, np.ones(days.days, dtype=bool))
    plain = lay_out(record, whole, posterior, effects or {}, site.longitude, rules)
    shared, names = population or Population({}, {}, 0), keys(plain)[len(posterior.names) :]
    described = held(posterior, shared.prior(site).marginal(posterior.names))
    centre, spread = shared.scaled(names, omission(names, rules, hardly_shown(plain)))
    mean = np.concatenate([described.mean - posterior.mean, centre])
    deviation = np.concatenate([described.standard_deviation, spread])
    prior = Gaussian(keys(plain), mean, np.diag(deviation**2))
    return solve_jointly(replace(plain, history=History(prior, np.zeros_like(plain.values[0]), (), {})))


def physical_prior(site: Site, posterior: Gaussian) -> Gaussian:
    """Return what the site's description says of the parameters; those that a calibration was told to hold stay."""
    return held(posterior, site_prior(site).marginal(posterior.names))


def held(posterior: Gaussian, described: Gaussian) -> Gaussian:
    """Return a description in which the parameters that a calibration was told to hold stay where they are."""
    sure = posterior.standard_deviation < SURE * described.standard_deviation
    mean = np.where(sure, posterior.mean, described.mean)
    deviation = np.where(sure, posterior.standard_deviation, described.standard_deviation)
    return Gaussian(posterior.names, mean, np.diag(deviation**2))


def laid_out(
    days: LogDays, site: Site, known: Discrepancy, terms: Sequence[ActiveTerm], rules: DecisionRules
) -> Design:
    """Return the design of a log about the parameters of the calibration, before any noise."""
    names = tuple(known.parameters)
    spread = site_prior(site).marginal(names).covariance
    about = Gaussian(names, np.array(list(known.parameters.values())), spread)
    return lay_out(days.record, days.split, about, activate(days.record, terms), site.longitude, rules)


def unknown(days: LogDays, site: Site, knowledge: Knowledge, rules: DecisionRules) -> Discrepancy:
    """Return what may be expected of a greenhouse that no calibration has shown: the priors, about its own parameters.

    Args:
        days: of the log that is asked.
        site: the greenhouse.
        knowledge: of the model in force, calibrated elsewhere or on too short a log.
        rules: how much of everything may be missing.

    Raises:
        DivergenceError: the model runs out of all bounds on the log.
    """
    prior, fitted = knowledge.prior, days.fit(knowledge.prior, knowledge.terms)
    about = Gaussian(fitted.names, fitted.mean, site_prior(site).marginal(fitted.names).covariance)
    plain = lay_out(days.record, days.split, about, activate(days.record, knowledge.terms), site.longitude, rules)
    names = keys(plain)[len(fitted.names) :]
    mean = np.concatenate([prior.mean - fitted.mean, np.zeros(len(names))])
    # A null that may be missing as much as a calibration may would hide whatever is; bounds make up for it.
    missing = np.diag((rules.unknown_share * omission(names, rules)) ** 2)
    return Discrepancy(
        parameters=fitted.values,
        amplitudes=Gaussian(keys(plain), mean, block_diag(prior.covariance, missing)),
        filters={},
        step=days.record.step,
        own_gains={},
        middle=_middle(days.record),
    )


def expected_misfit(known: Discrepancy, plain: Design) -> Floats:
    """Return what the model is expected to miss along a log, (b, r, steps)."""
    misfit: Floats = np.tensordot(expected_amplitudes(known, plain), plain.values[columns(plain)], axes=1)
    return misfit


def expected_amplitudes(known: Discrepancy, plain: Design) -> Floats:
    """Return the expected amplitudes of everything that may be missing, (k,); what is new in the log is 0."""
    amplitudes = known.amplitudes.values
    return np.array([amplitudes.get(key, 0.0) for key in keys(plain)])


def expected(
    known: Discrepancy,
    plain: Design,
    misfit: Floats | None,
    without: Collection[str] = (),
    null_gains: NullGains | None = None,
    unnamed: Collection[str] = (),
) -> Design:
    """Return the design of a later log: what is expected of it taken off, under the history's colour.

    Args:
        known: of the greenhouse.
        plain: the log, laid out about the calibrated parameters.
        misfit: (b, r, steps), from `expected_misfit`, of the log without the causes that have been found in it; None of
            an `unknown` greenhouse, whose parameters are far from where the model is linear, and come back by its runs.
        without: effects that are no candidates.
        null_gains: of greenhouses in which nothing has changed (None: what came with the trainer).
        unnamed: patterns by key that no cause of this log explains: of them nothing is expected.
    """
    null_gains = null_gains or read_null_gains()
    numbers = plain.balances.numbers
    # The colour of other time steps, or of a balance that the calibration log could not tell, is to be learned.
    known_colour = plain.line.record.step == known.step and set(numbers) <= set(known.filters)
    filters = tuple(noise.filter_of(known.filters[balance]) for balance in numbers) if known_colour else ()
    found = np.array([key in unnamed for key in keys(plain)])
    now = drifted(known, plain).widened(plain.rules.largest_pattern * found)
    if misfit is None:
        now, misfit = now.moved(expected_amplitudes(known, plain)), np.zeros_like(plain.values[0])
    values = plain.values.copy()
    values[0] += misfit
    within = History(now, misfit, filters, known.own_gains, frozenset(without), null_gains, frozenset(unnamed))
    design = replace(plain, values=values, history=within)
    _, design = solve_jointly(design)
    # Parameters as the rest of the history leaves them, for fits that hold it.
    count = len(plain.prior.names)
    covariance: Floats = np.linalg.inv(now.precision[:count, :count]).astype(np.float64)
    held = Gaussian(plain.prior.names, plain.prior.mean + now.mean[:count], covariance)
    return replace(design, prior=held)


def drifted(known: Discrepancy, plain: Design) -> Gaussian:
    """Return how far everything may now lie from what is expected: the covariance of the history, and a drift.

    Of what is new in this log the calibration has said nothing.
    """
    wanted = keys(plain)
    place = {key: row for row, key in enumerate(known.amplitudes.names)}
    seen = [row for row, key in enumerate(wanted) if key in place]
    rows = [place[wanted[row]] for row in seen]
    unseen = set(wanted) - set(place)
    count = len(plain.prior.names)
    prior = np.concatenate([plain.prior.standard_deviation, omission(wanted[count:], plain.rules, unseen)])
    assert all(row in seen for row in range(count))
    covariance = np.diag(prior**2)
    covariance[np.ix_(seen, seen)] = known.amplitudes.covariance[np.ix_(rows, rows)]
    return Gaussian(wanted, np.zeros(len(wanted)), covariance).widened(drift_over(plain, days_between(known, plain)))


def followed(known: Discrepancy, parameters: Collection[str], share: float, deviation: float) -> Discrepancy:
    """Return a history in which parameters have changed: what is expected of the greenhouse from then on.

    Args:
        known: so far.
        parameters: by name, changed by the same share.
        share: of their values at the calibration.
        deviation: standard deviation of it.
    """
    values = {PARAMETER_PREFIX + name: known.parameters[name] for name in parameters}
    here = np.array([values.get(name, 0.0) for name in known.amplitudes.names])
    moved = known.amplitudes.moved(known.amplitudes.mean + share * here).widened(deviation * np.abs(here))
    return replace(known, amplitudes=moved)


def after(known: Discrepancy, design: Design) -> Discrepancy:
    """Return a history that has seen a later log too: what is expected of the greenhouse from then on.

    Args:
        known: so far.
        design: of that log, by this history, with all causes that were found in it.
    """
    solution = linear.fit(design.grams, design.null_model()).solution
    seen, before = keys(design), known.amplitudes
    place = {key: row for row, key in enumerate(before.names)}
    kept = [key for key in before.names if key not in set(seen)]
    rows = [place[key] for key in kept]
    mean = np.array([before.mean[place[key]] if key in place else 0.0 for key in seen]) + solution.coefficients
    # What this log says nothing of is known as before, but no longer together with the rest.
    covariance = block_diag(solution.inverse, before.covariance[np.ix_(rows, rows)])
    amplitudes = Gaussian((*seen, *kept), np.concatenate([mean, before.mean[rows]]), covariance)
    return replace(known, amplitudes=amplitudes, middle=_middle(design.line.record))


def days_between(known: Discrepancy, plain: Design) -> float:
    """Return the days from the middle of the calibration log to that of a later one."""
    middle = _middle(plain.line.record)
    return float((middle - known.middle).astype("timedelta64[s]").astype(np.float64) / 86_400.0)


def _middle(record: Record) -> np.datetime64:
    middle: np.datetime64 = record.time[0] + (record.time[-1] - record.time[0]) / 2
    return middle


def own_gains(design: Design) -> dict[str, float]:
    """Return the largest gain of every effect, pattern and parameter in a window of a log, when all is learned on the
    rest.

    Args:
        design: of the calibration log, under its noise.
    """
    design = parameter_change.joined(design)
    null, days = design.null_model(), design.split.days
    change, largest = drift_within(design), dict[str, float]()
    for parts in PARTS:
        part = np.arange(days) * parts // days
        for number in range(parts):
            inside = part == number
            rest = linear.fit(DailyGrams(design.grams.products, ~inside), null).solution
            after = Gaussian(design.known.amplitudes.names, rest.coefficients, rest.inverse).widened(change)
            window = replace(design, grams=DailyGrams(design.grams.products, inside))
            current = linear.fit(window.grams, LinearModel(null.base, after.precision, after.mean))
            rng = np.random.default_rng(0)
            for score in (scan.score_candidates, scan.score_patterns, parameter_change.score):
                for one in score(window, current, [None], rng):
                    largest[one.key] = max(largest.get(one.key, 0.0), one.gain)
    return {key: float(f"{gain:.4g}") for key, gain in largest.items()}


def solve_jointly(design: Design) -> tuple[Gaussian, Design]:
    """Return all amplitudes under their prior, and the design under the noise beside them, fitted by turns."""
    null = design.null_model()
    base = list(null.base)
    found = Gaussian(keys(design), np.zeros(len(base)), np.zeros((len(base),) * 2))
    whitening: Whitening | None = None
    for _ in range(design.rules.noise_rounds):
        errors = design.values[0] + np.tensordot(found.mean, design.values[base], axes=1)
        whitening = design.fit_noise(errors, whitening)
        design = design.whitened(whitening)
        solution = linear.fit(design.grams, null).solution
        found = Gaussian(found.names, solution.coefficients, solution.inverse)
    return found, design
