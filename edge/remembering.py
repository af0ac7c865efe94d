"""What a restart must not forget, on its way into the ledger and back: noted before each write, and now and then."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from igrow.edge.cycle import ControlCycle
from igrow.edge.image import Image
from igrow.edge.moment import Moment, from_json, to_json
from igrow.edge.ports import Store
from igrow.edge.registers.model import RegisterMap

NOTE_AGAIN = 600.0
"""Seconds after which the same is noted again, so that a start knows within that how long nobody was there."""


class StateNotes:
    """Notes the state of control whenever it has changed."""

    def __init__(self, store: Store, boot: str, registers: Mapping[str, str]) -> None:
        """`boot` names this start of the machine, `registers` which register each point is (`registers_of`)."""
        self._store = store
        self._boot = boot
        self._registers = dict(registers)
        self._noted: Mapping[str, object] = {}
        self._noted_at = float("-inf")

    def keep(self, image: Image, content: Mapping[str, object]) -> None:
        """Note the state before anything of it is carried out."""
        if content == self._noted and image.monotonic - self._noted_at < NOTE_AGAIN:
            return
        self._noted, self._noted_at = content, image.monotonic
        now = Moment(self._boot, image.monotonic, image.true_time)
        entry = {**content, "registers": self._registers, "at": to_json(now)}
        self._store.record_state(image.true_time, entry)

    def recall(
        self, cycle: ControlCycle, content: Mapping[str, object] | None, now: Moment, *, respect_hand: float
    ) -> float | None:
        """Give back to `cycle` what the process before this one noted; None is nothing.

        Returns what time it is by the clock of the ledger, in seconds since 1970 UTC; None where that is not known.
        Where nobody knows how long it is ago, no interval counts as over and no hand as respected for long enough.
        """
        then = None if content is None else from_json(content.get("at"))
        if content is None or then is None:
            return now.time
        passed = now.since(then)
        known = content.get("registers")
        same = {n for n, r in self._registers.items() if isinstance(known, Mapping) and known.get(n) == r}
        later = now.monotonic - then.monotonic - (passed or 0.0)
        cycle.recall(content, later, same=same, agree=passed is None or passed <= respect_hand)
        return None if passed is None or then.time is None else then.time + passed


def registers_of(register_map: RegisterMap, names: Iterable[str]) -> dict[str, str]:
    """Return for each of these points what tells its register from another."""
    registers = {}
    for name in names:
        point = register_map.points[name]
        device = register_map.devices[point.device]
        place = (device.bus, device.device_id, point.function.value, point.address, point.bit)
        form = (point.type.value, point.order.value, point.scale, point.offset)
        registers[name] = " ".join(map(str, (*place, *form)))
    return registers
