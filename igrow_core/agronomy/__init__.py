"""What a crop must be given and must be spared, whatever it would earn: limits, not prices.

The limits themselves are the site's (`igrow.core.site.Agronomy`), each with its unit and its source.

moment    what the calendar and the sun say of an instant: night, local day, working hours
memory    what has stood in the greenhouse so far, as far as limits count it
hold      the nearest setpoints that leave no limit, and the limits that stood in the way

The search decodes its candidates through `hold`, hour by hour, and the guard holds each decision by the same function,
so that no plan leaves a limit, and what leads in place of a plan does not either.
"""

from igrow.core.agronomy.hold import NO_SUN, Held, SunToCome, hold, sun_to_come
from igrow.core.agronomy.memory import Memory, observe, one_of, remember
from igrow.core.agronomy.moment import Moment, Place, moment

__all__ = [
    "NO_SUN",
    "Held",
    "Memory",
    "Moment",
    "Place",
    "SunToCome",
    "hold",
    "moment",
    "observe",
    "one_of",
    "remember",
    "sun_to_come",
]
