"""From fitted model to bundle: traces the shared formulas into ONNX blocks and puts the graphs together."""

from igrow.trainer.exporting.bundle import export, read_model

__all__ = ["export", "read_model"]
