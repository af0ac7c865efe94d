"""Readers: from the files that a log comes in to telemetry in the units and names of the registry."""
