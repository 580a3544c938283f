"""What passes between the parts of the launcher: the plan of a run, and what the recorder settles of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from launcher.away import Away
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.filters.metrics import Lost
from trackfield.link.places import Path as Legs
from trackfield.role import NS
from trackfield.tracking.smoothing import WHOLE
from trackfield.wire.keys import Medium
from trackfield.world.path import Path

SENSES: Final = "senses"
"""Tag of a place that has a sensor."""
BATTERY: Final = "battery"
"""Tag of a place that runs on a battery, if the scenario gives it one."""
TRACKS: Final = "tracks"
"""Tag of a place that publishes tracks."""
BACKBONE: Final = "backbone"
"""Tag of a place at the wire between masters, gateways and centres."""
BASE: Final = "base"
"""The name of the view with the tracks that somebody at the base sees."""
MASTER: Final = "master"
SLAVE: Final = "slave"
"""The roles of those who form clusters."""
PEER: Final = "peer"
"""The role of a node that may lead."""
EAR: Final = "ear"
"""The role of a node that hears targets pass, and may lead."""
JOINED: Final = frozenset({"asleep", "active"})
"""The states of a slave that has a master; in any other it has none."""


@dataclass(frozen=True, slots=True)
class Place:
    """A process of the field and where it stands (metres, east and north); ``tags`` say what it does."""

    id: str
    role: str
    x: float
    y: float
    tags: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class Truth:
    """Where a target was: (t s, x m, y m) along its path, and the (from s, to s) that were interpolated."""

    target: str
    points: tuple[tuple[float, float, float], ...]
    gaps: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True)
class View:
    """The processes whose tracks are scored together: ``sources``, by their ids.

    Where several of them publish a point for one instant, the one with the highest term counts.
    """

    name: str
    sources: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class FieldInfo:
    """What a picture of the run needs besides its events.

    Times count from the first step, which is ``origin_ns`` after the start of the run; steps follow each other every
    ``step_ns``. ``marks`` are when planned faults begin and end, (t s, process, text), ``spells`` those that last,
    (from s, until s, process, text as in their mark); ``receptions`` the links used, (from, to, share of the frames
    that arrive); ``paths`` the routes of places that move, as in ``trackfield/link/places.py``;
    ``layers`` how the readings of each sensor are drawn, if at all; ``sensing`` the kind and the options of those
    sensors of which another number is drawn than the first; ``headline`` the sources of the first view.
    Sensors report that targets pass if the field ``hears``, and find that in sound if one ``listens``.
    """

    run: str
    scenario: str
    places: tuple[Place, ...]
    truths: tuple[Truth, ...]
    trackers: tuple[str, ...]
    end_s: float
    marks: tuple[tuple[float, str, str], ...] = ()
    spells: tuple[tuple[float, float, str, str], ...] = ()
    receptions: tuple[tuple[str, str, float], ...] = ()
    paths: tuple[tuple[str, Legs], ...] = ()
    origin_ns: int = 0
    step_ns: int = NS
    layers: Mapping[str, str] = field(default_factory=dict)
    sensing: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    headline: tuple[str, ...] = ()
    hears: bool = False
    listens: bool = False

    def tagged(self, tag: str) -> list[Place]:
        """The places that have this tag."""
        return [place for place in self.places if tag in place.tags]


def last_due(end_ns: int, step_ns: int, deadline_s: float) -> int:
    """The number of the last step whose track is due before the end, in ns since the first step; 0 if there is none."""
    return max((end_ns - round(deadline_s * NS) - 1) // step_ns, 0)


LAUNCHER: Final = "launcher"
"""What the launcher of a run is called."""
ROUTER: Final = "router"
"""The id of a run's router."""
RECORDER: Final = "recorder"
"""The id of the process that records a run."""
LIVE: Final = "live"
"""The id of the process that shows a run while it goes on."""
Payload = bytes
"""A name for the type in ``MessageRow``, which has a field named ``bytes``."""
ARRIVED: Final = ("delivered", "late", "ignored")
"""Outcomes of frames that reached their receiver, whether it could use them or not."""


@dataclass(frozen=True, slots=True)
class MessageRow:
    """One frame at one receiver with its settled outcome; a row of messages.parquet.

    ``outcome`` is ``delivered``, ``late`` or ``ignored`` (all of them delivered), or a cause of loss:
    ``partition``, ``radio``, ``in_flight``, ``dead``, ``frozen``, ``asleep``, ``overflow``, ``host_lost``.
    ``text`` is the decoded message in words; ``values`` are the numbers of a report, in the units of its kind of
    sensing, and ``step`` is its step; ``local_ns`` is the sender's own clock at ``sent_ns``, where it is known.
    ``payload`` is the message as it was sent.
    """

    kind: str
    src: str
    dst: str
    medium: str
    sent_ns: int
    due_ns: int | None
    outcome: str
    bytes: int
    copy: int = 0
    incarnation: int = 0
    text: str = ""
    values: tuple[float, ...] = ()
    step: int | None = None
    local_ns: int | None = None
    payload: Payload = b""

    @property
    def delivered(self) -> bool:
        """Whether the frame reached its receiver, whether that could use it or not."""
        return self.outcome in ARRIVED


@dataclass(frozen=True, slots=True)
class Flow:
    """The links of a medium that carry messages like this one: (from, to), at least one.

    Sensors report by them (``reports``), or they lead to all in reach of each sender (``near``). Those ``over_tree``
    are no links, but ways over several hops.
    """

    message: Any
    pairs: tuple[tuple[str, str], ...]
    reports: bool = False
    medium: Medium = "field"
    near: bool = False
    over_tree: bool = False


@dataclass(frozen=True, slots=True)
class Schedule:
    """Who measures when, in a field of masters with slaves, as far as it is known before a run.

    ``masters`` are (id, x m, y m), each with up to ``capacity`` of the sensors; ``policy`` is the name of how a leader
    chooses who measures next. Chosen sensors report in slots of ``slot_ns`` from the instant of a step on, and those of
    other masters leave ``gather_slots`` for what their master sends the leader. At ``beacon_ns`` masters wake their
    slaves for up to ``beacon_every`` steps, with preambles that are ``preamble_ns`` longer. The leader shares its
    belief every ``share_every`` steps, and tells ``base`` every ``base_every`` steps.

    During the setup a master makes ``announcements`` in the first ``announce_ns``; then masters set their clocks, one
    after the other. From ``joins_ns`` on each slave has a turn of ``turn_ns``, and it renews its place every
    ``renew_ns``. ``budget`` says what takes how much of a step (s), and ``at least`` how long a step must be.
    """

    masters: tuple[tuple[str, float, float], ...]
    capacity: int
    policy: str
    base: str
    slot_ns: int
    gather_slots: int
    beacon_ns: int
    preamble_ns: int
    beacon_every: int
    share_every: int
    base_every: int
    particles: bool
    announcements: int
    announce_ns: int
    joins_ns: int
    turn_ns: int
    renew_ns: int
    budget: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Polls:
    """Who measures when, in a field in which any node may lead, as far as it is known before a run.

    A head has ``count`` sensors measure, the nearest to the target or, if they ``join`` it, of those that did; it hands
    over as a ``sticky`` one does, or one that leads on while it is within ``keep_within_m`` of the target. They report
    in slots of ``slot_ns`` from the instant of a step on; polls leave at ``beacon_ns`` after the instant before, with
    preambles that are ``preamble_ns`` longer. If ``local``, they report what they conclude, and not what they measure.
    What a head tells all in reach at each step is ``short``, or all that its
    trackers know; if there is a tree it also tells the ``base`` that, every ``base_every`` steps, and all receivers are
    ``always_on``. Beliefs are handed over in the form ``hands``.

    An election ends ``settle_ns`` after a claim, and a claim leaves up to ``backoff_ns`` after the reading. A track
    without a report for ``silent_steps`` is lost. That a node senses the target holds for ``expiry_steps``; nodes say
    so in turns of ``turn_ns``. During the setup a node makes ``announcements`` in the first ``announce_ns``. A sensor's
    possible peers are within ``peers_m``. ``budget`` is as in ``Schedule``.
    """

    count: int
    joins: bool
    sticky: bool
    keep_within_m: float | None
    short: bool
    hands: str
    local: bool
    base: str
    base_every: int
    always_on: bool
    slot_ns: int
    beacon_ns: int
    preamble_ns: int
    turn_ns: int
    settle_ns: int
    hop_ns: int
    backoff_ns: int
    silent_steps: int
    expiry_steps: int
    announcements: int
    announce_ns: int
    peers_m: float
    budget: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Passing:
    """Who is told of passes, in a field whose sensors report them by themselves, as far as it is known before a run.

    Fixed ``clusters`` are the ids of their sensors, the head first; ``tells`` are the heads that want the fixes of a
    head, as the target may come to them. There are none if the ``loudest`` sensor of those that heard a target leads
    those around it. The interest of a head makes ``most_hops`` hops, lasts ``interest_s``, and is spread anew every
    third of that; so is that of the ``base`` in fixes, through the whole field. A hop takes up to ``hop_ns``. An event
    is over ``close_ns`` after its last report; the head of a new cluster waits for ``gather_ns``, and each node that
    may lead besides ``turn_ns`` longer. During the setup a node makes ``announcements`` in the first ``announce_ns``.
    """

    clusters: tuple[tuple[str, ...], ...]
    tells: Mapping[str, tuple[str, ...]]
    loudest: bool
    most_hops: int
    interest_s: float
    base: str
    hop_ns: int
    close_ns: int
    gather_ns: int
    turn_ns: int
    announcements: int
    announce_ns: int


@dataclass(frozen=True, slots=True)
class Plan:
    """A run, ready to be driven: the same for both drivers.

    A process with several lives is in ``processes`` once for each life, in their order. ``paths`` are those of the
    targets by id, in emulated time. ``tracking`` are the arguments of a ``trackfield.tracking.bank.Bank`` for all
    sensors, ``banks`` in what those of each process that fuses reports differ. ``views`` say which tracks are scored
    together, the headline first; ``flows`` are the links in use by kind of message. ``reaches`` are how far away (m)
    each sensor reports a target, ``passes`` for which steps it does so by itself, and when (ns), if it does;
    ``recorded`` says that some play what was recorded.
    ``restart`` says that processes which die unplanned are started again; ``lost`` is
    when a track counts as lost. A report is in time up to ``deadline_s`` after its step, and can be used up to
    ``max_age_s``. ``warnings`` say what is likely to go wrong, a sentence each. ``own_places`` say where users' own
    classes are, by ``kind:name``. ``bridges`` are the real devices that take the place of processes, by their ids.
    ``schedule`` says who measures, if not all sensors do that have a target in reach. ``smoothers`` are the processes
    that smooth whole tracks. ``pass_steps`` are the steps at which alone a track is expected; None: at all.
    ``external`` are the ids of the processes that others start, and for which a run over processes waits; ``aways``
    are the faults of containers, in the order of time.
    """

    run: RunSpec
    processes: tuple[ProcessSpec, ...]
    paths: Mapping[str, Path]
    info: FieldInfo
    tracking: Mapping[str, Any] = field(default_factory=dict)
    views: tuple[View, ...] = ()
    flows: tuple[Flow, ...] = ()
    reaches: Mapping[str, float] = field(default_factory=dict)
    passes: Mapping[str, Mapping[int, int]] = field(default_factory=dict)
    recorded: bool = False
    restart: bool = False
    lost: Lost = field(default_factory=Lost)
    deadline_s: float = 0.0
    max_age_s: float = 0.0
    warnings: tuple[str, ...] = ()
    own_places: Mapping[str, str] = field(default_factory=dict)
    banks: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    bridges: Mapping[str, str] = field(default_factory=dict)
    schedule: Schedule | Polls | Passing | None = None
    smoothers: tuple[str, ...] = ()
    pass_steps: frozenset[int] | None = None
    external: tuple[str, ...] = ()
    aways: tuple[Away, ...] = ()

    @property
    def reports(self) -> tuple[Flow, ...]:
        """The links by which sensors report, by kind of message; empty if they send nothing."""
        return tuple(flow for flow in self.flows if flow.reports)

    @property
    def reach_m(self) -> float:
        """How far away (m) any sensor reports a target."""
        return max(self.reaches.values(), default=0.0)

    @property
    def by_themselves(self) -> bool:
        """Whether all sensors report by themselves."""
        return bool(self.passes) and len(self.passes) == len(self.reaches)

    @property
    def ids(self) -> frozenset[str]:
        """All processes."""
        return frozenset(process.id for process in self.processes)

    @property
    def in_field(self) -> frozenset[str]:
        """Those that stand in the field: that sense, or fuse there what others report; not where tracks are sent."""
        base = {source for view in self.views if view.name == BASE for source in view.sources}
        inside = {source for view in self.views if base for source in view.sources}
        return frozenset({place.id for place in self.info.tagged(SENSES)} | (inside - base))

    @property
    def in_slices(self) -> tuple[ProcessSpec, ...]:
        """The lives in the field that other hosts may share: not of those that others start."""
        ids = self.in_field - frozenset(self.external)
        return tuple(life for life in self.processes if life.id in ids)

    @property
    def bases(self) -> set[str]:
        """The processes to which trees lead."""
        return {process.id for process in self.processes if process.tree.get("base") == process.id}

    @property
    def step_ns(self) -> int:
        """The length of a step."""
        return self.info.step_ns

    @property
    def origin_ns(self) -> int:
        """When the first step is."""
        return self.info.origin_ns

    def step_of(self, at_ns: int) -> int:
        """The number of the step at this instant."""
        return (at_ns - self.info.origin_ns) // self.info.step_ns

    def lag_of(self, track: str) -> int:
        """How many steps later the points of this track come: 0, or those by which it is smoothed.

        Also 0 for one that is smoothed as a whole, all of whose points come at its end.
        """
        smoothed = track not in self.tracking.get("trackers", (track,)) and not self.whole(track)
        return int(self.tracking.get("smooth_lag", 0)) if smoothed else 0

    def whole(self, track: str) -> bool:
        """Whether this track is smoothed as a whole."""
        return bool(self.smoothers) and track.endswith(WHOLE)

    def bank_of(self, source: str) -> dict[str, Any]:
        """The arguments of the ``Bank`` of a process that fuses reports; all but the first also draw by their ids."""
        return {**self.tracking, **self.banks.get(source, {})}
