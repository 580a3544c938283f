"""Field and network at each instant: what is at rest is drawn once, all else at each change."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from math import isfinite, nan
from typing import Any, Final

import numpy as np

from launcher.records import SENSES, FieldInfo
from launcher.timeline import look, rows
from launcher.timeline.layers import READINGS, camera, clusters, heads, hearing
from launcher.timeline.layers.closeup import Closeups
from launcher.timeline.scene import Add, Shown, Sight, crosses, extent, spacing
from trackfield.sensing.kinds import known_kind

PACE_NS: Final = 400_000
"""A layer of n points is drawn at most once in n times this: files grow with what happens, not with the field."""
CENTRE_CROSS: Final = 2.0
"""Size of the cross on a dead centre over that on a dead sensor, as for their dots."""


class Picture:
    """Draws what is in ``shown``, as rows that it hands to ``add``.

    Kinds of things shown, with their keys and values: ``state`` process -> name, while it is at work; ``battery``
    process -> share, while low; ``lost`` process -> True; ``edge`` (from, to) -> True; ``reading`` process -> its
    numbers; ``fix`` tracker -> (x, y) m; ``size`` (target, tracker, source) -> m that a close-up is to reach; ``mark``
    (process, text) -> colour. ``words`` holds the texts of the lane of marks so far, and the colour of each.
    """

    def __init__(self, info: FieldInfo, add: Add) -> None:
        self.shown = Shown()
        self.words: dict[str, int] = {}
        self._add = add
        self._places = {place.id: (place.x, place.y) for place in info.places}
        self._sensors = {place.id for place in info.tagged(SENSES)}
        self._others = self._places.keys() - self._sensors
        self._whole = list(look.graph_positions(info)) if len(info.places) <= look.WHOLE_NETWORK else []
        self._reach = extent(info) / 4
        self._closeups = Closeups(info, add)
        self.clusters = clusters.Clusters(info, self.shown, add)
        self.heads = heads.Heads(info, self.shown, add)
        self.hearing = hearing.Hearing(info, self.shown, add)
        self.beyond = camera.Beyond(info, self.shown, add)
        self._spacing = spacing(info)
        self._cross = 0.16 * self._spacing
        self._still = self._places.keys() - {id for id, _ in info.paths}
        self._layer_of, self._sensing = info.layers, info.sensing
        self._working: dict[str, int] = {}  # sensors that neither rest nor are dead, and their colours
        self._dead: set[str] = set()
        self._links = bool(info.receptions)
        self._layers: dict[str, Callable[[int], int]] = {
            "working": self._draw_working,
            "dead": self._draw_dead,
            "battery": self._draw_batteries,
            "nodes": self._draw_nodes,
            "edge": self._draw_edges,
            "lost": self._draw_lost,
            "reading": self._draw_readings,
            "mark": self._draw_marks,
            "size": lambda t_ns: self._closeups.until(t_ns, self.shown.now["size"]),
            **{kind: partial(self.clusters.draw, kind) for kind in clusters.KINDS if self.clusters.here},
            **{kind: partial(self.heads.draw, kind) for kind in heads.KINDS if self.heads.here},
            **{kind: partial(self.hearing.draw, kind) for kind in hearing.KINDS if self.hearing.here},
            **({"item": self.beyond.draw} if self.beyond.here else {}),
        }
        self._stale: set[str] = {"nodes"}
        self._next_ns = dict.fromkeys(self._layers, 0)
        self._pace_ns = PACE_NS
        self.shown.show("again", "", True, 0)  # a first picture, all at rest

    def settle(self, until_ns: float) -> None:
        """Draws all that changes up to a time."""
        for t_ns, changed in self.shown.until(until_ns):
            self._note(changed)
            self._draw(t_ns)

    def close(self, end_ns: float) -> None:
        """Draws all that remains, but nothing after the end."""
        self._pace_ns = 0
        self._next_ns = dict.fromkeys(self._layers, 0)
        self._draw(self.shown.last_ns)
        self.settle(end_ns)

    def _note(self, changed: dict[str, set[Any]]) -> None:
        """Note which layers are out of date."""
        states = self.shown.now["state"]
        for name in changed.get("state", set()) & self._still:
            if (states.get(name) == look.DEAD) != (name in self._dead):
                self._dead ^= {name}
                self._stale.add("dead")
        for name in changed.get("state", set()) & self._sensors:
            state = states.get(name)
            colour = None if state in (None, look.DEAD) else look.state_colour(state)
            if self._working.get(name) != colour:
                self._stale.add("working")
            if colour is None:
                self._working.pop(name, None)
            else:
                self._working[name] = colour
        if changed.keys() & ({"state", "lost"} if self._whole else {"state", "lost", "edge"}):
            self._stale.add("nodes")
        self._stale |= changed.keys() & self._layers.keys()

    def _draw(self, t_ns: int) -> None:
        for layer in sorted(self._stale):
            due_ns = self._next_ns[layer]
            if due_ns > t_ns:
                self.shown.show("again", layer, True, due_ns, due_ns + 1)
                continue
            self._next_ns[layer] = t_ns + self._pace_ns * self._layers[layer](t_ns)
            self._stale.discard(layer)

    # --- layers: each draws itself and says how many points that took -------------------------------------

    def _draw_working(self, t_ns: int) -> int:
        return self._dots("/field/working", t_ns, self._working.items())

    def _draw_batteries(self, t_ns: int) -> int:
        known = [(name, look.share_colour(share / look.LOW / 2)) for name, share in self.shown.now["battery"].items()]
        return self._dots("/field/battery", t_ns, (one for one in known if one[0] in self._places))

    def _dots(self, path: str, t_ns: int, found: Iterable[tuple[str, int]]) -> int:
        dots = sorted(found)
        at = np.reshape([self._places[name] for name, _ in dots], (-1, 2))
        self._add(path, rows.dots, t_ns, (at, [colour for _, colour in dots]))
        return len(dots)

    def _draw_dead(self, t_ns: int) -> int:
        names = sorted(self._dead)
        at = np.reshape([self._places[name] for name in names], (-1, 2))
        sizes = self._cross * np.array([1.0 if name in self._sensors else CENTRE_CROSS for name in names])
        self._add("/field/dead", rows.strips, t_ns, crosses(at, sizes))
        return len(at)

    def _draw_nodes(self, t_ns: int) -> int:
        names = self._whole or self._involved()
        states, lost = self.shown.now["state"], self.shown.now["lost"]
        colours = [look.LOST if name in lost else look.state_colour(states.get(name, look.REST)) for name in names]
        if self._whole:
            self._add("/network", rows.node_colours, t_ns, colours)
        else:
            self._add("/network", rows.nodes, t_ns, (names, colours))
        return len(names)

    def _draw_lost(self, t_ns: int) -> int:
        at = np.reshape([self._places[name] for name in sorted(self.shown.now["lost"])], (-1, 2))
        if self._links:
            self._add("/links/lost", rows.points, t_ns, at)
        return len(at)

    def _involved(self) -> list[str]:
        """The places that work, send or receive, and those without a sensor."""
        ends = {name for edge in self.shown.now["edge"] for name in edge}
        return sorted(self._others.union(ends, self._working, self.shown.now["lost"]))

    def _draw_edges(self, t_ns: int) -> int:
        edges = np.reshape(np.array(sorted(self.shown.now["edge"]), np.str_), (-1, 2))
        self._add("/network", rows.edges, t_ns, edges)
        if self._links:
            at = np.reshape([self._places[end] for edge in edges.tolist() for end in edge], (-1, 2, 2))
            self._add("/links/frames", rows.strips, t_ns, at)
        return len(edges)

    def _draw_readings(self, t_ns: int) -> int:
        now, drawn = self.shown.now, 0
        numbers = {id: self._number(id, values) for id, values in now["reading"].items()}
        sight = Sight(self._places, now["fix"].values(), self._reach, self._spacing)
        for name in sorted(set(self._layer_of.values())):
            layer = READINGS[name]
            mine = {id: one for id, one in numbers.items() if self._layer_of[id] == name and isfinite(one)}
            found = layer.shapes(mine, sight)
            self._add(f"/field/{name}", layer.columns, t_ns, found)
            drawn += len(found)
        return drawn

    def _number(self, id: str, values: Sequence[float]) -> float:
        """The number of a reading that is drawn; NaN if its kind cannot say it."""
        sensing = self._sensing.get(id)
        if sensing is None:
            return values[0]
        try:
            kind = known_kind(**sensing)
            return float(kind.drawn(kind.corrected(values, id)))
        except Exception:  # noqa: BLE001  a user's own method, and numbers from anybody
            return nan

    def _draw_marks(self, t_ns: int) -> int:
        marks = self.shown.now["mark"]
        word = next((f"{process}: {text}" for process, text in marks), "")
        if len(marks) > 1:
            word += f" and {len(marks) - 1} more"
        if word:
            self.words[word] = look.LOST if look.LOST in marks.values() else look.LATE
        self._add("/faults", rows.states, t_ns, word)
        return len(marks)
