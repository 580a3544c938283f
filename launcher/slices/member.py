"""What the processes of a slice run: they are forked as those of a launcher are, and join as those started by hand."""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping

import zenoh
from setproctitle import getproctitle, setproctitle

from launcher.processes.rehearsal import a_node
from trackfield.drivers.exchange.intake import Refusals
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.hostclock import HostClock
from trackfield.drivers.joining.ask import JoinError
from trackfield.drivers.joining.claim import claim
from trackfield.drivers.process import Process
from trackfield.drivers.session import NODE_RUNTIME, open_session
from trackfield.drivers.standalone import TRIES, TakenError, take_place
from trackfield.plugins import give


def live(
    settings: str,
    role: str,
    place: str,
    niceness: int,
    factory: str,
    places: Mapping[str, str],
    token: bytes,
    clock_file: str,
) -> None:
    """A process of the field at this ``place``, the name of a planned life, whose clock is in ``clock_file``.

    The rest is as in ``launcher.processes.bodies.role``.
    """
    os.putenv("ZENOH_RUNTIME", NODE_RUNTIME)
    give(places, installed=False)
    process = _joined(settings, role, place, factory, token, HostClock(clock_file))
    os.nice(niceness)
    process.run()


def rehearse() -> None:
    """Do once in a zygote what all such nodes do: be one that claims its place (``launcher.processes.rehearsal``)."""
    title, file = getproctitle(), os.memfd_create("clock")
    clock = HostClock(f"/proc/self/fd/{file}")
    a_node(lambda session, name, factory, seal: _placed(session, seal, "node", name, factory, clock))
    os.close(file)
    setproctitle(title)


def _joined(settings: str, role: str, place: str, factory: str, token: bytes, clock: HostClock) -> Process:
    """A process that has this place. Raises ``JoinError``."""
    seal, taken = Seal(token, clock.now_ns), ""
    for _ in range(TRIES):
        session = open_session(settings)
        try:
            return _placed(session, seal, role, place, factory, clock)
        except TakenError as error:  # it took too long while emulated time went on: as the next life, then
            taken = str(error)
            session.close()  # type: ignore[no-untyped-call]
    raise JoinError(taken)


def _placed(session: zenoh.Session, seal: Seal, role: str, place: str, factory: str, clock: HostClock) -> Process:
    name = claim(session, role, socket.gethostname(), place, seal, Refusals(), own=True)
    return take_place(session, seal, role, name, factory, clock)
