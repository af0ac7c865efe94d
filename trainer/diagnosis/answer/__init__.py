"""What a diagnosis says: findings and errors, in words, figures and JSON.

`result` is the diagnosis, `evidence` what it rests on, `wording` its sentences, `plots` its figures; `answers` joins
those of the parts of a long log, and `uncalibrated` says what comes first where the model is of no greenhouse.
"""
