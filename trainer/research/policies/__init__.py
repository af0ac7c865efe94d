"""Learnt policies: soft actor-critic on a bundle's simulator, by stable-baselines3, exported as policy.onnx."""
