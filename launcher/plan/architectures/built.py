"""The table of architectures, and what the one that a scenario names makes of its field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Protocol, runtime_checkable

from launcher.outside import GATEWAY
from launcher.plan.architectures.arranged import Arranged, Hosted, Process
from launcher.plan.architectures.centralised import Centralised
from launcher.plan.architectures.checks import checked
from launcher.plan.architectures.clusters import Clusters
from launcher.plan.architectures.cpa import Cpa
from launcher.plan.architectures.elected import Elected
from launcher.plan.architectures.field import Field
from launcher.plan.architectures.location_central import LocationCentral
from launcher.records import SENSES, Passing, Place, Polls, Schedule, View
from trackfield.errors import ScenarioError
from trackfield.link.places import Path
from trackfield.options import made
from trackfield.plugins import Maker, Plugins
from trackfield.scenario import Scenario, Site, survey
from trackfield.scenario.sections.camera import EviD30


class Architecture(Protocol):
    """A kind of architecture: a frozen dataclass whose fields a scenario sets in ``[architecture]``.

    All fields have defaults with which it works on any field.
    """

    def arrange(self, field: Field) -> Arranged:
        """The processes of this field. It depends on nothing else: a run and its report ask for them separately."""
        ...


@runtime_checkable
class SetUp(Protocol):
    """An architecture whose processes have to find each other before the first step."""

    def setup_s(self, field: Field) -> float:
        """How long they need for that."""
        ...


ARCHITECTURES: Final = Plugins(
    "architecture",
    "trackfield.architectures",
    {
        "centralised": Centralised,
        "clusters": Clusters,
        "location-central": LocationCentral,
        "elected": Elected,
        "cpa": Cpa,
    },
    methods=("arrange",),
)


def register_architecture(kind: str, maker: Maker) -> None:
    """Let scenarios of this Python process name an architecture of your own (``Architecture``), as the kind of
    ``[architecture]``.

    ``maker`` is its class; further keys of that section set its parameters, such as the fields of a frozen dataclass.
    Raises ``ScenarioError`` for a name that is taken by one of Trackfield's own, and for a class without ``arrange``.
    """
    ARCHITECTURES.register(kind, maker)


def make_architecture(kind: str, options: Mapping[str, Any]) -> Architecture:
    """The architecture of this kind with these options.

    Raises ``ScenarioError`` with the nearest name for an unknown kind, and for unknown or unsuitable options.
    """
    if kind not in ARCHITECTURES:
        raise ARCHITECTURES.unknown(kind, "architecture.kind")
    architecture: Architecture = made(ARCHITECTURES[kind], options, "architecture")
    return architecture


@dataclass(frozen=True)
class Built:
    """A field with its processes, as they were arranged, the views, the headline first, and who measures when."""

    site: Site
    processes: tuple[Process, ...]
    views: tuple[View, ...]
    schedule: Schedule | Polls | Passing | None = None

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """The places of the processes, with all their tags."""
        return tuple(
            Place(p.id, p.role, float(p.x), float(p.y), frozenset((*p.tags, SENSES) if p.senses else p.tags))
            for p in self.processes
        )

    @property
    def routes(self) -> tuple[tuple[str, Path], ...]:
        """The routes of those that move, by their ids."""
        legs = ((p.id, tuple((int(t), float(x), float(y)) for t, x, y in p.route)) for p in self.processes if p.route)
        return tuple(legs)

    def process(self, id: str) -> Process:
        """The process with this id."""
        return next(process for process in self.processes if process.id == id)

    @property
    def fusing(self) -> tuple[str, ...]:
        """The processes that fuse reports."""
        return tuple(p.id for p in self.processes if p.fuses)

    @property
    def smoothers(self) -> tuple[str, ...]:
        """The processes that smooth whole tracks."""
        return tuple(p.id for p in self.processes if _smooths(p) or any(map(_smooths, p.roles.values())))

    @property
    def first(self) -> str:
        """The first process that fuses reports; if none does, the first whose tracks are scored."""
        return (*self.fusing, *self.views[0].sources)[0]


def _smooths(role: Process | Hosted) -> bool:
    """Whether a role smooths whole tracks."""
    return bool(role.config.get("rts") or role.config.get("spline"))


def surveyed(scenario: Scenario) -> Site:
    """A scenario worked out, with as much time before the first step as its architecture needs, if none is set.

    Raises ``ScenarioError`` as ``survey`` and ``built`` do.
    """
    site = survey(scenario)
    if scenario.run.setup_s is not None:
        return site
    architecture = make_architecture(scenario.architecture.kind, scenario.architecture.options)
    needs = architecture.setup_s(Field(site)) if isinstance(architecture, SetUp) else 0.0
    return survey(scenario.set("run.setup_s", needs)) if needs else site


def built(site: Site) -> Built:
    """What the scenario's architecture makes of its field; trackers are not needed for that.

    Raises ``ScenarioError`` for an unknown architecture, unsuitable options, one that raises an exception, and one
    whose processes and views contradict each other.
    """
    section = site.scenario.architecture
    architecture = make_architecture(section.kind, section.options)
    try:
        given = architecture.arrange(Field(site))
    except ScenarioError:
        raise
    except Exception as error:  # a user's class may raise anything
        what = f"{type(error).__name__}: {error}"
        raise ScenarioError(what, key=f"architecture '{section.kind}': arrange") from error
    arranged = checked(section.kind, given, site)
    views = tuple(View(name, tuple(sources)) for name, sources in arranged.views.items())
    whole = Built(site, tuple(arranged.processes), views, arranged.schedule)
    if isinstance(site.scenario.camera, EviD30) and not any(p.role == GATEWAY for p in whole.processes):
        what = f"is {site.scenario.camera.kind!r}, and architecture {section.kind} has no gateway to it"
        raise ScenarioError(what, key="camera.kind", expected="'none', or architecture 'cpa'")
    if site.scenario.fusion.smooth_rts and not whole.smoothers:
        what = f"is true, and architecture {section.kind} has no base that is told of tracks and smooths them"
        raise ScenarioError(what, key="fusion.smooth_rts", expected="false, or fusion.smooth_lag for a fusion centre")
    return whole
