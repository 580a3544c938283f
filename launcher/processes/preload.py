"""What the zygotes of a run import for their children, and which children need the heavy one.

A role that computes for long at a time needs numpy, which a sensor node must not carry, unless its sensor listens,
sample by sample. Such nodes, and two such roles or more, are forked from a zygote of their own that has it: they share
its memory, and none spends time on the import.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

from trackfield.drivers.spec import ProcessSpec, role_places
from trackfield.sensing.kinds import known_kind

NODE: Final = "node.role:Node"
REHEARSAL: Final = "launcher.processes.rehearsal:a_node"
"""What children that are such nodes would all do for the first time."""


class Preload(NamedTuple):
    """What each zygote imports.

    A process whose role comes from ``factories``, or whose sensor needs modules, is forked from the heavy one, if that
    has anything to import: else there is none.
    """

    light: tuple[str, ...]
    heavy: tuple[str, ...] = ()
    factories: frozenset[str] = frozenset()

    def is_heavy(self, life: ProcessSpec) -> bool:
        """Whether a process is forked from the heavy zygote."""
        return bool(self.heavy) and (life.factory in self.factories or bool(_of_sensor(life)))


def preload_of(lives: Sequence[ProcessSpec]) -> Preload:
    """The preload of a run with these lives. Start of a second zygote pays from two heavy lives on."""
    computing = frozenset(life.factory for life in lives if life.sink)
    sensing = [(life.factory, _of_sensor(life)) for life in lives if life.factory not in computing]
    listening = {factory for factory, modules in sensing if modules}
    heavy = [life.factory for life in lives if life.factory in computing]
    light = {factory for factory, modules in sensing if not modules}
    rehearsal = (REHEARSAL,) if NODE in light else ()
    needed = sorted({module for life in lives for module in _of_sensor(life)})
    if len(heavy) < 2 and not needed:
        return Preload((*_modules(light), *rehearsal))
    return Preload((*_modules(light), *rehearsal), (*_modules({*heavy, *listening}), *needed), computing)


def _of_sensor(life: ProcessSpec) -> tuple[str, ...]:
    """What a process needs for its sensor."""
    sound = life.sound
    return known_kind(sound["kind"], sound["options"], recorded="times" in sound).modules if sound else ()


def _modules(factories: Iterable[str]) -> tuple[str, ...]:
    places = {place for factory in factories for place in role_places(factory).values()}
    return tuple(sorted({place.partition(":")[0] for place in places}))
