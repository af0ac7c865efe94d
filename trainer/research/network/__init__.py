"""The network variant of the simulator: its training on whole seasons, its file, its bundle."""
