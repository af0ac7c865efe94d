"""Which separating tests a site can run, and what stands against the others; known before anything is moved."""

from __future__ import annotations

from collections.abc import Mapping

from igrow.core.quantities import with_unit
from igrow.core.separating_tests import SEPARATING_TESTS, Condition, SeparatingTest, climate_conditions
from igrow.core.site import Site
from igrow.edge.configuration import Configuration

NOT_PERMITTED = "separating tests are not permitted here: the daemon's file says so (separating_tests: permitted)"


def obstacles(configuration: Configuration) -> dict[str, str]:
    """Return for every test an empty text where this site can run it, else one line on what stands against it."""
    if not configuration.file.separating_tests.permitted:
        return dict.fromkeys(SEPARATING_TESTS, NOT_PERMITTED)
    return {name: _obstacle(configuration, test) for name, test in SEPARATING_TESTS.items()}


def possible(configuration: Configuration) -> Mapping[str, SeparatingTest]:
    """Return the tests that this site can run, by name."""
    return {name: SEPARATING_TESTS[name] for name, obstacle in obstacles(configuration).items() if not obstacle}


def conditions_of(test: SeparatingTest, site: Site) -> tuple[Condition, ...]:
    """Return a test's own conditions, and those of the site's crop."""
    crop = site.crop
    return (
        *test.conditions,
        *climate_conditions(crop.temperature_low, crop.temperature_high, crop.humidity_high),
    )


def _obstacle(configuration: Configuration, test: SeparatingTest) -> str:
    points, rules = configuration.register_map.points, configuration.guard_rules.points
    for name in test.points:
        rule = rules.get(name)
        if rule is None:
            return f"the gateway does not write {name} (a writable point of the register map under guard: points)"
        if not rule.decided and rule.refresh is None:
            # Were the gateway to die, the vents would stay where a test has put them.
            return f"{name} does not go back to the PLC by itself: its point of the register map has no refresh"
        low, high = test.span(name)
        if low < rule.low or high > rule.high:
            span, limits = ([with_unit(name, one) for one in pair] for pair in ((low, high), (rule.low, rule.high)))
            return f"it moves {name} from {span[0]} to {span[1]}, the limits are {limits[0]} to {limits[1]}"
    for condition in conditions_of(test, configuration.site):
        if condition.quantity not in points and not condition.if_measured:
            return f"it needs {condition.quantity}, which this plant does not measure"
    return ""
