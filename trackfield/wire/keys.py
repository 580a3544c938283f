"""Zenoh keys: plane, receiver, sender, kind. All are relative to the run's namespace."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final, Literal, get_args

from trackfield.wire.error import WireError

Medium = Literal["field", "backbone", "serial"]
"""``field`` is the radio among sensors, ``backbone`` what masters, gateways and centres have among them, a wire or a
radio of its own, ``serial`` a line to a device."""
MEDIA: Final[tuple[Medium, ...]] = get_args(Medium)

ALL_DATA: Final = "data/**"
"""Every data frame of the run."""
ALL_TELEMETRY: Final = "telemetry/**"
ATTEMPTS: Final = "telemetry/router/attempts"
"""The launcher asks here (a query) what the router of a secured run refused."""
ALL_LIVE: Final = "live/**"
JOIN: Final = "control/join"
"""A process asks below this, at its own id (a query), for its place in the run."""
CLAIM: Final = "control/claim"
"""A process that starts elsewhere asks here (a query) under which name to join."""
CONFIRM: Final = "control/confirm"
"""Such a process asks below this, at its id (a query), whether the place is its own, once its token is there."""
SLICE: Final = "control/slice"
"""A slice, which starts a share of a field on another host, asks here (a query) which processes it has; below this is
its liveliness token."""
CLOCK: Final = "control/clock"
"""Whoever starts elsewhere asks here (a query) for the time of the run's clock."""
BY_ANYBODY: Final = (CLAIM, SLICE, CLOCK)
"""What is not asked in the name of a process, at its own id."""
LAUNCHER: Final = "control/launcher"
"""Below this is the launcher's liveliness token, named after its session: how processes find a run, and know it."""
ALL_CONTROL: Final = "control/**"
"""Everything that is ordered in a run."""
ORDERS: Final = "control/*"
"""The launcher's orders to all processes."""
GROUPS: Final = 61
"""A router looks at all subscribers of a key for each that comes, and for each session. So of thousands of processes
that start together, each subscribes to the orders to one of so many groups, and the launcher gives all orders twice."""
START: Final = "control/start"
"""The time (ns, decimal) by the run's clock, the launcher's monotonic one, at which emulated time begins."""
END: Final = "control/end"
"""The emulated time (ns, decimal) at which the run ends early."""
SETTLE: Final = "control/settle"
"""All roles say what they have put and got; the number of the question (decimal), which is repeated in the answer."""
STOP: Final = "control/stop"
"""All roles leave."""
FINISH: Final = "control/finish"
"""The recorder finishes."""
LIFE: Final = "control/recorder/life"
"""An unplanned life takes the place of one that died: its specification in plain form, packed. None of ``ORDERS``."""

_ID = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,31}")
_LIFE = re.compile(r"~[1-9][0-9]{0,5}")


def check_id(text: object) -> str:
    """``text`` if it can name a process, cell or kind; raises ``WireError`` (``key``) otherwise.

    Up to 32 ASCII letters, digits, ``_``, ``.`` and ``-``, the first a letter, digit or ``_``: safe as a
    chunk of a key and as a file name.
    """
    if not isinstance(text, str) or not _ID.fullmatch(text):
        raise WireError("key", f"{text!r} is not an id (1 to 32 of A-Z a-z 0-9 _ . -)")
    return text


@dataclass(frozen=True, slots=True)
class Address:
    """The parts of a data key; exactly one of ``to`` (a process) and ``cell`` (a neighbourhood) is set."""

    medium: Medium
    to: str | None
    cell: str | None
    src: str
    kind: str


def unicast(medium: str, dst: str, src: str, kind: str) -> str:
    """The key of a frame from ``src`` to ``dst``; raises ``WireError`` (``key``)."""
    return f"data/{_check_medium(medium)}/to/{check_id(dst)}/{check_id(src)}/{check_id(kind)}"


def broadcast(medium: str, cell: str, src: str, kind: str) -> str:
    """The key of a frame from ``src`` to all processes that listen to ``cell``; raises ``WireError`` (``key``)."""
    return f"data/{_check_medium(medium)}/all/{check_id(cell)}/{check_id(src)}/{check_id(kind)}"


def inbox(medium: str, process: str) -> str:
    """The key expression of the frames to a process; raises ``WireError`` (``key``)."""
    return f"data/{_check_medium(medium)}/to/{check_id(process)}/**"


def neighbourhood(medium: str, cell: str) -> str:
    """The key expression of the broadcasts in a cell; raises ``WireError`` (``key``)."""
    return f"data/{_check_medium(medium)}/all/{check_id(cell)}/**"


def parse(key: str) -> Address:
    """The parts of a data key; raises ``WireError`` (``key``) for anything else."""
    chunks = key.split("/") if isinstance(key, str) else []
    if len(chunks) != 6 or chunks[0] != "data" or chunks[2] not in ("to", "all"):
        raise WireError("key", f"{key!r} is not a data key")
    _, medium, flow, target, src, kind = chunks
    check_id(target)
    to, cell = (target, None) if flow == "to" else (None, target)
    return Address(_check_medium(medium), to, cell, check_id(src), check_id(kind))


def check_name(text: object) -> str:
    """``text`` if it can name a life: an id, followed by ``~`` and a number for each life but the first."""
    if isinstance(text, str):
        id, mark, number = text.partition("~")
        if not mark or _LIFE.fullmatch(mark + number):
            check_id(id)
            return text
    raise WireError("key", f"{text!r} names no life of a process (an id, or one with ~1, ~2 ...)")


def id_of(name: str) -> str:
    """The id of the process of which ``name`` is a life."""
    return name.partition("~")[0]


def telemetry(name: str, what: str) -> str:
    """The key of a life's telemetry ``what``; raises ``WireError`` (``key``)."""
    return f"telemetry/{check_name(name)}/{check_id(what)}"


def parse_telemetry(key: str) -> tuple[str, str]:
    """The life and what it tells; raises ``WireError`` (``key``) for anything else."""
    chunks = key.split("/")
    if len(chunks) != 3 or chunks[0] != "telemetry":
        raise WireError("key", "no telemetry key")
    return check_name(chunks[1]), check_id(chunks[2])


def telemetry_of_all(what: str) -> str:
    """The key expression of the telemetry ``what`` of every process; raises ``WireError`` (``key``)."""
    return f"telemetry/*/{check_id(what)}"


def live(name: str, mark: str = "") -> str:
    """The liveliness token of a life, with the mark by which it is known; raises ``WireError`` (``key``)."""
    return f"live/{check_name(name)}" + (f"/{mark}" if mark else "")


def asked_by(question: str, name: str) -> str:
    """The key at which a process asks this in its own name, so that a router can tell whether it may."""
    return f"{question}/{id_of(check_name(name))}"


def asked_by_all(question: str) -> str:
    """The key expression of what all processes ask in their own names."""
    return f"{question}/*"


def orders_to(name: str) -> str:
    """The key expression of the orders to the group of this life."""
    return f"{ORDERS}/{int.from_bytes(name.encode()) % GROUPS}"


def to_groups(order: str) -> str:
    """The key of this order to all groups."""
    return f"{order}/*"


def order_of(key: str) -> str:
    """The order that came on this key, to all processes or to all groups."""
    return key.removesuffix("/*")


def launcher(session: object) -> str:
    """The liveliness token of a launcher with this session id."""
    return f"{LAUNCHER}/{session}"


def _check_medium(medium: str) -> Medium:
    if medium not in MEDIA:
        raise WireError("key", f"medium {medium!r} is not one of {', '.join(MEDIA)}")
    return medium


def slice_token(number: int, of: int, mark: str = "") -> str:
    """The liveliness token of the slice with this number of so many, with the mark by which it is known."""
    return f"{SLICE}/{number}/{of}" + (f"/{mark}" if mark else "")


def slice_name(number: int) -> str:
    """The name by which the slice with this number is certified and reported."""
    return f"slice-{number}"
