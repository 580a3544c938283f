"""Any role, with its messages to and from a base going over a collection tree of several hops.

What the role sends to the base, or as the base to others, goes over the tree (``collection``), and every process hands
on what comes of others. The role sees none of that: it gets ``Received`` from whoever sent the message first, and its
timers, sensors, ports, stored bytes and broadcasts are its own. As in a ``trackfield.host.Host``, the receiver of the
radio is on as long as anybody wants it on: here always, as others' messages may come at any time.
"""

from __future__ import annotations

from collections.abc import Collection as Names
from dataclasses import dataclass, replace
from typing import Any, Final

from trackfield.link.fate import FIELD
from trackfield.protocols.collection.piece import Collection, Step, Tree
from trackfield.role import (
    NEIGHBOURHOOD,
    CancelTimer,
    Effect,
    Event,
    Ignored,
    Listen,
    Radio,
    Received,
    Role,
    Send,
    SetTimer,
    Started,
    Timer,
)
from trackfield.wire.codec import kind_name

PREFIX: Final = "tree:"
"""Before the names of the tree's timers; no role of a ``Host`` has a colon in its name."""


@dataclass(frozen=True, slots=True)
class Wrapped:
    """The state of the role, and that of the tree."""

    role: Any
    tree: Tree


class Collected:
    """The ``role`` of process ``id`` in a tree to the ``base``; ``tree`` are further arguments of ``Collection``.

    Messages of the kinds in ``direct`` do not go over the tree: they are for neighbours.
    """

    def __init__(self, role: Role[Any], *, id: str, base: str, direct: Names[str] = (), **tree: Any) -> None:
        self.role, self.base, self.direct = role, base, frozenset(direct)
        self.tree = Collection(id=id, base=base, **tree)
        self.kinds = frozenset(role.kinds) | self.tree.kinds
        self.follows = bool(getattr(role, "follows", False))

    def begin(self) -> Wrapped:
        """The state before ``Started``."""
        return Wrapped(self.role.begin(), self.tree.begin())

    def handle(self, state: Wrapped, event: Event) -> tuple[Wrapped, tuple[Effect, ...]]:
        """See ``trackfield.role.Role``."""
        match event:
            case Started():
                state, effects = self._led(state, self.tree.handle(state.tree, event))
                state, more = self._told(state, event)
                return state, (*effects, *more)
            case Timer(now, name) if name.startswith(PREFIX):
                own = Timer(now, name.removeprefix(PREFIX))
                return self._led(state, self.tree.handle(state.tree, own))
            case Received(message=message) if kind_name(message) in self.tree.kinds:
                return self._led(state, self.tree.handle(state.tree, event))
        return self._told(state, event)

    def _led(self, state: Wrapped, step: Step) -> tuple[Wrapped, tuple[Effect, ...]]:
        """The effects of a step of the tree; a message that arrived by it is the role's."""
        state, effects = replace(state, tree=step.tree), tuple(_named(effect) for effect in step.effects)
        if step.arrived is None:
            return state, effects
        if kind_name(step.arrived.message) not in self.role.kinds:
            return state, (*effects, Ignored("unexpected"))
        state, more = self._told(state, step.arrived)
        return state, (*effects, *more)

    def _told(self, state: Wrapped, event: Event) -> tuple[Wrapped, tuple[Effect, ...]]:
        """The role handles an event; what it sends is put on its way."""
        role, asked = self.role.handle(state.role, event)
        state, effects = replace(state, role=role), list[Effect]()
        for effect in asked:
            match effect:
                case Send(medium=medium) if medium == FIELD:
                    state, more = self._sent(state, event.now, effect)
                    effects += more
                case Radio(medium=medium) | Listen(medium=medium) if medium == FIELD:
                    pass
                case _:
                    effects.append(effect)
        return state, tuple(effects)

    def _sent(self, state: Wrapped, now: int, send: Send) -> tuple[Wrapped, list[Effect]]:
        """Messages to the base, and those of the base, go over the tree."""
        if send.to == NEIGHBOURHOOD or kind_name(send.message) in self.direct:
            return state, [send]
        ids = {send.to} if isinstance(send.to, str) else set(send.to)
        far = ids - {self.tree.id} if self.tree.root else ids & {self.base}
        if not far:
            return state, [send]
        effects = list[Effect]()
        for id in sorted(far):
            step = self.tree.send(state.tree, now, send.message, id if self.tree.root else "")
            state, more = self._led(state, step)
            effects += more
        if near := ids - far:
            effects.append(replace(send, to=frozenset(near)))
        return state, effects


def _named(effect: Effect) -> Effect:
    return replace(effect, name=PREFIX + effect.name) if isinstance(effect, SetTimer | CancelTimer) else effect
