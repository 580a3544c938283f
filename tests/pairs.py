"""An architecture in which one process has several roles: the node in the middle is the field's fusion centre, too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import trackfield as tf
from tests.strangers import Hello, Herald
from trackfield.role import NS, Effect, Event, Ignored, Received, SetTimer, Started, Store, Timer
from trackfield.wire.registry import kind_of_class


class Tally:
    """Counts hellos, keeps their number beyond its life, and has no use for those before number ``since``."""

    def __init__(self, *, since: int) -> None:
        self.since, self.kinds = since, frozenset({kind_of_class(Hello).name})

    def begin(self) -> int:
        return 0

    def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
        match event:
            case Started(now, stored):
                return int(stored or b"0"), (SetTimer("store", now + NS),)
            case Received(_, Hello(number)):
                return (state + 1, ()) if number >= self.since else (state, (Ignored("early"),))
            case Timer(now):
                return state, (Store(b"%d" % state), SetTimer("store", now + NS))
        raise AssertionError(event)


@dataclass(frozen=True)
class Paired:
    """A head is a node, a fusion centre and a tally of what the base says to it; all ask the base for the time.

    ``roles`` are more roles of the head, or others of these names; ``changes`` what else is other than usual about it.
    """

    roles: Mapping[Any, Any] | None = None
    changes: Mapping[str, Any] | None = None

    def arrange(self, field: tf.Field) -> tf.Arranged:
        ids = [id for id, *_ in field.sensors]
        head = ids[len(ids) // 2]
        nodes = {node.id: node for node in field.sensor_nodes(head, asks="base")}
        node = nodes.pop(head)
        centre = field.fusion_centre(head, node.x, node.y, ids)
        roles = {
            "node": tf.Hosted(config=node.config, clock="follows"),
            "fusion": tf.Hosted(config=centre.config, fuses=True, clock="keeps"),
            "tally": tf.Hosted(Tally, {"since": 2}),
            **(self.roles or {}),
        }
        several = replace(node, role="head", config={}, sends={}, fuses=ids, tags=("tracks", "battery"), roles=roles)
        several = replace(several, **(self.changes or {}))
        base = tf.Process("base", "herald", *field.centre, Herald, {"to": [head]}, sends={"hello": [head]})
        return tf.Arranged([base, several, *nodes.values()], {"base": [head]})
