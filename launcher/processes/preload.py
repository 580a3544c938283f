"""What the zygotes of a run import for their children, and which children need the heavy one.

A role that computes for long at a time needs numpy, which a sensor node must not carry. Two such processes or more are
forked from a zygote of their own that has it: they share its memory, and none spends time on the import.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

from trackfield.drivers.spec import ProcessSpec, role_places

NODE: Final = "node.role:Node"
REHEARSAL: Final = "launcher.processes.rehearsal:a_node"
"""What children that are such nodes would all do for the first time."""


class Preload(NamedTuple):
    """What each zygote imports; a process whose role comes from ``factories`` is forked from the heavy one.

    Without any of these there is no heavy zygote.
    """

    light: tuple[str, ...]
    heavy: tuple[str, ...] = ()
    factories: frozenset[str] = frozenset()


def preload_of(lives: Sequence[ProcessSpec]) -> Preload:
    """The preload of a run with these lives. Start of a second zygote pays from two heavy lives on."""
    computing = frozenset(life.factory for life in lives if life.sink)
    heavy = [life.factory for life in lives if life.factory in computing]
    light = {life.factory for life in lives} - computing
    rehearsal = (REHEARSAL,) if NODE in light else ()
    if len(heavy) < 2:
        return Preload((*_modules(light), *rehearsal))
    return Preload((*_modules(light), *rehearsal), _modules(heavy), computing)


def _modules(factories: Iterable[str]) -> tuple[str, ...]:
    places = {place for factory in factories for place in role_places(factory).values()}
    return tuple(sorted({place.partition(":")[0] for place in places}))
