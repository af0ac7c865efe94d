"""The search in a design: what has changed or was never known, cause by cause, with its size and its beginning.

`rounds` leads it: `history` says what was to be expected, `scan` scores all columns, `change` decides which stands,
`cross_validation` asks unseen days where time steps tell nothing or not which, `estimate` and `refit` give size,
interval and beginning. Beside them `parameter_change` asks the parameters, `actuators` what the log lacks,
`unexplained` what has no name, and `omission` what the model lacked from the first day.
"""
