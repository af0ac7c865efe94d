"""What is made once in a run of the tests is the caller's own, and another's where other things are asked."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.made_once import made_once


@made_once
def squares(count: int, told: Path) -> dict[str, np.ndarray]:
    with told.open("a") as file:
        file.write(f"{count}\n")
    return {"squares": np.arange(count) ** 2}


def test_it_is_made_once_for_the_same_arguments_and_each_has_a_copy(tmp_path: Path) -> None:
    told = tmp_path / "told"
    first = squares(4, told)
    first["squares"][:] = 0
    assert squares(4, told)["squares"].tolist() == [0, 1, 4, 9]
    assert squares(2, told)["squares"].tolist() == [0, 1]
    assert told.read_text() == "4\n2\n"
