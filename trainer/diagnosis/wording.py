"""Findings in words: for the grower, and for what would separate the rivals."""

from __future__ import annotations

from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis.adequacy import Adequacy
from igrow.trainer.diagnosis.drivers import BALANCES_OF, UNIT_FLUX, Pattern
from igrow.trainer.diagnosis.estimate import Estimated
from igrow.trainer.diagnosis.result import Finding, Interval

UNITS = {"heat": "W m-2", "vapour": "kg m-2 s-1", "co2": "kg m-2 s-1", "air_exchange": "m s-1", "light_loss": "1"}
NAMES = {
    "heat": "heat",
    "vapour": "water vapour",
    "co2": "CO2",
    "air_exchange": "air exchange",
    "light_loss": "loss of light",
}


def finding(one: Estimated) -> Finding:
    """Return the finding of an estimated term."""
    effect = EFFECTS[one.effect]
    parameters = {effect.amplitude.name: one.amplitude, **one.shapes}
    return Finding(
        one.effect,
        effect.kind,
        tuple(effect.balances),
        parameters,
        one.onset,
        one.hypothesis.p_value,
        one.rivals,
        tuple(effect.drivers),
        separating_test(one.rivals),
        sentence(one),
        one.effect_to_noise,
        one.regimes,
    )


def sentence(one: Estimated) -> str:
    """Return the grower's sentence, with the beginning where there is one."""
    effect = EFFECTS[one.effect]
    text = effect.sentence.format(value=plain(one.amplitude.value), unit=effect.amplitude.unit)
    if one.onset is not None:
        time = one.onset.time.astype("datetime64[D]").item()
        return f"Since {time.day} {time:%B} {text}."
    return f"{text[0].upper()}{text[1:]}."


def plain(value: float) -> str:
    """Return a number with two significant digits, as people write it."""
    rounded = float(f"{value:.2g}")
    return f"{rounded:.0f}" if abs(rounded) >= 10.0 else f"{rounded:.10f}".rstrip("0").rstrip(".")


def separating_test(rivals: tuple[str, ...]) -> str:
    """Return the cheapest tests that would tell rivals apart."""
    if len(rivals) == 1:
        return EFFECTS[rivals[0]].separating_test
    return "; or ".join(dict.fromkeys(EFFECTS[name].separating_test for name in rivals[:3]))


def remainder(judged: Adequacy) -> Finding:
    """Return the finding for what no candidate explains."""
    assert judged.remainder is not None
    balances: dict[str, None] = {}
    drivers: dict[str, None] = {}
    parameters: dict[str, Interval] = {}
    words: list[str] = []
    for one in judged.remainder:
        pattern = one.cause
        assert isinstance(pattern, Pattern)
        balances |= dict.fromkeys(BALANCES_OF[pattern.channel])
        drivers |= dict.fromkeys(pattern.drivers)
        size = UNIT_FLUX[pattern.channel]
        deviation = abs(one.amplitude) / max(one.statistic, 1e-9)
        low, high = (size * (one.amplitude + side * 1.645 * deviation) for side in (-1.0, 1.0))
        parameters[f"{pattern.channel}: {pattern.when}"] = Interval(
            size * one.amplitude, low, high, UNITS[pattern.channel]
        )
        words.append(f"{NAMES[pattern.channel]} ({'more' if one.amplitude > 0 else 'less'}, {pattern.when})")
    return Finding(
        "remainder",
        "remainder",
        tuple(balances),
        parameters,
        None,
        min((one.p_value for one in judged.remainder), default=1.0),
        ("remainder",),
        tuple(drivers),
        "look at what happens in the house at these times and in this weather, and write it down for two weeks",
        f"Something that the model does not know changes {'; '.join(words)}.",
    )
