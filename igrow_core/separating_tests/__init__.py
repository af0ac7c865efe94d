"""Separating tests: small movements of the plant that tell causes apart; `SEPARATING_TESTS` holds them by name."""

from igrow.core.separating_tests.catalogue import SEPARATING_TESTS, separating_tests_for
from igrow.core.separating_tests.definition import SOURCE, Condition, SeparatingTest, Stage, climate_conditions

__all__ = [
    "SEPARATING_TESTS",
    "SOURCE",
    "Condition",
    "SeparatingTest",
    "Stage",
    "climate_conditions",
    "separating_tests_for",
]
