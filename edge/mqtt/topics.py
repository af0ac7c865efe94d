"""The daemon's state as MQTT topics and payloads, and what Home Assistant's discovery wants to know of them.

Topics: PREFIX/SITE/state (one JSON object), PREFIX/SITE/available (online or offline, the broker's last will), and
PREFIX/SITE/set/SETPOINT for commands. Discovery: DISCOVERY/sensor/igrow_SITE/NAME/config, retained.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from igrow import __version__
from igrow.core.quantities import QUANTITIES

_UNITS = {"degC": "°C", "W m-2": "W/m²", "m s-1": "m/s", "deg": "°", "1": None}
_CLASSES = {"degC": "temperature", "ppm": "carbon_dioxide", "m s-1": "wind_speed", "W m-2": "irradiance"}


def base(prefix: str, site: str) -> str:
    """Return what every topic of a site begins with."""
    return f"{prefix}/{site}"


def state_payload(state: Mapping[str, Any]) -> str:
    """Return the published state: values by point, setpoints, source, alarms, plan."""
    plan = state.get("plan") or {}
    return json.dumps(
        {
            "time": state["time"],
            "link_ok": state["link_ok"],
            "source": state["source"],
            "why": state["why"],
            "values": {name: value["value"] for name, value in state["values"].items() if value["quality"] == "good"},
            "setpoints": {name: setpoint["shown"] for name, setpoint in state["setpoints"].items()},
            "alarms": [
                {"name": alarm["name"], "text": alarm["text"], "level": alarm["level"]} for alarm in state["alarms"]
            ],
            "plan": {key: plan.get(key) for key in ("start", "valid_until", "expected_profit", "recipe_profit")},
        },
        allow_nan=False,
    )


def discovery(
    prefix: str,
    discovery_prefix: str,
    site: str,
    points: Sequence[str],
    commands: Mapping[str, tuple[float, float, float]],
) -> Iterator[tuple[str, str]]:
    """Yield topic and payload of each retained discovery message.

    Args:
        prefix: first part of our topics.
        discovery_prefix: Home Assistant's.
        site: the site's short name.
        points: names of what is measured.
        commands: by setpoint that may be overridden its low, high and step.
    """
    at = base(prefix, site)
    shared = {
        "availability_topic": f"{at}/available",
        "state_topic": f"{at}/state",
        "device": {"identifiers": [f"igrow_{site}"], "name": site, "manufacturer": "igrow", "sw_version": __version__},
    }

    def message(component: str, name: str, template: str, **more: object) -> tuple[str, str]:
        content = {
            **shared,
            "name": name.replace("_", " "),
            "unique_id": f"igrow_{site}_{name}",
            "object_id": f"{site}_{name}",
            "value_template": template,
            **{key: value for key, value in more.items() if value is not None},
        }
        return f"{discovery_prefix}/{component}/igrow_{site}/{name}/config", json.dumps(content)

    for name in points:
        yield message("sensor", name, _of("values", name), state_class="measurement", **_unit(name))
    yield message("sensor", "source", "{{ value_json.source }}")
    yield message("sensor", "alarms", "{{ value_json.alarms | count }}", state_class="measurement")
    yield message("binary_sensor", "plc", "{{ 'ON' if value_json.link_ok else 'OFF' }}", device_class="connectivity")
    for name, (low, high, step) in commands.items():
        unit = {key: value for key, value in _unit(name).items() if key == "unit_of_measurement"}
        yield message(
            "number",
            name,
            _of("setpoints", name),
            command_topic=f"{at}/set/{name}",
            min=low,
            max=high,
            step=step,
            **unit,
        )


def _of(group: str, name: str) -> str:
    return f"{{{{ value_json.{group}.get('{name}') }}}}"


def _unit(name: str) -> dict[str, object]:
    unit = QUANTITIES[name].unit if name in QUANTITIES else "1"
    return {"unit_of_measurement": _UNITS.get(unit, unit), "device_class": _CLASSES.get(unit)}
