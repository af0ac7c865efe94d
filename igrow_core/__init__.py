"""What the gateway and the trainer share: quantities, physics, effects, simulator, planner, file formats.

Nothing in here opens a socket, a database or a file except through a path that it is given, and nothing in
here imports torch: the gateway installs this package as it stands.
"""
