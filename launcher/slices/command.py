"""``trackfield field``: take a share of a run's field and run it."""

from __future__ import annotations

import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import zenoh

from launcher.blocks import span
from launcher.processes.limits import check_processes
from launcher.signals import handling
from launcher.slices.asking import Asking, Given, Share
from launcher.slices.slice import Slice, host
from trackfield.drivers.exchange.seal import Seal, token_from
from trackfield.drivers.joining.ask import JoinError, RefusedError, TokenError
from trackfield.drivers.joining.claim import find_run
from trackfield.drivers.joining.clock import ClockError
from trackfield.drivers.joining.credentials import CertificateError, open_shown
from trackfield.errors import RunFailed, ScenarioError

RETRY_S: Final = 1.0
"""How often a waiting slice looks for its run."""
DIED: Final = 1
REFUSED: Final = 2


@dataclass(frozen=True, slots=True)
class Order:
    """What the command line asks for: a share of the ``run`` (empty: the only one) at the router ``connect``.

    Whether to ``wait`` for a router, a run and a free slice, where logs go (None: a folder named as the slice), and
    where the certificates are of a ``secure`` run.
    """

    share: Share
    connect: str
    run: str = ""
    wait: bool = False
    out: Path | None = None
    secure: Path | None = None


def field(order: Order) -> int:
    """Run a share of a field to the end of its run; the exit code.

    0 if it is done, 1 if a process died unplanned, 2 if this slice is refused, 128 and the number of a signal that
    ended it. Raises ``RunFailed``, also if the launcher is gone.
    """
    said = ""
    while True:
        try:
            return _taken(order)
        except ScenarioError as error:
            return _told(str(error), REFUSED)
        except (JoinError, zenoh.ZError) as error:
            if isinstance(error, RefusedError | ClockError):
                return _told(str(error), REFUSED)
            why = _why(order, error)
            if not order.wait or isinstance(error, TokenError | CertificateError):
                raise RunFailed(why) from None
            if why != said:
                said = why
                print(f"waiting: {why}", file=sys.stderr, flush=True)
        time.sleep(RETRY_S)


def _why(order: Order, error: Exception) -> str:
    which = " ".join(filter(None, ["the run", order.run]))
    return f"cannot join {which} through {order.connect}: {error}"


def _taken(order: Order) -> int:
    """Ask for the share, and run it. Raises ``JoinError``, ``zenoh.ZError``."""
    came: list[int] = []
    shown = order.share.credentials(order.secure)
    run = order.run or find_run(order.connect, shown)
    asking = Asking(run, host(), Seal(token_from(os.environ, run)))
    with open_shown(order.connect, run, shown) as session:
        given = asking.join(session, order.share, shown)
    check_processes(len(given.lives), "more slices have fewer processes each")
    folder = order.out or Path(f"slice-{given.number}-of-{given.of}")
    with handling(came.append), Slice(asking, given, folder, order.connect) as share:
        print(_announced(given, folder), file=sys.stderr, flush=True)
        share.watch(lambda: bool(came))
        if came:
            share.leave()
            print(f"{given.text} leaves before its processes are done", file=sys.stderr, flush=True)
            return 128 + came[0]
        done = "all its processes are done" if not share.deaths else f"{len(share.deaths)} of its processes died"
        print(f"{given.text}: {done}", file=sys.stderr, flush=True)
        return DIED if share.deaths else 0


def _announced(given: Given, folder: Path) -> str:
    ids = sorted({life.id for life in given.lives})
    return f"{given.text} of {given.run} ({given.scenario}): {len(ids)} processes, {span(ids)}; logs in {folder}/logs"


def _told(message: str, code: int) -> int:
    print(f"trackfield: {message}", file=sys.stderr)
    return code
