"""The trainer side: learns the simulator from logs, finds what it lacks, and publishes the corrected one.

    from igrow.trainer import calibrate, diagnose, export, publish, read_log

    log = read_log("export.csv", "site.yaml")           # any source; log.notes say what was set aside
    model = calibrate(log)                              # a fitted model with its covariance
    result = diagnose(later, model)                     # of a later log: result.summary(), result.findings
    bundle = export(result.corrected, "out/bundle")     # what a gateway runs
    publish(bundle, "/srv/igrow", "keys")               # signed, into the exchange

    compare([model, result.corrected], newest)          # simulators side by side on a log that none has seen

Every command, benchmark and service goes this road. Names are imported when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from igrow import __version__

if TYPE_CHECKING:
    from igrow.trainer.calibration import calibrate
    from igrow.trainer.data import Log, prepare_log, read_log
    from igrow.trainer.diagnosis import diagnose
    from igrow.trainer.exporting import export, read_model
    from igrow.trainer.fit import FittedModel
    from igrow.trainer.publishing import publish
    from igrow.trainer.scoring.comparison import Comparison, compare

_PLACES = {
    "calibration": ("calibrate",),
    "data": ("Log", "prepare_log", "read_log"),
    "diagnosis": ("diagnose",),
    "exporting": ("export", "read_model"),
    "fit": ("FittedModel",),
    "publishing": ("publish",),
    "scoring.comparison": ("Comparison", "compare"),
}

__all__ = [
    "Comparison",
    "FittedModel",
    "Log",
    "__version__",
    "calibrate",
    "compare",
    "diagnose",
    "export",
    "prepare_log",
    "publish",
    "read_log",
    "read_model",
]


def __getattr__(name: str) -> Any:
    """Import one of the road's names when it is first used: torch, onnx and pandas are slow to load."""
    for place, names in _PLACES.items():
        if name in names:
            return getattr(import_module(f"igrow.trainer.{place}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """List the road's names."""
    return sorted(__all__)
