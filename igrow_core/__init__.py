"""What the gateway and the trainer share: quantities, physics, effects, simulator, planner, file formats.

Nothing in here opens a socket, a database or a file except through a path that it is given, and nothing in
here imports torch: the gateway installs this package as it stands.
"""

import os

# onnxruntime collects telemetry from 1.31 on, from the moment that it is imported: a thread, a database in the
# user's cache folder and uploads. A gateway in a greenhouse reports to nobody but its owner.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
