"""Findings in words: for the grower, and for what would separate confounded causes."""

from __future__ import annotations

from collections.abc import Sequence

from igrow.core.bundle import Estimate
from igrow.core.effects import EFFECTS
from igrow.core.language import N_
from igrow.core.language.units import written
from igrow.core.site import Site
from igrow.trainer.diagnosis.answer.result import DISCREPANCY, Finding, plain
from igrow.trainer.diagnosis.design.candidates import CHANNELS, Pattern
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.search.actuators import Replaced
from igrow.trainer.diagnosis.search.estimate import Estimated, OnsetInterval, normal_quantile
from igrow.trainer.diagnosis.search.parameter_change import ParameterChange
from igrow.trainer.diagnosis.search.scan import Hypothesis
from igrow.trainer.diagnosis.visible_parameters import VISIBLE

NOT_CALIBRATED = N_(
    "What the model misses of this greenhouse when all is well is not known, so only large causes can be told from a "
    "greenhouse that is another: calibrate it on weeks that are known to be good (igrow-trainer calibrate)."
)
IN_TURN = N_(
    "Within more than six weeks a crop changes: they were asked part by part, the oldest first. The errors are of the "
    "newest part."
)
EARLIER = N_(
    "Within more than six weeks a crop changes: they were asked part by part, the oldest first. The newest part does "
    "not tell again what an earlier one has told: look whether it is still so. The errors are of the earlier part."
)
UNREAD = N_("In some of these weeks air or outdoor temperature was hardly read: nothing is told of them.")
WAITING = N_("Something began less than a week ago: what it is, a later log tells.")
NEW_CROP = N_(
    "A new crop was planted since the calibration: what it does otherwise cannot be told from a fault, so that none is "
    "looked for. Calibrate once four weeks of the new crop are there (igrow-trainer calibrate)."
)
GROWN_CROP = N_(
    "Nobody logs the leaf area, and by its usual course the crop has grown since the calibration: what began in its "
    "leaves or in the light is not looked for. Log the leaf area, or calibrate again (igrow-trainer calibrate)."
)
NEW_LEAVES = N_(
    "The leaf area is another than at the calibration by more than three tenths: only what every time step shows is "
    "told. Calibrate again on weeks like these (igrow-trainer calibrate)."
)
VENTS_HARDLY_OPEN = N_(
    "The vents opened less than half as far as in the weeks of the calibration, or hardly at all then: how much air "
    "they let through is not asked. Calibrate again on weeks like these (igrow-trainer calibrate)."
)
THIN_AIR = N_(
    "This greenhouse lies high, and the simulator counts with air as it is at the sea: amounts of CO2, and of heat "
    "that goes with the air, are told too large, by 13 % at 1000 m, 27 % at 2000 m and 43 % at 3000 m."
)
HIGH = 1000.0
"""Metres above the sea from which on that is said."""
SINCE = N_("The errors are of the days since then: before, the greenhouse was another.")
MOVED_BY: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("rail_pipe_temperature", "grow_pipe_temperature"), ("heat",)),
    **dict.fromkeys(("energy_screen", "blackout_screen"), ("heat", "light", "vapour")),
    "lamp_power": ("heat", "light", "co2", "vapour"),
}
"""Balances that an actuator moves; vents move all that the air carries."""
UNLIKE_RULE = 0.15
"""Difference of a share from one at which it is told."""
MOST_TESTS = 3
"""Separating tests that are told at most."""


def thin_air(site: Site) -> tuple[str, ...]:
    """Return what is said of a greenhouse so high that its air is much thinner than the simulator's."""
    return (THIN_AIR,) if site.elevation >= HIGH else ()


def finding(one: Estimated) -> Finding:
    """Return the finding of an estimated cause."""
    effect = EFFECTS[one.effect]
    return Finding(
        one.effect,
        effect.kind,
        tuple(effect.balances),
        {effect.amplitude.name: one.amplitude, **one.shapes},
        one.onset,
        one.hypothesis.p_value,
        one.confounded,
        tuple(effect.drivers),
        separating_test(one.confounded),
        sentence(one),
        one.effect_to_noise,
        one.regimes,
        effect.resembles,
    )


def actuator(one: Replaced) -> Finding:
    """Return the finding of an actuator that the log lacks."""
    name = one.actuator.replace("_", " ")
    share = f"{100.0 * one.share.value:.0f} % of " if abs(one.share.value - 1.0) > UNLIKE_RULE else ""
    told = (
        f"removes {100.0 * one.skill:.0f} % of the squared error on unseen days"
        if one.skill > 0.0
        else "is what the errors ask for, though unseen days are predicted no better with it"
    )
    return Finding(
        one.actuator,
        "actuator",
        MOVED_BY.get(one.actuator, ("heat", "vapour", "co2")),
        {"share": one.share},
        None,
        one.stood_still,
        (one.actuator,),
        (one.actuator,),
        f"log the {name}",
        f"The log lacks the {name}; {share}the course that the climate computer's rules give it {told}.",
        one.effect_to_noise,
    )


def parameter(one: ParameterChange) -> Finding:
    """Return the finding of a parameter that has changed."""
    visible, share = VISIBLE[one.parameter], one.share.value
    told = f"{visible.title}: {100.0 * abs(share):.0f} % {'less' if share < 0.0 else 'more'}"
    text = f"{told[0].upper()}{told[1:]} than at the calibration."
    return Finding(
        one.parameter,
        "parameter",
        visible.balances,
        {"change": one.share},
        one.onset,
        one.p_value,
        one.confounded,
        (one.parameter,),
        visible.check,
        text if one.onset is None else f"Since {_day(one.onset)} {text[0].lower()}{text[1:]}",
    )


def sentence(one: Estimated) -> str:
    """Return the grower's sentence, with the beginning where there is one."""
    effect = EFFECTS[one.effect]
    said, amount = effect.told(one.amplitude.value)
    text = said.format(value=plain(amount), unit=written(effect.amplitude.unit))
    return f"{text[0].upper()}{text[1:]}." if one.onset is None else f"Since {_day(one.onset)} {text}."


def _day(onset: OnsetInterval) -> str:
    time = onset.noon.astype("datetime64[D]").item()
    return f"{time.day} {time:%B}"


def separating_test(confounded: Sequence[str]) -> str:
    """Return the cheapest tests that would separate confounded causes."""
    return "; or ".join(dict.fromkeys(EFFECTS[name].separating_test for name in confounded[:MOST_TESTS]))


def discrepancy(patterns: Sequence[Hypothesis], rules: DecisionRules) -> Finding:
    """Return the finding for what no candidate explains."""
    balances: dict[str, None] = {}
    drivers: dict[str, None] = {}
    parameters: dict[str, Estimate] = {}
    words: list[str] = []
    for one in patterns:
        pattern = one.cause
        assert isinstance(pattern, Pattern)
        channel = CHANNELS[pattern.channel]
        balances |= dict.fromkeys(channel["balances"])
        drivers |= dict.fromkeys(pattern.drivers)
        size = channel["size"]
        reach = normal_quantile(rules) * abs(one.amplitude) / max(one.statistic, 1e-9)
        where = f"{pattern.channel}: {pattern.when}"
        parameters[where] = Estimate.about(size * one.amplitude, size * reach, channel["unit"])
        words.append(f"{channel['name']} ({'more' if one.amplitude > 0 else 'less'}, {pattern.when})")
    return Finding(
        DISCREPANCY,
        "discrepancy",
        tuple(balances),
        parameters,
        None,
        min((one.p_value for one in patterns), default=1.0),
        (DISCREPANCY,),
        tuple(drivers),
        "look at what happens in the greenhouse at these times and in this weather, and write it down for two weeks",
        f"Something that the model does not know changes {'; '.join(words)}.",
    )
