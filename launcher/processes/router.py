"""A router of its own, for runs whose processes start elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from threading import Event

import zenoh
from setproctitle import setproctitle

from launcher.signals import handling
from trackfield.drivers.session import open_router
from trackfield.errors import RunFailed


def serve(endpoints: Sequence[str]) -> None:
    """Be the router at these endpoints until it is told to end. Raises ``RunFailed`` if it cannot listen there."""
    done = Event()
    setproctitle("trackfield router")
    places = ", ".join(endpoints)
    try:
        router = open_router(*endpoints)
    except zenoh.ZError as error:
        raise RunFailed(f"cannot listen at {places}: {str(error).partition(' at /')[0]}") from None
    with handling(lambda _: done.set()):
        print(f"router at {places}", file=sys.stderr)
        done.wait()
    router.close()  # type: ignore[no-untyped-call]
