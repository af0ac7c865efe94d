"""What was found, put into the model and kept where it stands on days that no fit has seen; the model to be shipped.

`confirmation` asks a change once more by free runs, `correction` puts causes in, `parameter_or_causes` decides where
both explain the log, `shipping` refits the model that is shipped, and `unseen_errors` says how well each stage does.
"""
