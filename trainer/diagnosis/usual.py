"""How greenhouses and weathers differ though nothing is missing, learned from virtual greenhouses.

A greenhouse whose parameters lie 8 % from the calibrated one's, under another weather, leaves traces that look
like small effects: a humidity offset here, a little air exchange there. What such traces look like is learned once
from logs of the mechanistic greenhouse with nothing hidden in them: the misfit of each log as one list of
amplitudes, and of all lists the few directions that hold most of their scatter. A diagnosis lets each direction
explain what it can, at the size it usually has, before it looks for a cause.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files

import numpy as np

from trainer.diagnosis import structure
from trainer.diagnosis.candidates import Candidate
from trainer.diagnosis.drivers import Pattern
from trainer.diagnosis.problem import Problem, candidate_key, pattern_key

FILE = "usual_misfit.json"
DIRECTIONS = 16


def directions(problems: Sequence[Problem], count: int = DIRECTIONS) -> list[dict[str, float]]:
    """Return the directions of the misfits of logs for which nothing is missing, each at its usual size.

    Args:
        problems: prepared with the known misfit of their calibration, without usual ones.
        count: of directions.
    """
    lists = []
    traces = []
    for problem in problems:
        null = structure.null_model(problem)
        lists.append(structure.amplitudes(problem, null.base))
        traces.append(_size(problem))
    keys = sorted({key for one in lists for key in one})
    unit = {key: value for sizes in traces for key, value in sizes.items()}
    scale = np.array([unit[key] for key in keys])
    table = np.array([[one.get(key, 0.0) for key in keys] for one in lists]) * scale
    _, sizes, axes = np.linalg.svd(table / np.sqrt(len(table)), full_matrices=False)
    return [
        {key: float(f"{value:.3g}") for key, value in zip(keys, size * axis / scale, strict=True) if value != 0.0}
        for size, axis in zip(sizes[:count], axes[:count], strict=True)
    ]


def _size(problem: Problem) -> dict[str, float]:
    """Return how much one unit of each column moves the innovations, by key."""
    columns: list[tuple[int, Candidate | Pattern]] = [
        *zip(problem.candidate, problem.candidates, strict=True),
        *zip(problem.pattern, problem.patterns, strict=True),
    ]
    total = problem.grams.products.sum(axis=0)
    return {
        candidate_key(cause) if isinstance(cause, Candidate) else pattern_key(cause): float(
            np.sqrt(total[index, index])
        )
        for index, cause in columns
    }


@cache
def installed() -> tuple[Mapping[str, float], ...]:
    """Return the directions that are installed with the trainer."""
    text = files("trainer.diagnosis").joinpath(FILE).read_text(encoding="utf-8")
    return tuple(json.loads(text))
