"""What a diagnosis says to a grower, sentence by sentence, in any language."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from importlib.resources import files

import numpy as np
import yaml

from igrow.core.effects import EFFECTS, Effect
from igrow.core.language import N_, Language
from igrow.core.quantities import QUANTITIES
from igrow.core.simulator.hybrid.measurement import PREDICTED
from igrow.trainer.data.fault import DataFault
from igrow.trainer.diagnosis.answer.result import DISCREPANCY, WORSE, Diagnosis, Finding
from igrow.trainer.diagnosis.design.candidates import WEEKDAYS
from igrow.trainer.diagnosis.visible_parameters import VISIBLE
from igrow.trainer.fit.omission import Omission
from igrow.trainer.report.worth import Worth

TEXTS: Mapping[str, Mapping[str, str]] = yaml.safe_load(
    files("igrow.trainer.report").joinpath("texts.yaml").read_text(encoding="utf-8")
)
_MORE, _LESS = N_("{channel}: more, {when}"), N_("{channel}: less, {when}")
_HOURS = re.compile(r"(?:(?P<before>.+), )?(?P<first>\d\d) to (?P<last>\d\d) h(?: (?P<after>on .+))?")
_LEAST = {"heat": 0.05, "co2": 0.001, "lamp_light": 0.02}
"""MJ, kg and kWh per m2 and week from which on they are told."""


def fault(one: DataFault, language: Language) -> tuple[str, str]:
    """Return what a fault of the data is, and what was seen and how to mend it."""
    known = TEXTS["faults"].get(one.kind)
    quantity = language.listed([language.name(name) for name in one.quantity.split(", ")])
    # How to mend it may be a piece of YAML, whose names and numbers stay as they are.
    seen, mend = language.told(one.sentence, language.values), language.told(one.mend)
    return "" if known is None else language.text(known, quantity=quantity), f"{seen}: {mend}" if mend else seen


def cause(finding: Finding, language: Language) -> str:
    """Return what a finding says, with its size and its beginning."""
    if finding.effect == DISCREPANCY:
        parts = [when(name, one.value, language) for name, one in finding.parameters.items()]
        return language.text("Something that the model does not know changes these: {parts}.", parts="; ".join(parts))
    if finding.kind == "parameter":
        share = finding.parameters["change"].value
        text = TEXTS["changes"]["less" if share < 0.0 else "more"]
        told = language.text(text, parameter=title(finding.effect, language), share=language.number(100.0 * abs(share)))
        return _since(finding, told, language)
    if finding.effect not in EFFECTS:
        text = N_(
            "The log lacks this: {quantity}. What the climate computer's rules make of it explains much of the error."
        )
        return language.text(text, quantity=language.name(finding.effect))
    effect = EFFECTS[finding.effect]
    size = finding.parameters[effect.amplitude.name]
    return _since(finding, _told(effect, size.value, size.unit, language), language)


def _since(finding: Finding, told: str, language: Language) -> str:
    if finding.onset is not None:
        return language.text("Since {day}: {told}.", day=language.day(finding.onset.noon), told=told)
    return language.text("{told}.", told=f"{told[0].upper()}{told[1:]}")


def _told(effect: Effect, size: float, unit: str, language: Language) -> str:
    """Return an effect's sentence with its size, in the units of the site as far as people there have others."""
    sentence, amount = effect.told(size)
    return language.sized(sentence, amount, unit)


def omission(one: Omission, language: Language, *, completed: bool) -> list[str]:
    """Return what a model lacked from its first day, what weeks that no fit saw say of it, and what became of it."""
    told = []
    for found in one.effects:
        effect = EFFECTS[found.name]
        size = found.parameters[effect.amplitude.name]
        told.append(_told(effect, size.value, size.unit, language))
    lines = [language.text("The log of the calibration says what the model lacks: {told}.", told="; ".join(told))]
    for error in one.errors:
        if error.horizon == "24_h":
            unit = QUANTITIES[error.quantity].difference_unit
            lines.append(
                language.text(
                    "{quantity}: without it {before}, with it {after} off a day ahead, in weeks that no fit saw.",
                    quantity=language.name(error.quantity),
                    before=language.amount(error.before, unit),
                    after=language.amount(error.after, unit),
                )
            )
    added = N_("It is in the bundle now.")
    left = N_("It is not in the bundle: check it in the greenhouse, or add it with --complete.")
    return [*lines, language.text(added if completed else left)]


def when(pattern: str, amount: float, language: Language) -> str:
    """Return what changes, and when, of a pattern ("air_exchange: 07 to 16 h on working days")."""
    channel, _, course = pattern.partition(": ")
    return language.text(_MORE if amount > 0 else _LESS, channel=language.name(channel), when=_course(course, language))


def _course(course: str, language: Language) -> str:
    found = _HOURS.fullmatch(course)
    if found is None:
        day = course.removeprefix("on ").removesuffix("s")
        if day in WEEKDAYS:
            name = language.locale.weekdays[WEEKDAYS.index(day)]
            return language.text("on {weekday}", weekday=name)
        told = TEXTS["when"].get(course)
        return course if told is None else language.text(told)
    hours = language.text("{first} to {last} h", first=found["first"], last=found["last"])
    parts = [_course(found["before"], language)] if found["before"] else []
    parts.append(hours)
    parts += [_course(found["after"], language)] if found["after"] else []
    return language.listed(parts)


def rivals(finding: Finding, language: Language) -> list[str]:
    """Return a sentence for each cause that is confounded with a finding in this log."""
    text = N_("It may as well be {cause}: in this log they cannot be told apart.")
    others = [name for name in finding.confounded if name != finding.effect and name in {*EFFECTS, *VISIBLE}]
    return [language.text(text, cause=title(name, language)) for name in others]


def title(cause: str, language: Language) -> str:
    """Return what people call an effect, a parameter that has changed, or an actuator that a log lacks."""
    if cause in EFFECTS:
        return language.text(EFFECTS[cause].title)
    return language.text(VISIBLE[cause].title) if cause in VISIBLE else language.name(cause)


def checks(finding: Finding, language: Language) -> list[str]:
    """Return what to check in the greenhouse tomorrow, the cheapest test of each cause that may be it."""
    if finding.kind == "actuator":
        return [language.text("Have it written into the log: {quantity}.", quantity=language.name(finding.effect))]
    tests = [EFFECTS[name].separating_test for name in (finding.effect, *finding.confounded) if name in EFFECTS]
    if finding.kind == "parameter":
        tests = [VISIBLE[name].check for name in finding.confounded]
    if not tests:
        tests = [N_("look at what happens in the greenhouse at these times and in this weather, and write it down")]
    return [_whole(language.in_units(language.text(one)), language) for one in dict.fromkeys(tests)]


def signature(finding: Finding, language: Language) -> str:
    """Return how an effect shows in the log; empty for what is none."""
    return _whole(language.text(EFFECTS[finding.effect].signature), language) if finding.effect in EFFECTS else ""


def _whole(told: str, language: Language) -> str:
    """Return words as a sentence of their own."""
    return f"{told[0].upper()}{told[1:]}." if language.code != "zh" else f"{told}。"


def costs(finding: Finding, one: Worth | None, area: float, language: Language) -> list[str]:
    """Return what a cause takes or saves in a week, for a greenhouse of so many m2."""
    told: list[str] = []
    if one is None:
        return told
    number, area_unit = language.number, language.shown("m2")
    # What is of a m2 is of so much less in a smaller unit.
    share = 1.0 / area_unit.of(1.0)

    def tell(what: str, amount: float, **sizes: str) -> None:
        """Say what is taken, or saved where the amount is negative."""
        text = TEXTS["costs"][f"{what} {'saved' if amount < 0.0 else 'taken'}"]
        told.append(language.text(text, area=area_unit.unit, **sizes))

    if abs(one.heat) >= _LEAST["heat"]:
        size = share * abs(one.heat)
        tell("heat", one.heat, heat=language.amount(size, "MJ"), kwh=number(size / 3.6))
        if finding.effect in EFFECTS and "air_temperature" in EFFECTS[finding.effect].measured:
            tell("heat by a sensor", one.heat)
    if abs(one.co2) >= _LEAST["co2"]:
        tell("co2", one.co2, co2=language.amount(1000.0 * share * abs(one.co2), "g"))
    if abs(one.lamp_light) >= _LEAST["lamp_light"]:
        tell("light", abs(one.lamp_light), kwh=number(share * one.lamp_light))
    if not told:
        nothing = TEXTS["costs"]["nothing"]
        return [language.text(nothing)]
    tell("money", one.money, money=number(share * abs(one.money)), all=number(abs(one.money) * area))
    if one.spread is not None:
        low, high = map(number, one.spread)
        text = TEXTS["costs"]["spread"]
        told.append(language.text(text, low=low, high=high))
    return told


def gains(result: Diagnosis, language: Language) -> Iterator[str]:
    """Say what correction does to the error a day ahead, and where it makes it worse."""
    for quantity, horizons in result.errors.items():
        day = horizons.get("24_h", {})
        if not {"deployed", "corrected"} <= day.keys():
            continue
        unit = QUANTITIES[quantity].difference_unit
        before, after = (language.amount(day[stage], unit, 3) for stage in ("deployed", "corrected"))
        text = TEXTS["gains"]["better" if day["corrected"] <= day["deployed"] else "worse"]
        name = language.name(quantity)
        yield language.text(text, quantity=f"{name[0].upper()}{name[1:]}", before=before, after=after)
        alone = day.get("recalibrated", np.inf)
        if result.findings and (1.0 + WORSE) * alone < day["corrected"] <= day["deployed"]:
            yield language.text(
                "{quantity}: recalibration alone would be better, off by {best}.",
                quantity=f"{name[0].upper()}{name[1:]}",
                best=language.amount(alone, unit, 3),
            )


def warnings(result: Diagnosis, language: Language) -> Iterator[str]:
    """Say which quantities the model predicts no better than yesterday's readings, and what could not be judged."""
    for one in result.misfits:
        unit = QUANTITIES[one.quantity].difference_unit
        yield language.text(
            "The model does not fit {quantity}: a day ahead it is off by {error}, yesterday's readings by {yesterday}.",
            quantity=language.name(one.quantity),
            error=language.amount(one.error, unit, 3),
            yesterday=language.amount(one.persistence, unit, 3),
        )
    yield from _unjudged(result, language)


def _unjudged(result: Diagnosis, language: Language) -> Iterator[str]:
    log = result.log
    if log is None or result.verdict == "data_fault":
        return
    dosing = log.known_site.greenhouse.co2_dosing_capacity > 0.0
    for quantity in PREDICTED:
        if quantity in result.errors:
            continue
        if quantity not in log.telemetry or not np.isfinite(log.telemetry[quantity]).any():
            why = "set aside" if any(one.quantity == quantity for one in log.screened) else "lacking"
        else:
            why = "undosed" if quantity == "air_co2" and dosing and "co2_dosing" in result.missing else "not whole"
        text = TEXTS["unjudged"][why]
        yield language.text(text, quantity=language.name(quantity))


def set_aside(result: Diagnosis, language: Language) -> Iterator[str]:
    """Say what was set aside, a sentence for each quantity and reason."""
    groups: dict[tuple[str, str], list[float]] = {}
    for one in result.screened:
        hours = (one.end - one.start).astype("timedelta64[s]").astype(np.float64) / 3600.0
        groups.setdefault((one.quantity, one.reason), []).append(float(hours))
    for (quantity, reason), stretches in groups.items():
        yield language.text(
            "{quantity}: {reason}, {count} ×, {hours} h in all.",
            quantity=language.name(quantity),
            count=len(stretches),
            hours=language.number(max(sum(stretches), 0.1), 3),
            reason=language.name(reason),
        )


def notes(result: Diagnosis, language: Language) -> Iterator[str]:
    """Yield the notes of a diagnosis."""
    for note in result.notes:
        told = language.told(note, language.values)
        yield f"{told[0].upper()}{told[1:]}"
