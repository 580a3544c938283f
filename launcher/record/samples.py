"""The content of telemetry and orders, parsed into types: what passes here can be recorded, whoever sent it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Annotated, Any, Final, Literal, get_type_hints

from annotated_types import Ge, Le, MinLen
from pydantic import BaseModel, ConfigDict, InstanceOf, TypeAdapter

from trackfield.drivers.engine.frames import Charge, Died, EventKey, Frame, Overflowed, Queued, Refused, Told, Undone
from trackfield.drivers.exchange.intake import read, unpacked
from trackfield.drivers.exchange.telemetry import Telemetry
from trackfield.drivers.spec import ProcessSpec
from trackfield.role import Corrected, Listen, Note, Publish, Radio, State, Tell, TrackPoint, Write, formed
from trackfield.wire.error import WireError
from trackfield.wire.keys import Medium, check_id
from trackfield.wire.registry import check_size

MAX_EVENT: Final = 256 * 1024
"""The largest telemetry of one event (bytes): a point with its particles and the ids of thousands of sensors."""
MAX_NS: Final = 2**62
"""Beyond any instant of a run."""

Count = Annotated[int, Ge(0), Le(2**63 - 1)]
Values = tuple[int | float | str, ...]
"""Of a ``Tell``."""
Small = Annotated[int, Ge(-(2**31)), Le(2**31 - 1)]
"""Fits a column of 32 bits."""
Ns = Annotated[int, Ge(-MAX_NS), Le(MAX_NS)]
Five = tuple[Ns, Ns, Ns, Ns, Ns]
"""Of an ``Activity``; time is negative while a frame is under way that was counted as a whole."""
_TOLD: Final = tuple[Ns | InstanceOf[float] | str, ...]
"""``Values``, of which an int that is too large is no float."""
Buckets = dict[Annotated[int, Ge(-1000), Le(1000)], Count]
"""Of a ``Histogram``: a duration of exp(1000 / 20) ns is beyond any."""

_KEY: Final = TypeAdapter[EventKey](
    tuple[Ns, Literal[0], str]
    | tuple[Ns, Literal[1], str, str, Ns, Count, Count, str, str]
    | tuple[Ns, Literal[2], Count, str]
    | tuple[Ns, Literal[3], Ns, str]
    | tuple[Ns, Literal[4]]
)
_STRICT: Final = ConfigDict(strict=True, extra="forbid", frozen=True)


class Record(BaseModel):
    """The final record of a life (``Process.record``); counts that depend on the role are in ``model_extra``.

    A process that is no part of Trackfield need not say more than how many frames it ``sent``, how many ``puts`` they
    were, and how many events it ``told``: what it leaves out is not compared with what was seen.
    """

    model_config = ConfigDict(strict=True, extra="allow", frozen=True)
    __pydantic_extra__: dict[str, Count]

    sent: Count
    puts: Count
    told: Count
    sent_hash: Count = 0
    heard: Count = 0
    heard_hash: Count = 0
    retractions: Count = 0
    incarnation: Count = 0
    stored: bytes = b""
    activity: Annotated[dict[Medium, Five], MinLen(1)] = {}
    inherited: dict[Medium, Five] = {}
    metered_ns: Ns = 0
    slip: Buckets = {}
    lag: Buckets = {}
    latency: Buckets = {}
    cpu_s: Annotated[float, Ge(0.0), Le(1e9)] = 0.0
    roles: dict[str, dict[Literal["delivered", "ignored"], Count]] = {}


class Status(BaseModel):
    """What the recorder reports while a run goes on, as the live table shows it."""

    model_config = _STRICT

    t_s: float
    sent: Count
    outcomes: dict[str, Count]
    states: dict[str, Count]
    errors: dict[str, float | None]


_COUNTS: Final = TypeAdapter(dict[str, Count])
_DEATHS: Final = TypeAdapter(tuple[tuple[str, float | None, str], ...])
_REFUSALS: Final = TypeAdapter(tuple[tuple[str, str, Annotated[int, Ge(1), Le(2**40)]], ...])
_MARK: Final = TypeAdapter(Ns)
_COLUMNS: Final = {
    **dict.fromkeys(("step", "known_step"), Small | None),
    **dict.fromkeys(("lag", "term"), Small),
    "event_ns": Ns | None,
}


def _values(kind: type) -> TypeAdapter[Any]:
    """Parses the fields of a flat dataclass, in their order."""
    assert is_dataclass(kind)
    hints = get_type_hints(kind)
    bounded = {int: Ns, tuple[float, ...]: tuple[float, ...], Medium: Medium, Values: _TOLD}
    types = [_COLUMNS.get(f.name) or bounded.get(hints[f.name], hints[f.name]) for f in fields(kind)]
    together: Any = tuple.__class_getitem__(tuple(types))
    return TypeAdapter(together)


_PLAIN: Final = {
    kind.__name__.lower(): kind for kind in (State, Radio, Listen, Note, Tell, Corrected, Write, Died, Charge, Queued)
}
_FIELDS: Final = {kind: _values(kind) for kind in (*_PLAIN.values(), TrackPoint, Frame)}


def event_of(data: bytes) -> Telemetry:
    """One piece of telemetry, the inverse of ``trackfield.drivers.exchange.telemetry.pack``. Raises ``WireError``."""
    return read(_event, unpacked(data, MAX_EVENT))


def _event(told: Any) -> Telemetry:
    name, key, *values = told
    key = _KEY.validate_python(key, strict=True)
    match name:
        case "publish":
            return Told(key, Publish(_point(_made(TrackPoint, values))))
        case "overflowed":
            return Told(key, Overflowed(_frame(_made(Frame, values))))
        case "refused":
            (reason,) = values
            return Refused(key, TypeAdapter(str).validate_python(reason, strict=True))
        case "undone" if not values:
            return Undone(key)
    return Told(key, _made(_PLAIN[name], values))


def _made(kind: Any, values: list[Any]) -> Any:
    return kind(*_FIELDS[kind].validate_python(tuple(values), strict=True))


def _point(point: TrackPoint) -> TrackPoint:
    formed(point)
    if point.origin:
        check_id(point.origin)
    return point


def _frame(frame: Frame) -> Frame:
    for id in (frame.src, frame.kind):
        check_id(id)
    check_size(frame.kind, len(frame.payload))
    return frame


def counts_of(data: bytes) -> dict[str, int]:
    """A life's counters so far. Raises ``WireError``."""
    return read(_COUNTS.validate_python, unpacked(data, MAX_EVENT))


def final_of(data: bytes) -> dict[str, Any]:
    """A life's final record, with the keys that it has. Raises ``WireError``."""
    return read(Record.model_validate, unpacked(data)).model_dump(exclude_unset=True)


def status_of(data: bytes) -> dict[str, Any]:
    """The recorder's status. Raises ``WireError``."""
    return read(Status.model_validate, unpacked(data, MAX_EVENT)).model_dump()


def deaths_of(data: bytes) -> list[tuple[str, float | None, str]]:
    """The unplanned deaths of a run, from the launcher. Raises ``WireError``."""
    return list(read(_DEATHS.validate_python, unpacked(data)))


def life_of(data: bytes, factories: Mapping[str, str]) -> ProcessSpec:
    """An unplanned life, from the launcher; ``factories`` are by id. Raises ``WireError``."""
    plain = unpacked(data)
    return read(lambda: ProcessSpec.from_plain(plain, factories[plain["id"]]))


def mark_of(data: bytes) -> int:
    """The emulated time (ns) of a mark in a recorder's log; before the start it is negative. Raises ``WireError``."""
    if len(data) > len(str(-MAX_NS)):
        raise WireError("size", f"{len(data)} bytes of a time")
    return read(lambda: _MARK.validate_python(int(data)))


def refusals_of(data: bytes) -> tuple[tuple[str, str, int], ...]:
    """How many samples a recorder refused: (plane, reason, how many), from its log. Raises ``WireError``."""
    return read(lambda: _REFUSALS.validate_python(unpacked(data, MAX_EVENT), strict=True))
