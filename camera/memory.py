"""What camera control remembers: in its life, and for the next one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, field, replace
from math import isfinite
from typing import Any, Final

import msgpack

from camera.fixes import Target
from camera.line import Line
from trackfield.protocols.timesync import Timekeeping
from trackfield.role import Effect

VERSION: Final = 1
KNOWN: Final = 32
"""So many items and fixes are known again."""
USED: Final = 8
"""Of so many fixes that were used it is known when an older one of the same target comes."""
MOST_WAITING: Final = 4
"""So many targets wait for the camera at most."""
_TARGET: Final = (str, int, int, int, int, int, list, float, float)


@dataclass(frozen=True, slots=True)
class Watch:
    """The target that the camera is for: the ``shot`` (0: not told yet), for when it is aimed, and when it is over.

    ``aim_ns`` is a time of the run, ``until_ns`` a local one. ``failures`` counts the turns that failed.
    """

    target: Target
    shot: int = 0
    aim_ns: int = 0
    until_ns: int = 0
    failures: int = 0


@dataclass(frozen=True, slots=True)
class Memory:
    """The state of camera control.

    ``items`` (life of the gateway, number) and ``fixes`` (head, event, step) are the last ones that came, ``used`` the
    last fixes that the camera was told of or waits with. ``watch`` is for whom the camera is, ``waiting`` who comes
    after that. The video of ``filmed``, which lasts ``film_s``, was asked for and is not over (0: none); ``again`` if
    twice. ``asks`` counts subscriptions. ``due_ns`` is the timer of the line, ``said`` the state that was told last.
    """

    time: Timekeeping = field(default_factory=Timekeeping)
    line: Line = field(default_factory=Line)
    items: tuple[tuple[int, int], ...] = ()
    fixes: tuple[tuple[str, int, int], ...] = ()
    used: tuple[Target, ...] = ()
    watch: Watch | None = None
    waiting: tuple[Target, ...] = ()
    shots: int = 0
    filmed: int = 0
    film_s: float = 0.0
    again: bool = False
    asks: int = 0
    due_ns: int | None = None
    said: str = ""


Step = tuple[Memory, tuple[Effect, ...]]


def pack(memory: Memory) -> bytes:
    """For the next life: what came, how many shots there were, and who is waited for."""
    targets = [*([memory.watch.target] if memory.watch else []), *memory.waiting]
    packed: bytes = msgpack.packb(
        (VERSION, memory.items, memory.fixes, memory.shots, [astuple(one) for one in targets[: 1 + MOST_WAITING]])
    )
    return packed


def unpack(stored: bytes) -> Memory:
    """What an earlier life stored; the targets wait. Raises ``ValueError`` with a reason for other bytes."""
    try:
        version, items, fixes, shots, targets = msgpack.unpackb(stored)
        pairs = tuple(_typed(one, (int, int)) for one in items)
        keys = tuple(_typed(one, (str, int, int)) for one in fixes)
        waiting = tuple(_target(one) for one in targets)
    except (ValueError, TypeError, msgpack.UnpackException) as error:
        raise ValueError(f"not what camera control stores: {error}") from None
    if version != VERSION or type(shots) is not int or shots < 0:
        raise ValueError(f"version {version}, {shots} shots")
    return Memory(items=pairs, fixes=keys, shots=shots, waiting=waiting, used=waiting)


def _typed(values: Any, types: Sequence[type]) -> Any:
    if [type(one) for one in values] != list(types):
        raise ValueError(f"{values!r}")
    return tuple(values)


def _target(values: Any) -> Target:
    head, number, step, at_ns, cpa_ns, came_ns, state, sd_m, sd_m_s = _typed(values, _TARGET)
    state = _typed(state, (float,) * 4)
    if not all(map(isfinite, (*state, sd_m, sd_m_s))):
        raise ValueError("a target that is nowhere")
    return Target(head, number, step, at_ns, cpa_ns, came_ns, state, sd_m, sd_m_s)


def with_fix(memory: Memory, target: Target) -> Memory:
    """With one more that was used."""
    return replace(memory, used=(*memory.used, target)[-USED:])


def without(targets: Iterable[Target], target: Target) -> tuple[Target, ...]:
    """Those that are not the same target."""
    return tuple(one for one in targets if not one.same(target))
