"""Time as a test wants it."""

from __future__ import annotations


class FakeClock:
    """A clock that tests move by hand. `wall` None plays a clock that cannot be trusted."""

    def __init__(self, monotonic: float = 0.0, wall: float | None = 1_700_000_000.0) -> None:
        self.now = monotonic
        self.wall = wall
        self.doubt = ""

    def recall(self, known: float | None) -> None:
        """Take no note."""

    def witness(self, other: float) -> None:
        """Take no note."""

    def advance(self, seconds: float) -> None:
        """Move both clocks."""
        self.now += seconds
        if self.wall is not None:
            self.wall += seconds

    def monotonic(self) -> float:
        """Return the fake monotonic seconds."""
        return self.now

    def true_time(self) -> float | None:
        """Return the fake UTC seconds."""
        return self.wall
