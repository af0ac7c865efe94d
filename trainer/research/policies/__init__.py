"""Learnt policies: soft actor-critic on batches of mechanistic greenhouses, exported as policy.onnx."""
