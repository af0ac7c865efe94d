"""Several networks of one stage as a single wider one whose increment is the mean of theirs.

Networks that differ only in their first weights and in the windows they saw err differently where data are few; the
mean of their increments errs less than each. Merged, they are an ordinary `Stage`, which every runtime knows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from igrow.core.simulator.network import Stage


def merge(members: Sequence[Stage]) -> Stage:
    """Return one stage whose network output is the mean of the members'.

    Raises ValueError where the members do not share inputs, scales and depth. Exact for states whose increment is
    linear in the output; a cumulative state's increment is then the softplus of the mean output.
    """
    first = members[0]
    for other in members[1:]:
        same = (other.drivers, other.time_constants, other.states, other.clock, len(other.matrices)) == (
            first.drivers, first.time_constants, first.states, first.clock, len(first.matrices),
        )  # fmt: skip
        scales = ("feature_offset", "feature_scale", "state_offset", "state_scale", "increment_scale")
        if not same or not all(np.array_equal(getattr(other, key), getattr(first, key)) for key in scales):
            raise ValueError(f"the members of stage {first.name} differ in more than their weights")
    if len(members) == 1:
        return first
    if len(first.matrices) == 1:
        raise ValueError(f"stage {first.name} has no hidden layer to put side by side")
    matrices = [np.concatenate([member.matrices[0] for member in members], axis=1)]
    for layer in range(1, len(first.matrices) - 1):
        matrices.append(block_diag(*[member.matrices[layer] for member in members]))
    matrices.append(np.concatenate([member.matrices[-1] for member in members], axis=0) / len(members))
    biases = [np.concatenate([member.biases[layer] for member in members]) for layer in range(len(first.matrices) - 1)]
    biases.append(np.mean([member.biases[-1] for member in members], axis=0))
    return replace(
        first,
        matrices=tuple(matrix.astype(np.float32) for matrix in matrices),
        biases=tuple(bias.astype(np.float32) for bias in biases),
    )
