"""A proposed mapping, read and held against what is plausible: what is certain is set right, the rest is said."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.local_time import to_local
from igrow.core.site import Site
from igrow.trainer.data import export
from igrow.trainer.data.fault import DataFault, Remedy
from igrow.trainer.data.importing.proposal import Proposal
from igrow.trainer.data.importing.told_units import BY_SIZE, like_the_others, tenths_like_the_air
from igrow.trainer.data.importing.zone import fixed
from igrow.trainer.data.mapping import ColumnMapping, ExportMapping
from igrow.trainer.data.plausibility import find_faults
from igrow.trainer.data.plausibility.sums import running_sum
from igrow.trainer.data.plausibility.sunlight import CLOCK, noon_is_late
from igrow.trainer.data.rows import Merged
from igrow.trainer.data.timestamps import ZONE

_ROUNDS = 4
"""A remedy may uncover the next fault: a sum that is in another unit as well."""
_CLEARLY = 0.3
"""Hours by which a zone's noon must be nearer than that of a likelier zone."""


@dataclass(frozen=True)
class Checked:
    """A mapping with what was set right in it, and the log that it gives."""

    mapping: ExportMapping
    merged: Merged
    mended: tuple[str, ...]
    faults: tuple[DataFault, ...]
    """What is still wrong."""


def check(proposal: Proposal, site: Site | None) -> Checked:
    """Read the file by its proposed mapping, and set right what is certain.

    Raises:
        IgrowError: a cell is no number or no time.
    """
    mapping = proposal.mapping
    mended: list[str] = []
    applied: set[tuple[str, str]] = set()
    for _ in range(_ROUNDS):
        merged = export.read_tables(proposal.tables, mapping)
        faults = (*merged.faults, *find_faults(merged.telemetry, site))
        better = _on_another_clock(proposal, mapping, faults, site, mended) or _remedied(
            mapping, faults, proposal, merged, mended, applied
        )
        if better is None:
            break
        mapping = better
    return Checked(mapping, merged, tuple(mended), faults)


def _on_another_clock(
    proposal: Proposal, mapping: ExportMapping, faults: Iterable[DataFault], site: Site | None, mended: list[str]
) -> ExportMapping | None:
    """Return the mapping with the time zone under which the sun agrees; a zone that the user gave stays."""
    asked = any(question.about == "time_zone" for question in proposal.questions)
    told = mapping.time.format.endswith(ZONE)
    if site is None or told or not (asked or mapping.time.time_zone == site.time_zone):
        return None
    wrong = [fault for fault in faults if fault.kind in CLOCK]
    if not wrong:
        return None
    best: tuple[float, ExportMapping] | None = None
    for zone in _candidates(site, export.read_tables(proposal.tables, mapping)):
        if zone == mapping.time.time_zone:
            continue
        moved = replace(mapping, time=replace(mapping.time, time_zone=zone))
        merged = export.read_tables(proposal.tables, moved)
        if any(fault.kind in CLOCK for fault in find_faults(merged.telemetry, site)):
            continue
        late = abs(noon_is_late(merged.telemetry, site))
        if best is None or late < best[0] - _CLEARLY:
            best = late, moved
    if best is None:
        return None
    before, after = mapping.time.time_zone, best[1].time.time_zone
    mended.append(f"times are {after}: {wrong[0].sentence} where they are taken for {before}")
    return best[1]


def _candidates(site: Site, merged: Merged) -> list[str]:
    """Return the zones that the times of a site's log may be in."""
    time = merged.telemetry.time[:1]
    zones = [site.time_zone]
    if len(time):
        # Standard time all the year, as many climate computers keep it.
        january = np.array(
            [f"{str(time[0])[:4]}-01-15T12:00:00", f"{str(time[0])[:4]}-07-15T12:00:00"], "datetime64[s]"
        )
        offsets = (to_local(january, site.time_zone) - january).astype(np.int64)
        zones += [fixed(int(offset) // 3600) for offset in sorted(offsets) if offset % 3600 == 0]
    solar = round(site.longitude / 15.0)
    return list(dict.fromkeys([*zones, "UTC", fixed(solar)]))


def _with_remedy(rule: ColumnMapping, remedy: Remedy) -> ColumnMapping:
    amount = rule.amount if remedy.amount == "rate" else remedy.amount
    return replace(
        rule, scale=rule.scale * remedy.scale, offset=rule.offset * remedy.scale + remedy.offset, amount=amount
    )


def _remedied(
    mapping: ExportMapping,
    faults: Sequence[DataFault],
    proposal: Proposal,
    merged: Merged,
    mended: list[str],
    applied: set[tuple[str, str]],
) -> ExportMapping | None:
    """Return the mapping with every certain remedy in it, or None where there is none.

    What the user said of a unit stays. A remedy that did not cure (`applied`, quantity and kind) is not taken twice.
    """
    units = proposal.units
    faults = [one for one in faults if one.quantity not in proposal.given and (one.quantity, one.kind) not in applied]
    applied |= {(one.quantity, one.kind) for one in faults}
    columns: Mapping[str, ColumnMapping] = mapping.columns
    changed = dict(columns)
    fahrenheit = {fault.quantity for fault in faults if fault.kind == "fahrenheit" and not units.get(fault.quantity)}
    american = next((name for name in BY_SIZE if name in fahrenheit), None)
    if american is not None:
        faulty = {one.quantity: "told" for one in faults if one.kind not in ("kilometres_per_hour", "fahrenheit")}
        changed, _, notes = like_the_others(changed, {**units, **faulty}, american)
        mended += notes
    if any(fault.kind == "tenths" and fault.quantity in BY_SIZE for fault in faults):
        table = merged.telemetry
        whole = {name for name in changed if not np.any(np.mod(table[name][np.isfinite(table[name])], 1.0))}
        changed, notes = tenths_like_the_air(changed, units, whole - proposal.given)
        mended += notes
    like_the_air = {name for name, rule in changed.items() if rule != columns[name]}
    for fault in faults:
        if fault.quantity in like_the_air:
            continue
        if fault.kind == "radiation_sum" and changed[fault.quantity].amount == "interval":
            # The unit is told; that it is of the sum, and not of each row, is seen.
            kind = running_sum(merged.telemetry.time, merged.telemetry[fault.quantity])
            assert kind is not None
            changed[fault.quantity] = replace(changed[fault.quantity], amount=kind)
            mended.append(f"{fault.quantity} is a running sum in {units[fault.quantity]}, not an amount a row")
            continue
        if fault.kind == "swapped_columns":
            one, other = fault.quantity.split(", ")
            changed[one], changed[other] = changed[other], changed[one]
        elif fault.remedy is not None and fault.quantity in changed:
            # What is made of its column too, as the lamps' power is of whether they burn.
            column = changed[fault.quantity].column
            changed |= {
                name: _with_remedy(rule, fault.remedy) for name, rule in changed.items() if rule.column == column
            }
        else:
            continue
        choice = " (--unit wind_speed=mph or knots says otherwise)" if fault.kind == "kilometres_per_hour" else ""
        mended.append(fault.sentence + choice)
    return replace(mapping, columns=changed) if changed != dict(columns) else None
