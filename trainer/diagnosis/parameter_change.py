"""A parameter's own change: what the model has, but no longer as it is in the greenhouse.

A whitened cover, lamps that were taken down, a blocked dosing line: the model has all of it, and only its numbers are
no longer those of the greenhouse. Recalibration follows such a change without saying so. Asked here is which parameter
alone explains it: each is left free while everything else has changed since the calibration as physics alone lets
expect, and must gain more than it did in any greenhouse in which nothing had changed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from igrow.core.bundle import Estimate
from igrow.core.language import N_
from igrow.trainer.diagnosis import change, linear, search
from igrow.trainer.diagnosis.design import Design
from igrow.trainer.diagnosis.estimate import OnsetInterval, onset_interval, reach
from igrow.trainer.diagnosis.search import Hypothesis
from igrow.trainer.fit.climate import bounds

_COVER = N_("compare the light above the cover and below it; look for dirt, shading paint and wet glass")
_GAPS = N_("look for open panes, doors, gaps and vents that do not close, and compare a calm night with a windy one")
_SCREEN = N_("close the screen by day and look for gaps, tears and light at its edges")
_PIPES = N_("feel the pipes along their length; check pump, valve and air in the pipes")
_LAMPS = N_("count the lamps that burn, and compare their power and their light with those of the weeks before")
_VENTS = N_("look whether the vents open as far as the climate computer says")
_DOSING = N_("check the dosing lines and what the CO2 meter counts")
_CROP = N_("look at the crop: leaf area, water, pests and disease")


@dataclass(frozen=True)
class Visible:
    """A parameter that a grower can look at."""

    title: str
    balances: tuple[str, ...]
    """That it moves."""
    check: str
    """What to look at."""


_AIR = ("heat", "vapour", "co2")
VISIBLE: Mapping[str, Visible] = {
    "transmissivity": Visible(N_("light through the cover"), ("light", "heat"), _COVER),
    "cover_heat_transfer": Visible(N_("heat that the cover loses"), ("heat",), _GAPS),
    "leakage_still": Visible(N_("air that leaks in calm weather"), _AIR, _GAPS),
    "leakage_wind": Visible(N_("air that leaks in with the wind"), _AIR, _GAPS),
    "energy_screen_saving": Visible(N_("heat that the energy screen saves"), ("heat",), _SCREEN),
    "blackout_screen_saving": Visible(N_("heat that the blackout screen saves"), ("heat",), _SCREEN),
    "rail_pipe_heat_transfer": Visible(N_("heat that the rail pipes give off"), ("heat",), _PIPES),
    "grow_pipe_heat_transfer": Visible(N_("heat that the grow pipes give off"), ("heat",), _PIPES),
    "lamp_heat_share": Visible(N_("heat of the lamps"), ("heat",), _LAMPS),
    "lamp_radiation_share": Visible(N_("light of the lamps"), ("light", "heat"), _LAMPS),
    "vent_wind": Visible(N_("air through the vents in the wind"), _AIR, _VENTS),
    "vent_stack": Visible(N_("air through the vents in calm weather"), _AIR, _VENTS),
    "dosing_share": Visible(N_("CO2 that arrives of what is dosed"), ("co2",), _DOSING),
    "assimilation_maximum": Visible(N_("CO2 that the crop takes up in strong light"), ("co2",), _CROP),
    "assimilation_light": Visible(N_("CO2 that the crop takes up in weak light"), ("co2",), _CROP),
    "respiration": Visible(N_("CO2 that crop and soil give off"), ("co2",), _CROP),
    "transpiration_radiation": Visible(N_("water that the crop transpires in the sun"), ("vapour", "heat"), _CROP),
    "transpiration_deficit": Visible(N_("water that the crop transpires in dry air"), ("vapour", "heat"), _CROP),
}
"""By parameter. The others (masses, shares of the model's own) have no name in a greenhouse."""


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


def find(design: Design, rng: np.random.Generator) -> ParameterChange | None:
    """Return the parameter that has changed; None where none stands out, or one that nobody can look at.

    Args:
        design: of the log, in a greenhouse that changes by physics alone.
        rng: for the flips.
    """
    rules, null = design.rules, linear.fit(design.grams, design.null_model())
    scored = search.score_parameters(design, null, search.onset_days(design), rng)
    net = {one.parameter: change.proven_gain(design, one) - _needed_gain(design, one) for one in scored}
    best = max(scored, key=lambda one: net[one.parameter], default=None)
    if best is None or net[best.parameter] < 0.0 or best.parameter not in VISIBLE:
        return None
    named = linear.fit(design.grams, null.model.with_term(best.term))
    value = design.prior.values[best.parameter]
    wide = reach(rules) * linear.deviation_by_day(design.grams, named)
    size = float(named.amplitudes[0])
    low, high = (float(one[0]) for one in bounds([best.parameter]))
    if abs(size) < rules.least_parameter_change * abs(value) or not low < value + size < high:
        # What asks for more than there can be is something else.
        return None
    least, most = sorted(((size - wide) / value, (size + wide) / value))
    effects = search.score_candidates(design, null, search.onset_days(design), rng)
    largest = max((change.net_gain(design, one) for one in effects), default=0.0)
    margin = max(rules.confounded_gain, rules.confounded_share * best.gain)
    as_good = [
        one.parameter
        for one in scored
        if one is not best and one.parameter in VISIBLE and net[one.parameter] >= max(0.0, net[best.parameter] - margin)
    ]
    return ParameterChange(
        best.parameter,
        Estimate(size / value, least, most, "1"),
        onset_interval(design, null, best.term),
        best.p_value,
        (best.parameter, *as_good),
        best.gain >= rules.parameter_over_effect * largest,
    )


def _needed_gain(design: Design, one: Hypothesis) -> float:
    """Return what a parameter must gain: much more than it did in any greenhouse in which nothing had changed."""
    assert design.history is not None and design.history.drift is not None
    usual = design.history.drift.null_gains.get(one.key, 0.0)
    return max(design.rules.least_parameter_gain, design.rules.parameter_over_null * usual)
