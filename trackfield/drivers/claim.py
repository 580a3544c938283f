"""How a process that was given neither finds its run and its place in it."""

from __future__ import annotations

import msgpack
import zenoh

from trackfield.drivers.join import JOIN_TIMEOUT_S, JoinError
from trackfield.drivers.session import open_client
from trackfield.wire import keys


def find_run(endpoint: str) -> str:
    """The id of the only run at the router at ``endpoint``.

    Raises ``JoinError`` if there is none or more than one, ``zenoh.ZError`` if no router answers.
    """
    with open_client(endpoint) as session:
        tokens = session.liveliness().get(f"*/{keys.LAUNCHER}", timeout=JOIN_TIMEOUT_S)
        runs = sorted(str(token.ok.key_expr).partition("/")[0] for token in tokens if token.ok)
    if not runs:
        raise JoinError("there is no run yet")
    if len(runs) > 1:
        raise JoinError(f"there are {len(runs)} runs, name one with --run: {', '.join(runs)}")
    return runs[0]


def claim(session: zenoh.Session, role: str, host: str) -> str:
    """The name of a free place of this role to join under: the place that this host had before, if it had one.

    Raises ``JoinError`` if there is none or no launcher answers.
    """
    for reply in session.get(keys.CLAIM, payload=msgpack.packb([role, host]), timeout=JOIN_TIMEOUT_S):
        if reply.ok is None:
            raise JoinError(reply.err.payload.to_string() if reply.err else "refused")
        return reply.ok.payload.to_string()
    raise JoinError("no launcher answers")
