"""Benchmarks: what is measured side by side, and the tables of the documentation."""
