"""All points, alarms, source and plan over MQTT, with Home Assistant's discovery.

`igrow-edge mqtt` is a process of its own beside the daemon: it asks the daemon for its state as any visitor does, so a
broker that is down, slow or hostile holds nothing. It only reads, unless `mqtt.permit_override` lets it do what
`igrow-edge override` does: within the guard's limits, for a time that ends by itself.

- `topics.py`: the daemon's state as topics and payloads, and Home Assistant's discovery; no network.
- `commands.py`: what a message from the broker may do.
- `bridge.py`: the connection.
"""
