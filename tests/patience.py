"""How long tests wait for what has to come."""

PATIENCE = 900.0
"""Seconds that only say when a test has failed: a machine with other work needs minutes for what takes one second."""
