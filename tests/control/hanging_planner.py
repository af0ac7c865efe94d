"""A planner that never comes back."""

import time


def make_plan(site, request):
    while True:
        time.sleep(3600.0)
