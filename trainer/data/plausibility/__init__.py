"""The plausibility gate: faults of a log that no model could tell from physics, each with its mend.

It looks at the table as it was read, before anything is set aside. What it names is so far from any greenhouse that no
weather, crop or defect explains it: a unit, a clock, a column in the wrong place. Whatever may be a greenhouse passes.
"""

from __future__ import annotations

from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.trainer.data.fault import DataFault
from igrow.trainer.data.plausibility import columns, order, sums, sunlight, units
from igrow.trainer.data.plausibility.relations import units_by_relation


def find_faults(telemetry: Telemetry, site: Site | None = None) -> tuple[DataFault, ...]:
    """Return every fault of a table, the coarsest first.

    Args:
        telemetry: as it was read, in the units that it claims.
        site: where the greenhouse stands; without it nothing is said of the sun.
    """
    odd = order.sparse(telemetry) or order.shuffled(telemetry)
    if odd is not None:
        return (odd,)
    wrong = units.wrong_units(telemetry)
    by_size = {fault.quantity for fault in wrong}
    swapped = columns.swapped(telemetry, site, by_size)
    wrong += [fault for fault in units_by_relation(telemetry, site) if fault.quantity not in by_size]
    taken = {name for fault in swapped for name in fault.quantity.split(", ")}
    found = [*swapped, *(fault for fault in wrong if fault.quantity not in taken), *sums.summed_rates(telemetry)]
    if site is not None:
        found += sunlight.against_the_sun(telemetry, site)
        # On a clock that is wrong, day and night are.
        if not any(fault.kind in sunlight.SUN for fault in found):
            found += columns.screens_reversed(telemetry, site)
    return tuple(found)
