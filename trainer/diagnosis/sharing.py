"""What a greenhouse tells others of its owner: where it lies, what its model misses, how it changes. No row of a log.

From several of these `igrow.trainer.fit.population` learns the prior of a further calibration, and `drift.learn` how
greenhouses like them change.
"""

from __future__ import annotations

import numpy as np

from igrow.trainer.data.log import Log
from igrow.trainer.diagnosis import amplitudes, history
from igrow.trainer.diagnosis.design import Design
from igrow.trainer.diagnosis.drift import Drift, Pair
from igrow.trainer.diagnosis.freerun import log_days
from igrow.trainer.diagnosis.knowledge import PARAMETER_PREFIX
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.fit.climate import site_prior
from igrow.trainer.fit.discrepancy import Discrepancy
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.model import FittedModel
from igrow.trainer.fit.population import Learned, learned_of


def learned_from(model: FittedModel) -> Learned:
    """Return what a calibration by the description alone says of a greenhouse and its discrepancy."""
    found = learned_of(site_prior(model.site), model.posterior)
    if model.history is None:
        return found
    found_missing = model.history.amplitudes
    names = tuple(name for name in found_missing.names if not name.startswith(PARAMETER_PREFIX))
    before = Gaussian(names, np.zeros(len(names)), np.diag(amplitudes.omission(names, DEFAULT) ** 2))
    missing = learned_of(before, found_missing.marginal(names))
    return Learned({**found.shift, **missing.shift}, {**found.variance, **missing.variance})


def change_since(log: Log, model: FittedModel, days: float) -> Pair | None:
    """Return what a later log says of how a greenhouse changes; None where its history does not apply.

    Args:
        log: later than the calibration, of days on which nothing is missing.
        model: calibrated on the greenhouse.
        days: that rates count for.

    Raises:
        DivergenceError: the model runs out of all bounds on the log.
    """
    known, site = model.history, log.known_site
    if known is None or model.calibrated_on != site.name:
        return None
    plain = history.laid_out(log_days(log, model), site, known, (), DEFAULT)
    if not history.applies(known, plain):
        return None
    return pair(known, plain, history.expected(known, plain, history.expected_misfit(known, plain)), days)


def pair(known: Discrepancy, plain: Design, design: Design, days: float) -> Pair:
    """Return what a later log says of the change since the calibration.

    Args:
        known: learned from the calibration log.
        plain: the later log, laid out about the calibrated parameters.
        design: from `history.expected`, of that log.
        days: that rates count for; over more than these the change grows as a random walk does.
    """
    total = design.grams.of(amplitudes.columns(design), ())[design.grams.fit].sum(axis=0, dtype=np.float64)
    time = plain.line.record.time
    between = history.days_between(known, time[0] + (time[-1] - time[0]) / 2)
    unit, none = amplitudes.units(plain), Drift({}, days)
    return Pair(
        keys=amplitudes.rate_keys(plain),
        unit=unit * float(np.sqrt(max(between, days) / days)),
        expected=amplitudes.drift_within(plain) / unit,
        known=history.drifted(known, plain, none).covariance - np.diag(history.change_of(known, plain, none) ** 2),
        information=total[1:, 1:],
        score=-total[1:, 0],
    )
