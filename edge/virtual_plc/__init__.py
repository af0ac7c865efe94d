"""A PLC that is not there: a plant behind a Modbus server, for trials, tests and the demo.

`plant` is the boundary to the greenhouse that is controlled, `memory` holds the registers by a register map,
`modbus_server` answers requests, and `virtual_plc` is the PLC's program: it steps the plant at a chosen pace,
publishes the measurements and its clock, watches the heartbeat, and falls back to safe setpoints.
"""
