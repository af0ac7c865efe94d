"""What a report says of a fault of the data: what it is, what was seen, and how to mend it."""

from __future__ import annotations

from collections.abc import Mapping

from igrow.core.language import N_, Language
from igrow.trainer.data.fault import DataFault

_FAULTS: Mapping[str, str] = {
    "sensor": N_("A sensor that is needed does not work: {quantity}."),
    "kelvin": N_("Readings are in kelvin: {quantity}."),
    "fahrenheit": N_("Readings are in degrees Fahrenheit: {quantity}."),
    "tenths": N_("Readings are in tenths of a degree: {quantity}."),
    "no_temperature": N_("What is taken for a temperature is none: {quantity}."),
    "fraction": N_("Readings are fractions from 0 to 1 instead of per cent: {quantity}."),
    "percent": N_("Readings are in per cent: {quantity}."),
    "absolute_humidity": N_("What is taken for relative humidity is another humidity: {quantity}."),
    "kilometres_per_hour": N_("Readings are in kilometres per hour: {quantity}."),
    "milligrams": N_("Readings are in milligrams per cubic metre: {quantity}."),
    "dose": N_("What is dosed is in another unit: {quantity}."),
    "radiation_unit": N_("The radiation is in another unit than W/m²."),
    "radiation_sum": N_("The radiation is a running sum."),
    "running_sum": N_("Readings are a running sum: {quantity}."),
    "no_daylight": N_("The radiation does not follow the sun."),
    "clock": N_("The clock of the log disagrees with the sun."),
    "latitude": N_("The days are as long as on the other side of the equator."),
    "local_time": N_("The times are local ones without their time zone."),
    "repeated_times": N_("The same times stand in the log more than once."),
    "shuffled_rows": N_("The times do not belong to the readings."),
    "sparse": N_("There are too few readings for any model."),
    "swapped_columns": N_("Two columns stand in each other's place: {quantity}."),
    "screen_reversed": N_("A screen's 100 % means open, not closed: {quantity}."),
}


def fault(one: DataFault, language: Language) -> tuple[str, str]:
    """Return what a fault of the data is, and what was seen and how to mend it."""
    quantity = language.listed([language.name(name) for name in one.quantity.split(", ")])
    known = _FAULTS.get(one.kind)
    # How to mend it may be a piece of YAML, whose names and numbers stay as they are.
    seen, mend = language.told(one.sentence, language.values), language.told(one.mend)
    return (
        "" if known is None else language.text(known, quantity=quantity),
        f"{seen}: {mend}" if mend else seen,
    )
