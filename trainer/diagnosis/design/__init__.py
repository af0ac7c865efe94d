"""The design of a log: its errors along free runs, and how they depend on all that may be missing.

`sensitivity` runs the model day by day, `candidates` lists effects and patterns, `amplitudes` how large they may be
(`possible_air`: by what air there is), `balances` which errors count; `design` lays all that out in named columns,
`noise` whitens them, `linear` fits them. `freerun` has the days of a log, and models that are fitted to some of them
and judged on others.
"""
