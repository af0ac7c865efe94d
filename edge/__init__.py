"""The gateway side: a daemon that reads a greenhouse PLC over Modbus, plans, guards and writes setpoints."""
