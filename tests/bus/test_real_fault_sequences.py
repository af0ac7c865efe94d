"""A few of the fault sequences over real sockets and in real time, since the simulated loop has no network."""

from __future__ import annotations

import pytest

from tests.bus import test_fault_sequences
from tests.bus.test_fault_sequences import Sequence


@pytest.mark.parametrize("seed", [20, 21, 22, 23])
async def test_the_same_holds_over_sockets(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(test_fault_sequences, "TIMEOUT", 0.03)
    monkeypatch.setattr(test_fault_sequences, "PATIENCE", 0.2)
    monkeypatch.setattr(test_fault_sequences, "REST_STEPS", (0.0,))
    sequence = Sequence(seed)
    await sequence.play()
    assert sequence.values_read > 0
