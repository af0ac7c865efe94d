"""Events as a person reads them in the journal: `igrow-edge export` has every detail, this has the sense."""

from __future__ import annotations

import logging
from collections.abc import Mapping

SENTENCES = {
    "started": "started for site {site}",
    "stopped": "stopped: {setpoints}",
    "source": "{now} decides, before it {before}: {why}",
    "plan": "plan from {start} on: {expected_profit} EUR m-2 expected, {recipe_profit} by the recipe ({bundle})",
    "overridden": "{by} has taken {setpoint} for {seconds} s: {value}",
    "recipe_wanted": "{by} wants the recipe instead of plans for {seconds} s",
    "given_back": "{by} has given {setpoint} back",
    "plans_wanted": "{by} lets plans rule again",
    "acknowledged": "{by} knows of the alarm {alarm}",
    "changed_by_hand": "{point} was set to {shown} by hand at the PLC: left alone for {respected_for_seconds} s",
    "hand_no_longer_respected": "{point} is ours again: the change at the PLC has been left alone for long enough",
    "plc_fell_back": "the PLC has put its own safe value in place of our {point}: {shown} instead of {expected}",
    "plc_restarted": "the PLC has started anew: {point} shows {shown} instead of {expected}, and is written again",
    "setpoints_crossed": "{point} shows {shown}, the value of another setpoint: is the register map right?",
    "plc_by_hand": "somebody operates the PLC by hand ({point}): nothing is written but the heartbeat",
    "plc_by_hand_ended": "nobody operates the PLC by hand any more ({point}): control goes on",
    "reloaded": "the configuration was read again from {path}",
    "reload_refused": "the last good configuration stays in force: {reason}",
    "store_repaired": "the log was repaired: {text}",
    "bundle_installed": "bundle {bundle} is the first one in force, from the configuration",
    "bundle_damaged": "bundle {bundle} is damaged and is not used: {reason}",
    "shadow_began": "bundle {bundle} now predicts for {hours} h beside the one in force, and rules nothing",
    "bundle_adopted": "bundle {bundle} is in force: {reason}",
    "bundle_kept": "bundle {bundle} stays in force: no worse than its predecessor in its probation",
    "bundle_rejected": "bundle {bundle} is rejected: {reason}",
    "bundle_went_back": "bundle {bundle} is out of force again, its predecessor rules: {reason}",
    "update_refused": "a bundle was refused: {reason}",
    "update_failed": "the search for new bundles failed: {reason}",
}
"""By kind of event; the places are keys of its detail."""

_log = logging.getLogger("igrow.edge")


def sentence(kind: str, detail: Mapping[str, object]) -> str:
    """Return one line on an event; of a kind without a sentence, or without its details, the plain content."""
    told = {key: _told(value) for key, value in detail.items() if value not in ("", None)}
    try:
        return SENTENCES[kind].format_map(told)
    except KeyError:
        content = ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in told.items())
        return f"{kind.replace('_', ' ')}: {content}" if content else kind.replace("_", " ")


def log_event(kind: str, detail: Mapping[str, object]) -> None:
    """Say an event in the journal."""
    _log.info("%s", sentence(kind, detail))


def _told(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
