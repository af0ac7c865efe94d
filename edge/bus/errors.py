"""What can go wrong on a bus, named by what the caller can do about it."""

from __future__ import annotations

from igrow.core.errors import IgrowError

MAY_BE_DONE = (5, 11)
"""Exceptions that leave open what becomes of a write: it takes longer, or the unit behind a gateway was silent."""


class BusError(IgrowError):
    """Any failure to read or write. `sent` tells whether a write may nevertheless have been done."""

    sent = False


class NotConnectedError(BusError):
    """The line is down; it is being reconnected. Nothing was sent: ask again in a later cycle."""


class UnitRestingError(BusError):
    """The unit failed lately and is left alone for a while. Nothing was sent: ask again later."""


class QueueFullError(BusError):
    """More requests wait than the bus can serve. Nothing was sent: poll less."""


class ConnectionLostError(BusError):
    """The line broke under the request. A write may have been done: read before writing again."""

    sent = True


class NoAnswerError(BusError):
    """The unit was silent for the whole timeout. A write may have been done: read before writing again."""

    sent = True


class BadAnswerError(BusError):
    """An answer came that does not fit the question; it was thrown away. A write may have been done."""

    sent = True


class OldAnswerError(BusError):
    """What came may be the answer to an older request, and was thrown away. A write may have been done."""

    sent = True

    def __init__(self, message: str, code: int = 0) -> None:
        super().__init__(message)
        self.code = code
        """Of the exception that came."""


class RefusedError(BusError):
    """The unit answered with an exception: it understood, and did not do it, or (`sent`) does not say so."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code
        self.sent = code in MAY_BE_DONE


class AddressRefusedError(RefusedError):
    """Exception 2 or 3: no such address, or not so many at once. Correct the map, or split the block."""


class UnitBusyError(RefusedError):
    """Exception 5 or 6: the unit has other work. Ask again in a later cycle."""


class GatewayRefusedError(RefusedError):
    """Exception 10 or 11: the gateway cannot reach the unit behind it. Look at the unit and its line."""


class NoValueError(BusError):
    """The unit answered that it has no value at present (a sensor that is off or broken)."""


class TurnedWordsError(NoValueError):
    """The registers hold what tells that they mean something else, such as a number with its words reversed."""

    def __init__(self, message: str, number: float) -> None:
        super().__init__(message)
        self.number = number
        """What they may mean."""


class OtherUnitError(BusError):
    """Another unit answers in place of the one that the map means. What it shows and takes is not the map's."""


class SenselessUnitError(BusError):
    """What the unit shows makes no sense, so neither would what is written. Nothing was sent: correct the map."""


class ValueDoesNotFitError(BusError):
    """The register cannot hold the value. Nothing was sent: correct the value, or the map's type and scale."""


class UnknownPointError(BusError):
    """The register map has no point of this name, or none that can be written. Correct the map."""


EXCEPTION_NAMES = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "device failure",
    5: "acknowledge",
    6: "device busy",
    7: "negative acknowledge",
    8: "memory parity error",
    10: "gateway path unavailable",
    11: "gateway target gave no answer",
}
"""Exception codes of the Modbus Application Protocol V1.1b3, section 7."""


def refusal(what: str, code: int) -> RefusedError:
    """Return the error for an exception answer to the request described by `what`."""
    message = f"{what}: refused with exception {code} ({EXCEPTION_NAMES.get(code, 'unknown')})"
    kinds: dict[int, type[RefusedError]] = {
        2: AddressRefusedError,
        3: AddressRefusedError,
        5: UnitBusyError,
        6: UnitBusyError,
        10: GatewayRefusedError,
        11: GatewayRefusedError,
    }
    return kinds.get(code, RefusedError)(message, code)
