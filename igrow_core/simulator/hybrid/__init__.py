"""The default simulator: physical balances, named effects, and a measurement path of its own."""
