"""How a process that was given neither finds its run and its place in it."""

from __future__ import annotations

import os
from typing import Any

import msgpack
import zenoh

from trackfield.drivers.exchange.intake import Refusals, printable, read
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.joining.ask import ANSWER_TIMEOUT_S, JoinError, ask
from trackfield.drivers.joining.credentials import open_shown
from trackfield.drivers.joining.join import NONCE_BYTES
from trackfield.drivers.joining.tokens import tokens
from trackfield.drivers.session import Credentials
from trackfield.wire import keys
from trackfield.wire.error import WireError


def find_run(endpoint: str, credentials: Credentials | None = None) -> str:
    """The id of the only run at the router at ``endpoint``.

    Raises ``JoinError`` if there is none or more than one, ``zenoh.ZError`` if no router answers.
    """
    with open_shown(endpoint, None, credentials) as session:
        found = tokens(session, f"*/{keys.LAUNCHER}/*", ANSWER_TIMEOUT_S)
    runs = sorted({key.partition("/")[0] for key in found.keys})
    if not runs:
        raise JoinError("there is no run yet")
    if len(runs) > 1:
        raise JoinError(f"there are {len(runs)} runs, name one with --run: {printable(', '.join(runs), 1000)}")
    return runs[0]


def claim(
    session: zenoh.Session, role: str, host: str, place: str, seal: Seal, refused: Refusals, *, own: bool = False
) -> str:
    """The name to join under, at this ``place`` or (empty) at a free one of the role: first the one this host had.

    Whoever shows the certificate of its ``own`` place may claim no other. Raises ``JoinError`` if it is taken, or there
    is none, or no launcher answers.
    """
    return _claimed(session, role, host, place, seal, refused, own=own)[0]


def enrol(
    session: zenoh.Session, role: str, host: str, place: str, seal: Seal, refused: Refusals, guest: Credentials
) -> tuple[str, Credentials]:
    """As ``claim``, and the certificate of that place, for a ``guest``. Raises ``JoinError``."""
    name, told = _claimed(session, role, host, place, seal, refused)
    certificate, key = told.get("certificate"), told.get("key")
    if type(certificate) is not str or type(key) is not str:
        raise JoinError("the launcher gives no certificates: its run is not secured (--secure)")
    return name, Credentials(guest.authority, certificate, key)


def _claimed(
    session: zenoh.Session, role: str, host: str, place: str, seal: Seal, refused: Refusals, *, own: bool = False
) -> tuple[str, dict[str, Any]]:
    """The name in the answer to a claim, and the answer. Raises ``JoinError``."""
    question = msgpack.packb([role, host, place, os.urandom(NONCE_BYTES)])
    told = ask(session, keys.asked_by(keys.CLAIM, place) if own else keys.CLAIM, question, seal, refused)
    try:
        return read(keys.check_name, told.get("name")), told
    except WireError as error:
        raise JoinError(str(error)) from None
