"""How a process asks for its place in a run."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import msgpack
import zenoh

from trackfield.drivers.exchange.intake import Refusals, read
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.joining.ask import ANSWER_TIMEOUT_S, JoinError, ask
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.wire import keys
from trackfield.wire.error import WireError

NONCE_BYTES: Final = 8
"""Of a question: an answer that was given to another process is none to this one."""
LOOK_S: Final = 0.1
"""How often to ask whether the launcher has seen the token of this process."""


@dataclass(frozen=True, slots=True)
class Joined:
    """The launcher's reply to a process that joins, before or during the run.

    ``start_ns`` is the time of the run's clock at which emulated time began (None: not yet), ``left`` the bytes that an
    earlier life of the process stored last (``Store``), and those that say what it took from its battery, if that life
    ended unplanned. The ``ticket`` says that it joined.
    """

    run: RunSpec
    process: ProcessSpec
    start_ns: int | None
    left: tuple[bytes, bytes] | None
    ticket: str


def join(session: zenoh.Session, name: str, factory: str, seal: Seal, refused: Refusals) -> Joined:
    """Ask the launcher for everything that the process of this name, made by ``factory``, needs.

    Raises ``JoinError``; answers that are not the launcher's are ``refused``.
    """
    question = msgpack.packb([name, os.urandom(NONCE_BYTES)])
    try:
        return read(joined, ask(session, keys.asked_by(keys.JOIN, name), question, seal, refused), name, factory)
    except WireError as error:
        raise JoinError(f"{name}: {error}") from None


def token(name: str, ticket: str, seal: Seal) -> str:
    """The key of the liveliness token by which a process shows that it is there, as one that joined.

    Raises ``WireError`` (``key``).
    """
    return keys.live(name, ticket + seal.mark(keys.live(name, ticket)))


def confirm(session: zenoh.Session, name: str, ticket: str, host: str, seal: Seal, refused: Refusals) -> None:
    """Wait until the launcher sees the token of this process, which runs on ``host``.

    Raises ``JoinError`` if another process took the place before, or this one was too late.
    """
    deadline = time.monotonic() + ANSWER_TIMEOUT_S
    while time.monotonic() < deadline:
        question = msgpack.packb([name, ticket, host, os.urandom(NONCE_BYTES)])
        if ask(session, keys.asked_by(keys.CONFIRM, name), question, seal, refused).get("live") is True:
            return
        time.sleep(LOOK_S)
    raise JoinError(f"the launcher does not see {name}")


def joined(answer: Mapping[str, Any], name: str, factory: str) -> Joined:
    """The launcher's answer in plain form. Raises ``WireError``, or whatever is wrong with it."""
    process = ProcessSpec.from_plain(answer["process"], factory)
    start_ns, stored, ticket = answer["start_ns"], answer["stored"], answer["ticket"]
    if process.name != name or type(start_ns) not in (int, type(None)) or type(stored) not in (bytes, type(None)):
        raise WireError("malformed", "an answer to another question")
    if type(ticket) is not str or not ticket.isalnum():
        raise WireError("malformed", "no ticket")
    spent = answer.get("spent", b"")
    if type(spent) is not bytes:
        raise WireError("malformed", "no use of a battery")
    return Joined(RunSpec(**answer["run"]), process, start_ns, None if stored is None else (stored, spent), ticket)
