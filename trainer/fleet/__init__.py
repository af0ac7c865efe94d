"""Many sites by the same code as one: a registry, independent tasks, and one page that says who needs attention.

`registry.py` reads the folder of sites; `work.py` says what a task does for one site, with `igrow.trainer.service`;
`runner.py` has tasks done, here or on a Ray cluster; each runs in a child process with limits of time and memory
(`worker.py`), so that one site's failure is a line of its own history and nothing else. `overview.py` and `page.py`
show the fleet.
"""
