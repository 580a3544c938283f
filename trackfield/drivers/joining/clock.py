"""How a process that starts elsewhere learns the run's clock from the launcher."""

from __future__ import annotations

import logging
import os
import time
from contextlib import suppress
from threading import Thread
from typing import Final

import msgpack
import zenoh

from trackfield.drivers.exchange.intake import Refusals, read
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.hostclock import AGAIN_S, EXCHANGES, Exchange, HostClock, Reading, better, host_id, reading
from trackfield.drivers.joining.ask import JoinError, ask, ask_once, launcher_in
from trackfield.wire import keys
from trackfield.wire.error import WireError

log = logging.getLogger(__name__)

_NONCE_BYTES: Final = 8


class ClockError(JoinError):
    """The clock here cannot be set well enough for the run."""


def set_clock(session: zenoh.Session, clock: HostClock, seal: Seal, refused: Refusals) -> Reading | None:
    """Set a clock to the run's; None if this is the launcher's host, whose clock needs no setting.

    Raises ``ClockError`` if it would be off by more than the run bears, ``JoinError`` if no launcher answers.
    """
    told = ask(session, keys.CLOCK, _question(), seal, refused)
    with suppress(KeyError, TypeError):
        if told["host"] == host_id() != "":
            clock.set(0)
            return None
    try:
        most_ns = read(_whole, told.get("most_ns"))
        found = measured(session, seal)
    except WireError as error:
        raise JoinError(f"the launcher tells no time: {error}") from None
    if found.uncertainty_ns > most_ns:
        what = f"the clock of this host is known to {found.uncertainty_ns / 1e6:.2f} ms only"
        raise ClockError(f"{what}, and this run bears {most_ns / 1e6:.2f} ms: a slower run (--speed) bears more")
    clock.set(found.offset_ns)
    return found


def keep_clock(session: zenoh.Session, clock: HostClock, seal: Seal, first: Reading) -> None:
    """Measure again every few seconds, for as long as the session is open, in a thread of its own."""

    def keep(last: Reading = first) -> None:
        while True:
            time.sleep(AGAIN_S)
            try:
                last = better(last, measured(session, seal))
            except (JoinError, WireError) as error:
                log.warning("the clock was not set again: %s", error)
                continue
            except zenoh.ZError:
                return  # the session is closed
            clock.set(last.offset_ns)

    Thread(target=keep, name="clock", daemon=True).start()


def measured(session: zenoh.Session, seal: Seal) -> Reading:
    """The offset to the launcher's clock. Raises ``JoinError`` if it does not answer, ``WireError`` for nonsense."""
    launcher, wrong = launcher_in(session, seal), list[WireError]()
    seal = Seal(seal.token)  # a seal of its own remembers what it has seen, and is forgotten with it
    exchanges = []
    for _ in range(EXCHANGES):
        question, left_ns = _question(), time.monotonic_ns()
        if answered := ask_once(session, keys.CLOCK, question, seal, launcher, wrong):
            at_ns = read(_whole, answered.told.get("now_ns"))
            exchanges.append(Exchange(left_ns, at_ns, at_ns, answered.came_ns))
    if not exchanges:
        raise JoinError("the launcher does not tell the time")
    return reading(exchanges)


def _question() -> bytes:
    packed: bytes = msgpack.packb([os.urandom(_NONCE_BYTES)])
    return packed


def _whole(value: object) -> int:
    if type(value) is not int or not 0 <= value < 2**63:
        raise WireError("malformed", "no time in ns")
    return value
