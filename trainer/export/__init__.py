"""From fitted simulator to bundle: traces the shared formulas into ONNX blocks and puts the graphs together."""
