"""The register map of a site: which register of which device holds which quantity.

`model` says what a map is, `loading` reads it from YAML, `codec` turns registers into values and back,
`read_planner` gathers points into few requests, and `bus_load` tells how busy a map keeps its buses.
None of them talks to a device.
"""
