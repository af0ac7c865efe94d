"""Every threshold of a diagnosis: what it means, and whether it was chosen, set on tuning logs, or fitted by a command.

Choices stand here. Bounds that were fitted to tuning logs have no value here: they come from `learned/rules.json`,
which the command that fits them writes together with where they come from.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any

FILE = "learned/rules.json"


def came_with_the_trainer(file: str) -> dict[str, Any]:
    """Return what a command has learned and written to a file of this folder."""
    document: dict[str, Any] = json.loads(files("igrow.trainer.diagnosis").joinpath(file).read_text(encoding="utf-8"))
    return document


def _chosen(value: float, meaning: str) -> Any:
    return field(default=value, metadata={"meaning": meaning, "set": "chosen"})


def _tuned(value: float, meaning: str) -> Any:
    return field(default=value, metadata={"meaning": meaning, "set": "set on tuning greenhouses"})


def _fitted(meaning: str) -> Any:
    return field(metadata={"meaning": meaning, "set": "fitted"})


@dataclass(frozen=True, kw_only=True)
class DecisionRules:
    """The thresholds of one diagnosis. Gains are log-likelihoods in nats, shares are fractions of one."""

    # What a log must have.
    least_days: float = _chosen(7.0, "days that a log must span")
    least_balance_share: float = _chosen(0.2, "share of a day's time steps that a balance's sensor must show to count")
    long_days: float = _chosen(42.0, "days from which on crop and season change within a log")

    # What is known of the parameters before the log.
    parameter_drift: float = _chosen(0.08, "relative change of a parameter between calibration and log")
    shipped_drift: float = _tuned(0.25, "the same in the model that is shipped, which follows whatever has no name")
    transferred_drift: float = _chosen(0.25, "the same between the greenhouse of the calibration and another one")
    least_drift_share: float = _chosen(0.3, "share of a parameter's usual value that the drift is at least taken of")

    # What has changed since the calibration, where what the model misses of this greenhouse was learned then.
    least_history_days: float = _chosen(21.0, "days of a calibration log from which on a history is learned")
    omission_effect: float = _tuned(0.3, "prior deviation of an effect in the discrepancy, in typical amplitudes")
    unseen_effect: float = _chosen(1.0, "the same of one that the calibration log hardly shows, or not at all")
    least_shown: float = _chosen(
        0.1, "size of an effect at its typical amplitude, over the errors, from which on it shows"
    )
    omission_pattern: float = _tuned(0.05, "the same of a pattern, in its units")
    unknown_share: float = _tuned(
        0.25, "share of these prior deviations in a greenhouse that no calibration has shown: what is there stands out"
    )
    least_omission_gain: float = _chosen(4.0, "gain in the linear model from which on an omitted term is fitted")
    most_omission_fits: int = _chosen(4, "terms that are fitted beside the parameters, those that gain most")
    least_omission_fall: float = _fitted(
        "share of the error of unseen weeks that an omitted term must remove: more than any where none was taken out"
    )
    wall_drift: float = _tuned(0.015, "relative change of a parameter within some weeks, by physics")
    crop_drift: float = _tuned(0.05, "the same of a parameter of the crop")
    light_drift: float = _tuned(0.015, "the same of a parameter that says where light ends")
    vent_drift: float = _tuned(0.015, "the same of a parameter of the vents' law")
    narrow_vent_drift: float = _chosen(0.25, "the same where the vents stand open much less than it was learned from")
    new_crop_drift: float = _chosen(
        0.5, "the same of crop and light where the calibration has not seen the crop, or of the share of its leaves"
    )
    most_new_leaves: float = _chosen(
        0.3, "that share up to which null bounds know what is new, and unseen days alone may tell something"
    )
    effect_drift: float = _tuned(0.02, "change of an effect in the discrepancy, in typical amplitudes")
    co2_source_drift: float = _tuned(0.1, "the same of a source of CO2, which a growing crop looks like")
    pattern_drift: float = _tuned(0.005, "the same of a pattern, in its units")
    later_days: float = _chosen(42.0, "days from a calibration to a later log up to which these hold; then as a walk")
    onset_price: float = _tuned(12.0, "gain that a beginning within the log must add")
    far_over_null: float = _tuned(
        2.5, "times what a change must gain from which on `least_skill` is enough of it, and no null skill is asked"
    )
    least_unproven_change: float = _tuned(2.0, "gain from which on a change is asked of unseen days alone")
    days_over_null: float = _tuned(
        1.3, "times what it took off unseen days at most where nothing had changed, that it must take off to be told so"
    )
    least_pattern_change: float = _tuned(60.0, "gain that a pattern must bring: greenhouses drift with the weather")
    least_proven_pattern: float = _tuned(20.0, "of it, what the scatter of day scores must bear out")
    pattern_over_change: float = _tuned(1.5, "times a change's gain at which a pattern replaces it")
    pattern_over_skill: float = _tuned(
        1.5, "times the skill of a name that only just stands at which a pattern is told in its place"
    )
    least_left_by_hour: float = _tuned(25.0, "gain of a pattern by the hour beside a change that unmakes its name")
    left_by_hour_share: float = _tuned(
        0.4, "the same as a share of the change's own: a large one of a slightly other form leaves much as well"
    )
    twin_drift: float = _tuned(0.1, "share of its drift that a parameter keeps beside a change that is more of it")

    # Which parameter has changed, where no effect is missing or none explains as much.
    least_opening_share: float = _chosen(
        0.5, "of the vents' opening at the calibration: with less nothing is asked of them"
    )
    least_opening: float = _chosen(
        0.5, "mean opening of both rows of vents at the calibration, %, with less of which their law was not tried"
    )
    least_leading_change: float = _chosen(0.1, "share of its value by which a parameter that leads must have changed")
    least_other_change: float = _chosen(0.2, "the same of one that explains no more than an effect does")
    least_parameter_gain: float = _tuned(20.0, "gain that its change must bring")
    parameter_over_null: float = _tuned(2.0, "times its largest gain where nothing had changed that it must bring")
    parameter_over_effect: float = _tuned(
        1.1, "times the largest gain of an effect at which it goes before all effects"
    )
    most_parameter_over_found: float = _tuned(
        2.5, "times what was found beside it that a parameter may gain, where that is to stand in its place"
    )

    # The search.
    noise_rounds: int = _chosen(3, "alternations between coefficients and the colour of the noise")
    flips: int = _chosen(999, "draws of day signs in the max-T test")
    first_onset_days: int = _chosen(3, "days at the beginning of a log in which no beginning is looked for")
    last_onset_days: int = _tuned(5, "the same at its end")
    most_onsets: int = _chosen(30, "beginnings tried in a log; then day by day around the best")
    pattern_onset_stride: int = _chosen(4, "of the beginnings, every which one is tried for patterns")
    beyond_bound: float = _chosen(1.5, "how far a linear fit may go beyond a bound, as a multiple")

    bootstrap_draws: int = _chosen(2000, "of unseen days")
    most_patterns: int = _chosen(3, "patterns of one unexplained discrepancy")

    # Sizes and confounded causes.
    confidence: float = _chosen(0.90, "of every interval")
    deviation_inflation: float = _chosen(1.3, "of a standard error, for structure that no covariance knows")
    form_deviation: float = _chosen(0.3, "relative standard error for a truth that is not of the catalogue's form")
    confounded_gain: float = _chosen(6.0, "gain within which another cause fits as well")
    confounded_share: float = _chosen(0.25, "the same as a share of the cause's own gain")
    nonlinear_spread: float = _chosen(0.12, "prior deviation of a nonlinear parameter, as a share of its range")
    refit_rounds: int = _chosen(3, "alternations between a refit and its noise")
    refit_evaluations: int = _chosen(10, "points that each refit may try")
    refit_settled: float = _chosen(0.1, "move of every size, in its standard error, at which the alternations end")

    # Regimes: a cause is the same in all of them.
    regime_share: float = _chosen(
        0.25, "ratio of a cause's sizes below which two regimes surely disagree, or time steps and free runs do"
    )
    regime_information: float = _chosen(0.02, "share of the information from which on a regime has a size")
    daylight: float = _chosen(20.0, "global radiation in W m-2 above which it is day")
    vents_open: float = _chosen(2.0, "sum of both vents in % from which on they are open")

    # What stands on unseen days.
    most_causes: int = _chosen(3, "causes of one log")
    least_certainty: float = _tuned(2.0, "standard errors that each of several causes measures at least")
    least_effect_to_noise: float = _chosen(0.15, "ENR below which a cause is too small to be named")
    least_skill: float = _chosen(0.01, "share of unseen days' squared error that a cause, or a pattern, must remove")
    clear_skill: float = _tuned(
        0.03, "share that a change, or a further cause, must remove, and that needs no other proof"
    )
    least_actuator_odds: float = _chosen(
        3.0, "log odds that an actuator did what the rules say and did not stand still"
    )

    # What a CO2 sensor must read under open vents.
    wide_open: float = _chosen(100.0, "sum of both vents in % from which on the air is as good as the outdoor air")
    open_rows: int = _chosen(24, "time steps with such vents from which on they tell what the sensor reads")
    open_vents_offset: float = _chosen(80.0, "ppm off the outdoor air that no crop makes under them")
    largest_pattern: float = _chosen(5.0, "bound of a pattern's amplitude in the corrected model, in its units")

    def learns_history(self, days: float) -> bool:
        """Tell whether a calibration log of so many days is to teach what is missing in this greenhouse."""
        return days >= self.least_history_days

    def confounded_within(self, gain: float) -> float:
        """Return how much less than a cause of this gain another may gain that fits as well."""
        return max(self.confounded_gain, self.confounded_share * gain)

    def least_parameter_change(self, *, leads: bool) -> float:
        """Return the share of its value by which a parameter must have changed to be named."""
        return self.least_leading_change if leads else self.least_other_change


def read_rules() -> DecisionRules:
    """Return the rules that came with the trainer."""
    values: dict[str, Any] = {name: float(one["value"]) for name, one in came_with_the_trainer(FILE).items()}
    return DecisionRules(**values)


DEFAULT = read_rules()
