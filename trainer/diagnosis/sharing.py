"""What a greenhouse tells others of its owner: where it lies and what its model misses. No row of a log.

From several of these `igrow.trainer.fit.population` learns the prior of a further calibration.
"""

from __future__ import annotations

import numpy as np

from igrow.trainer.diagnosis.design import amplitudes
from igrow.trainer.diagnosis.knowledge import PARAMETER_PREFIX
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.fit.climate import site_prior
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.model import FittedModel
from igrow.trainer.fit.population import Learned, learned_of


def learned_from(model: FittedModel) -> Learned:
    """Return what a calibration by the description alone says of a greenhouse and its discrepancy."""
    found = learned_of(site_prior(model.site), model.posterior)
    if model.history is None:
        return found
    found_missing = model.history.amplitudes
    # What a log hardly showed it has nothing to tell of.
    unseen = set(model.history.unseen)
    names = tuple(name for name in found_missing.names if not (name.startswith(PARAMETER_PREFIX) or name in unseen))
    before = Gaussian(names, np.zeros(len(names)), np.diag(amplitudes.omission(names, DEFAULT) ** 2))
    missing = learned_of(before, found_missing.marginal(names))
    return Learned({**found.shift, **missing.shift}, {**found.variance, **missing.variance})
