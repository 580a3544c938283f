"""How a process that was given neither finds its run and its place in it."""

from __future__ import annotations

import os

import msgpack
import zenoh

from trackfield.drivers.exchange.intake import Refusals, printable, read
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.joining.ask import ANSWER_TIMEOUT_S, JoinError, ask
from trackfield.drivers.joining.join import NONCE_BYTES
from trackfield.drivers.session import open_client
from trackfield.wire import keys
from trackfield.wire.error import WireError


def find_run(endpoint: str) -> str:
    """The id of the only run at the router at ``endpoint``.

    Raises ``JoinError`` if there is none or more than one, ``zenoh.ZError`` if no router answers.
    """
    with open_client(endpoint) as session:
        tokens = session.liveliness().get(f"*/{keys.LAUNCHER}/*", timeout=ANSWER_TIMEOUT_S)
        runs = sorted({str(token.ok.key_expr).partition("/")[0] for token in tokens if token.ok})
    if not runs:
        raise JoinError("there is no run yet")
    if len(runs) > 1:
        raise JoinError(f"there are {len(runs)} runs, name one with --run: {printable(', '.join(runs), 1000)}")
    return runs[0]


def claim(session: zenoh.Session, role: str, host: str, place: str, seal: Seal, refused: Refusals) -> str:
    """The name to join under, at this ``place`` or (empty) at a free one of the role: first the one this host had.

    Raises ``JoinError`` if it is taken, or there is none, or no launcher answers.
    """
    question = msgpack.packb([role, host, place, os.urandom(NONCE_BYTES)])
    told = ask(session, keys.CLAIM, question, seal, refused)
    try:
        return read(keys.check_name, told.get("name"))
    except WireError as error:
        raise JoinError(str(error)) from None
