"""What tables of setpoints hold of those that not every climate computer takes."""

from __future__ import annotations

OPTIONAL = (85.0, 24.0, 0.0, 100.0)
"""Humidity in %, ventilation and minimum pipe in degC, closure of the energy screen in %, in the registry's order."""
