"""How well simulators do on a log that they have not seen: one bundle beside persistence, or several side by side.

It stands behind fits, diagnosis and bundles, and none of these needs it.
"""
