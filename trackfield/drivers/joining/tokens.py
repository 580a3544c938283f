"""Liveliness tokens: which processes, slices and launchers are there now."""

from __future__ import annotations

from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple

import zenoh
from zenoh.handlers import Callback


class Tokens(NamedTuple):
    """The ``keys`` of those that were told, sorted, and whether these are ``all``: none came too late."""

    keys: list[str]
    all: bool


def tokens(session: zenoh.Session, key: str, timeout_s: float) -> Tokens:
    """Those of this key expression that are there now.

    Not by Zenoh's own handler, a queue of 256 replies: what a session knows already, as it subscribes to the same
    tokens, Zenoh replies before ``get`` returns, so that with more of them it waits for ever, and all its session too.
    """
    came: SimpleQueue[zenoh.Reply | None] = SimpleQueue()
    handler: Any = Callback(came.put, lambda: came.put(None), indirect=False)
    session.liveliness().get(key, handler, timeout=timeout_s)
    found: set[str] = set()
    complete = True
    with suppress(Empty):
        while (reply := came.get(timeout=2 * timeout_s)) is not None:
            if reply.ok is None:
                complete = False
            else:
                found.add(str(reply.ok.key_expr))
        return Tokens(sorted(found), complete)
    return Tokens(sorted(found), False)
