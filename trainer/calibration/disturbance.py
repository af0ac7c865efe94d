"""How a site's disturbances go on: the shares and decay times of `DisturbanceModel`, fitted to its log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from igrow.core.simulator.hybrid.disturbance import DisturbanceModel, courses
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.calibration.evaluation import starts_within

Floats = NDArray[np.float64]

_MEMORIES = (0.7, 1.5, 3.0, 6.0)
_DECAYS = (1.0, 2.0, 4.0, 8.0, 16.0)
_CLIP = 4.0
"""Fluxes beyond this many robust spreads count as this many."""


def fit_disturbance(
    parts: Sequence[tuple[Record, NDArray[np.bool_] | None, Mapping[str, Floats]]], hours: float = 24.0
) -> DisturbanceModel:
    """Return the disturbance model that predicts missing fluxes best (least squares) over the next `hours`.

    Args:
        parts: records, the rows that may be used (None: all), and their missing fluxes by channel, (n,).
        hours: how far ahead.
    """
    model = DisturbanceModel()
    best: tuple[float, DisturbanceModel] | None = None
    for memory in _MEMORIES:
        trial = replace(model, memory_days=memory)
        total = 0.0
        daily, recent, decay = {}, {}, {}
        for channel in parts[0][2]:
            cost, daily[channel], recent[channel], decay[channel] = _fit_channel(parts, channel, trial, hours)
            total += cost
        if best is None or total < best[0]:
            best = (total, replace(trial, daily_share=daily, recent_share=recent, decay_hours=decay))
    assert best is not None
    return best[1]


def _fit_channel(
    parts: Sequence[tuple[Record, NDArray[np.bool_] | None, Mapping[str, Floats]]],
    channel: str,
    model: DisturbanceModel,
    hours: float,
) -> tuple[float, float, float, float]:
    """Return (cost relative to no forecast, daily share, recent share, decay hours) of one channel."""
    targets, usual, departures, leads = [], [], [], []
    for record, rows, missing in parts:
        flux = missing[channel]
        allowed = np.ones(len(record), dtype=bool) if rows is None else rows
        steps = max(1, round(hours * 3600.0 / record.step))
        starts = starts_within(record, allowed, steps, max(1, round(4.1 * 3600.0 / record.step)))
        if len(starts) == 0 or not np.isfinite(flux).any():
            continue
        spread = 1.4826 * float(np.nanmedian(np.abs(flux - np.nanmedian(flux)))) + 1e-12
        clipped = np.clip(flux, -_CLIP * spread, _CLIP * spread) / spread
        course, departure = courses(record, clipped, starts, steps, model, 1.0)
        width = max(1, round(1800.0 / record.step))
        whole = steps // width * width
        ahead = clipped[starts + np.arange(whole)[:, None]].reshape(-1, width, len(starts))
        known = np.isfinite(ahead)
        mean = np.where(known, ahead, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
        targets.append(np.where(known.any(axis=1), mean, np.nan))
        usual.append(course[:whole].reshape(-1, width, len(starts)).mean(axis=1))
        departures.append(np.broadcast_to(departure, mean.shape))
        leads.append(
            np.broadcast_to(((np.arange(len(mean)) + 0.5) * width * record.step / 3600.0)[:, None], mean.shape)
        )
    if not targets:
        return 1.0, 0.0, 0.0, model.decay_hours[channel]
    target, course, departure, lead = (
        np.concatenate([part.ravel() for part in kind]) for kind in (targets, usual, departures, leads)
    )
    good = np.isfinite(target)
    target, course, departure, lead = target[good], course[good], departure[good], lead[good]
    best = (np.inf, 0.0, 0.0, 4.0)
    for decay in _DECAYS:
        matrix = np.stack([course, departure * np.exp(-lead / decay)], axis=1)
        shares = np.clip(np.linalg.lstsq(matrix, target, rcond=None)[0], 0.0, 1.0)
        cost = float(np.mean((target - matrix @ shares) ** 2) / np.mean(target**2))
        if cost < best[0]:
            best = (cost, float(shares[0]), float(shares[1]), decay)
    return best
