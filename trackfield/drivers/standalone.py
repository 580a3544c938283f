"""A role that is started by hand or in a container, and gets all its parameters from the launcher.

``python -m trackfield.drivers.standalone ROLE MODULE:CLASS`` does that for a role of a user's own architecture, and
``python -m trackfield.drivers.standalone ROLE NAME=MODULE:CLASS NAME=MODULE:CLASS`` for a process with several roles.
"""

from __future__ import annotations

import argparse
import logging
import os
import re
import socket
import sys
import time
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Final, NoReturn

import zenoh
from setproctitle import setproctitle

from trackfield.drivers.exchange.intake import Refusals, printable
from trackfield.drivers.exchange.seal import Seal, token_from
from trackfield.drivers.hostclock import HostClock
from trackfield.drivers.joining.ask import JoinError, RefusedError, TokenError
from trackfield.drivers.joining.claim import claim, enrol, find_run
from trackfield.drivers.joining.clock import keep_clock, set_clock
from trackfield.drivers.joining.credentials import GUEST, SECURE, CertificateError, credentials_in, open_shown
from trackfield.drivers.process import Process
from trackfield.drivers.session import NODE_RUNTIME, SECURED, Credentials, is_endpoint
from trackfield.drivers.spec import factory_of, role_factories
from trackfield.errors import ScenarioError
from trackfield.plugins import give
from trackfield.streams import steady
from trackfield.wire import keys
from trackfield.wire.error import WireError
from trackfield.wire.keys import check_id, check_name, id_of

_PLACE: Final = re.compile(r"(?:(?P<name>[^=]*)=)?(?P<place>[\w.]+:[\w.]+)")
_OWN: Final = re.compile(r"(sensor|tracker):[^=:]+=[\w.]+:[\w.]+")
RETRY_S: Final = 1.0
"""How often a waiting process looks for a run with a free place."""
TRIES: Final = 5
"""How often a process asks for a place, if others come before it at those that it is offered."""


def main(
    program: str, factories: Mapping[str, str | Mapping[str, str]], description: str | None, *, installed: bool = False
) -> None:
    """Join a run as one of its processes and live its life.

    ``factories`` (``module:attribute``, of a process with several roles those of each by name) make the roles that
    ``program`` knows by name; of several the command line may name one, else the first is meant. ``installed``: users'
    own classes are also looked for among installed packages, which takes memory. Exit 2 for bad arguments, 1 if it
    cannot join.
    """
    parser = _parser(f"python -m {program}", (description or "").partition("``: ")[2].capitalize())
    role = next(iter(factories))
    if len(factories) > 1:
        parser.add_argument("role", nargs="?", default=role, choices=tuple(factories), help=f"which; unset: {role}")
    arguments = _checked(parser)
    role = getattr(arguments, "role", role)
    factory = factories[role]
    _live(role, factory if isinstance(factory, str) else factory_of(factory), arguments, installed=installed)


def own() -> None:
    """As ``main``, for the role and the classes that the command line names."""
    parser = _parser(
        "python -m trackfield.drivers.standalone", "A process with a role of a user's own that joins a run."
    )
    parser.add_argument("role", type=_role, metavar="ROLE", help="the name of the role in the architecture")
    parser.add_argument(
        "places",
        type=_place,
        nargs="+",
        metavar="MODULE:CLASS",
        help="what makes it, like mine.roles:Base; of a process with several roles NAME=MODULE:CLASS for each",
    )
    arguments = _checked(parser)
    places = dict(arguments.places)
    if len(places) < len(arguments.places) or (len(places) > 1 and "" in places):
        parser.error("of several roles each needs a name of its own, like node=node.role:Node head=mine.roles:Head")
    for place in places.values():
        try:
            role_factories(place)
        except Exception as error:  # noqa: BLE001  a user's module: its import may raise anything
            parser.error(f"{place} cannot be loaded ({type(error).__name__}: {error})")
    _live(arguments.role, factory_of(places), arguments, installed=True)


def _live(role: str, factory: str, arguments: argparse.Namespace, *, installed: bool) -> NoReturn:
    """Wait for a place if that is wanted, and live there."""
    steady()
    give(dict(arguments.own), installed=installed)
    logging.basicConfig(format="%(asctime)s %(levelname)s %(message)s")
    os.environ["ZENOH_RUNTIME"] = NODE_RUNTIME
    setproctitle(f"trackfield {role}")
    said = ""
    while True:
        try:
            process = _join(role, factory, arguments)
            break
        except ScenarioError as error:
            hint = "" if error.key == SECURE else " (--own tells this process where a class of yours is)"
            sys.exit(f"{role}: {error}{hint}")
        except ImportError as error:
            sys.exit(f"{role}: what the run needs is not installed here: {error} (in containers: TRACKFIELD_NODE=full)")
        except (JoinError, zenoh.ZError) as error:
            which = " ".join(filter(None, ["the run", arguments.run]))
            why = f"{role}: cannot join {which} through {arguments.connect}: {error}"
            if not arguments.wait:
                sys.exit(why)
            if isinstance(error, TokenError | CertificateError) and why != said:  # waiting alone does not help
                said = why
                print(why, file=sys.stderr, flush=True)
            time.sleep(RETRY_S)
    process.run()
    _leave()


def _leave() -> NoReturn:
    """End at once: a Zenoh thread that calls Python during interpreter shutdown would abort the process."""
    logging.shutdown()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


def _join(role: str, factory: str, arguments: argparse.Namespace) -> Process:
    """A process that has a place. Raises ``JoinError``, ``ScenarioError``."""
    shown, own = _shown(arguments)
    run = arguments.run or find_run(arguments.connect, shown)
    clock = HostClock()
    seal = Seal(token_from(os.environ, run), clock.now_ns)
    for _ in range(TRIES):
        with ExitStack() as opened:
            session = opened.enter_context(open_shown(arguments.connect, run, shown))
            place, host, refused = arguments.id or "", socket.gethostname(), Refusals()
            if shown is None or own:
                name = claim(session, role, host, place, seal, refused, own=own)
            else:
                name, its = enrol(session, role, host, place, seal, refused, shown)
                opened.close()
                session = opened.enter_context(open_shown(arguments.connect, run, its))
            read = set_clock(session, clock, seal, refused)
            try:
                process = take_place(session, seal, role, name, factory, clock)
            except TakenError as error:
                taken = error
                continue
            opened.pop_all()
            if read:
                keep_clock(session, clock, seal, read)
            return process
    raise taken


def _shown(arguments: argparse.Namespace) -> tuple[Credentials | None, bool]:
    """The credentials of this process, and whether they are its own, not a guest's. Raises ``ScenarioError``."""
    folder: Path | None = arguments.secure
    if folder is None:
        return None, False
    id = id_of(arguments.id or "")
    own = bool(id) and (folder / f"{id}.pem").exists()
    return credentials_in(folder, id if own else GUEST), own


class TakenError(JoinError):
    """Another process was faster at the place that this one was offered."""


def take_place(
    session: zenoh.Session, seal: Seal, role: str, name: str, factory: str, clock: HostClock | None = None
) -> Process:
    """A process that has the place of this ``name``, which it was offered. Raises ``TakenError``, ``JoinError``."""
    setproctitle(f"trackfield {role} {name}")
    try:
        process = Process(session, name, factory, seal, keys.orders_to(name), clock)
        process.confirm(socket.gethostname())
    except RefusedError as error:
        raise TakenError(str(error)) from None
    except (TypeError, ValueError, LookupError, AttributeError, ArithmeticError) as error:
        why = printable(f"{type(error).__name__}: {error}")
        what = f"what the launcher tells makes no {role} here ({why})"
        raise JoinError(f"{what}: it is of another version of Trackfield, or no launcher") from None
    return process


def _own(text: str) -> tuple[str, str]:
    """``kind:name`` and ``module:attribute``. Raises ``argparse.ArgumentTypeError``."""
    which, _, place = text.partition("=")
    if not _OWN.fullmatch(text):
        raise argparse.ArgumentTypeError(f"is {text!r}; expected something like sensor:sonar=mine.sonar:Sonar")
    return which, place


def _role(text: str) -> str:
    """The name of a role. Raises ``argparse.ArgumentTypeError``."""
    try:
        return check_id(text)
    except WireError:
        raise argparse.ArgumentTypeError(f"is {text!r}; expected 1 to 32 of A-Z a-z 0-9 _ . -") from None


def _place(text: str) -> tuple[str, str]:
    """The name of a role, or none, and ``module:attribute``. Raises ``argparse.ArgumentTypeError``."""
    found = _PLACE.fullmatch(text)
    if not found:
        raise argparse.ArgumentTypeError(f"is {text!r}; expected something like mine.roles:Base")
    return "" if found["name"] is None else _role(found["name"]), found["place"]


def _parser(program: str, description: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=program, description=description)
    parser.add_argument("--connect", required=True, metavar="ENDPOINT", help="the run's router, like tcp/10.0.0.1:7447")
    parser.add_argument("--run", metavar="ID", help="the run's id, if the router has several at a time")
    parser.add_argument("--id", help="which of the run's processes this is, like n060; if not given, any that is free")
    parser.add_argument(
        "--own",
        type=_own,
        action="append",
        default=[],
        metavar="KIND:NAME=PLACE",
        help="where a sensor or tracker of your own is, like sensor:sonar=mine.sonar:Sonar",
    )
    parser.add_argument(
        "--secure", type=Path, metavar="DIR", help="the certificates of this process, or those by which it gets some"
    )
    parser.add_argument("--wait", action="store_true", help="wait for a router, a run and a free place")
    return parser


def _checked(parser: argparse.ArgumentParser) -> argparse.Namespace:
    """The arguments; exit 2 if they are wrong."""
    arguments = parser.parse_args()
    if not is_endpoint(arguments.connect):
        parser.error(f"--connect is {arguments.connect!r}; expected something like tcp/10.0.0.1:7447")
    try:
        if arguments.id is not None:
            check_name(arguments.id)
        if (arguments.secure is not None) != arguments.connect.startswith(tuple(f"{one}/" for one in SECURED)):
            parser.error(f"{SECURE} DIR goes with --connect to {' or '.join(f'{one}/...' for one in SECURED)}")
        _shown(arguments)
    except (WireError, ScenarioError) as error:
        parser.error(str(error))
    return arguments


if __name__ == "__main__":
    own()
