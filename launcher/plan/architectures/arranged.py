"""What an architecture says of a field: its processes, what they send to whom, and whose tracks are scored."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from launcher.records import Passing, Polls, Schedule
from trackfield.drivers.ports import Port
from trackfield.wire.keys import Medium


@dataclass(frozen=True)
class Hosted:
    """One of the roles of a process with several: ``factory`` and ``config`` as in ``Process``.

    The one that ``fuses`` is given the arguments of a ``Bank``, if the process fuses reports. The one whose ``clock``
    is ``"keeps"`` asks for the time, if the process does, and gets ``sync``. Those whose ``clock`` is ``"follows"`` use
    its corrections: each gets ``sync``, the fields of a ``trackfield.protocols.timesync.Following``.
    """

    factory: str | Callable[..., Any] = ""
    config: Mapping[str, Any] = field(default_factory=dict)
    fuses: bool = False
    clock: Literal["", "keeps", "follows"] = ""


@dataclass(frozen=True)
class Process:
    """A process of a field, with its ``id`` and the name of its ``role``; it stands at ``x``, ``y`` (m east, north).

    ``factory`` makes its role: a class, or ``module:attribute``; empty: the installed role of that name. ``config``
    are its arguments, as far as MessagePack can hold them. ``sends`` says to which ids it sends messages of which
    kinds; who receives something of it, and who may hear whom, follows. The id ``"*"`` (``NEIGHBOURHOOD``) stands for
    all in radio reach that take the kind, by broadcast, or one by one; ``hears`` are the kinds that it takes from such
    senders. ``over`` is the medium of those kinds that it does not send by the radio of the field.

    One that ``senses`` has the sensor of its id. One that ``fuses`` gets the reports of these sensors, and its role the
    arguments of a ``trackfield.tracking.bank.Bank`` for them; those with the same ``draws`` (a name; empty: its own id)
    have the same prior. Its clock is right, unless it ``asks`` another process
    for the time: then its clock is off as ``[clock]`` says, and if clocks are set, its role gets ``sync``, the
    arguments with which it asks. ``tags`` are ``tracks`` (it publishes tracks), ``battery`` (it runs on one, of
    ``battery_j``; None: it is never empty), ``backbone``; the tag ``senses`` follows. A process that moves has a
    ``route``: (t ns, x m, y m) at least once, with straight lines between them.

    A process may have several ``roles`` by name, in place of ``factory`` and ``config``, with one sensor, battery,
    radio, clock and address for all (``trackfield.host``). Its ``role`` is then the name of all of them together.

    One that has a ``base`` is in a tree to that process, which names itself: what it sends there by radio, and what the
    base sends to others of the tree, goes over as many hops as it takes (``trackfield.protocols.collected``). Messages
    of the kinds in ``direct`` do not: they are for neighbours.

    ``ports`` are those of its devices by name, of a process with several roles as ``role/port``. ``media`` are what it
    is connected to: the radio of the ``field``, a ``backbone``, a ``serial`` line. It asks for the time over the medium
    ``asks_over``.

    One that ``carries`` is one of several that hand on each other's messages on the backbone: these are the arguments
    of its ``trackfield.protocols.carried.Carried``. One that is ``managed`` takes orders to start and stop: the
    arguments of its ``trackfield.protocols.managed.Managed``.
    """

    id: str
    role: str
    x: float
    y: float
    factory: str | Callable[..., Any] = ""
    config: Mapping[str, Any] = field(default_factory=dict)
    sends: Mapping[str, Collection[str]] = field(default_factory=dict)
    senses: bool = False
    fuses: Collection[str] = ()
    asks: str = ""
    tags: Collection[str] = ()
    battery_j: float | None = None
    route: Sequence[tuple[int, float, float]] = ()
    roles: Mapping[str, Hosted] = field(default_factory=dict)
    ports: Mapping[str, Port] = field(default_factory=dict)
    media: Sequence[Medium] = ("field",)
    hears: Collection[str] = ()
    over: Mapping[str, Medium] = field(default_factory=dict)
    base: str = ""
    direct: Collection[str] = ()
    draws: str = ""
    asks_over: Medium = "field"
    carries: Mapping[str, Any] = field(default_factory=dict)
    managed: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Arranged:
    """The processes of a field, and its ``views``: by name the ids whose tracks are scored together, headline first.

    Of several points of a view for one instant, the one with the highest term counts. ``schedule`` says who measures,
    if not all sensors do that have a target in reach; what is predicted of a run goes by it.
    """

    processes: Sequence[Process]
    views: Mapping[str, Sequence[str]]
    schedule: Schedule | Polls | Passing | None = None
