"""The way to the registers: one bus, one request at a time, every answer checked.

`protocol` is the boundary. `modbus_bus` puts together the parts: `request_slot` (whose turn it is),
`pacing` (gaps), `unit_health` (who rests), `connect_supervisor` (is the line there), `answer_check` (is
this the answer to what we asked), `owed` (could it be the answer to something older), and `pymodbus_link`, which
with `serial_port` is all that knows pymodbus' client side.
`plc` is what the control cycle sees: values by name.
"""
