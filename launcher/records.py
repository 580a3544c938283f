"""What passes between the parts of the launcher: the plan of a run, and what the recorder settles of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.filters.metrics import LOST_M
from trackfield.link.places import Path as Legs
from trackfield.world.path import Path


@dataclass(frozen=True, slots=True)
class Place:
    """A process of the field and where it stands (metres, east and north)."""

    id: str
    role: str
    x: float
    y: float


@dataclass(frozen=True, slots=True)
class FieldInfo:
    """What a picture of the run needs besides its events.

    ``truth`` holds (t s, x m, y m) along the target's path; ``gaps`` the (from s, to s) that were interpolated;
    ``marks`` the planned faults, (t s, process, text); ``receptions`` the links used, (from, to, share of the
    frames that arrive); ``paths`` where those go that move, as ``trackfield/link/places.py`` has it.
    """

    run: str
    scenario: str
    places: tuple[Place, ...]
    truth: tuple[tuple[float, float, float], ...]
    gaps: tuple[tuple[float, float], ...]
    trackers: tuple[str, ...]
    end_s: float
    marks: tuple[tuple[float, str, str], ...] = ()
    receptions: tuple[tuple[str, str, float], ...] = ()
    paths: tuple[tuple[str, Legs], ...] = ()


RECORDER: Final = "recorder"
"""The id of the process that writes a run down."""
LIVE: Final = "live"
"""The id of the one that shows it while it goes on."""
Payload = bytes
"""``MessageRow`` has a field named ``bytes``."""
ARRIVED: Final = ("delivered", "late", "ignored")
"""Outcomes of frames that reached their hearer, of use or not."""


@dataclass(frozen=True, slots=True)
class MessageRow:
    """One (frame, hearer) with its settled outcome; a row of messages.parquet.

    ``outcome`` is ``delivered``, ``late`` or ``ignored`` (all of them delivered), or a cause of loss:
    ``partition``, ``radio``, ``in_flight``, ``dead``, ``frozen``, ``asleep``, ``overflow``, ``host_lost``.
    ``text`` is the decoded message for a person; ``bearing_deg`` (clockwise from north) and ``step`` are those
    of a DOA report; ``local_ns`` is the sender's own clock at ``sent_ns``, where it is known. ``payload`` is the
    message as it was sent.
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
    bearing_deg: float | None = None
    step: int | None = None
    local_ns: int | None = None
    payload: Payload = b""

    @property
    def delivered(self) -> bool:
        """Whether the frame reached its hearer, of use or not."""
        return self.outcome in ARRIVED


@dataclass(frozen=True, slots=True)
class Plan:
    """A run, ready to be driven: the same for both drivers.

    ``processes`` has a process that lives several times as often, one life after the other. ``reach_m`` is how far away
    a sensor reports the target; ``restart`` says that processes which die unplanned are started again; ``lost_m`` is
    how far off a track may end without being lost.
    """

    run: RunSpec
    processes: tuple[ProcessSpec, ...]
    path: Path
    info: FieldInfo
    step_ns: int
    reach_m: float = 0.0
    restart: bool = False
    lost_m: float = LOST_M
