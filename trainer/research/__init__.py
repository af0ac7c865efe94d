"""Apart from the product's road: what reproduces the paper, and what no bundle carries. The product needs none of it.

`paper/` computes the published tables again; `network/` is the paper's variant of the simulator; `policies/` learns by
stable-baselines3's soft actor-critic (extra `research`).
"""
