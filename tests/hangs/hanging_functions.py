"""What the process for graphs is given to run in these tests."""

from igrow.edge.planning.forecast import forecast_in_time


def nothing(*_: object) -> None:
    pass


def wait_for_the_forecast(site, request) -> None:
    members, problem = forecast_in_time(request.forecast)
    assert not members
    raise AssertionError(problem)
