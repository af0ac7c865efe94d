"""Data sets that the public can fetch, each with its own traps, and the traps that they share."""
