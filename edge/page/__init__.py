"""The grower's page: what is now, is it as wanted, who decides, what comes, what it costs; and the grower's word.

A process of its own beside the daemon (`igrow-edge page`). It asks the daemon for its state as any visitor does,
reads log and overrides on the disk, and does what `igrow-edge override` and `igrow-edge alarms` do. So nothing that
visits the page can hold the control cycle, and the page can say that the daemon is not heard.

`state.py` and `history.py` read; `now.py`, `setpoints.py`, `panels.py`, `plan.py` and `money.py` make of it what is
shown, as pure functions; `svg.py` draws; `templates/` hold the words around it; `server.py` answers, `actions.py` acts,
and `password.py` and `sessions.py` say for whom.
"""
