"""Tells people of alarms: by e-mail, ntfy, a web hook and whatever else Apprise knows.

`igrow-edge notify` is a process of its own beside the daemon. It asks the daemon for its state as any visitor does, so
that nothing here can hold control: not a mail server that hangs, not a library that crashes. That the daemon does not
answer is an alarm by itself.

- `outbox.py`: which messages are due; no clock, no network. `message.py`: what one says.
- `acknowledged.py`: what people have said that they know.
- `notifier.py`: the loop around them; `services.py`, `sending.py`: the services, each message in a process of its own.
"""
