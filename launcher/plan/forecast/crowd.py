"""How full the channel will be, and what that will do to reports: some of them sent on trial, at their own instants.

The draws of a frame do not depend on the run in which it is sent. So reports on trial leave, wait and overlap as those
of the run will; what else the field sends is left out.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from launcher.plan.air import Air, Due, air_of, flatters
from launcher.plan.forecast.heard import Heard
from launcher.plan.forecast.tree import ACK, HOP, TURN, Tree
from launcher.records import Plan
from trackfield.drivers.spec import link_of, places_of
from trackfield.link.fate import Link, Transmission
from trackfield.protocols.collection.traffic import MOST_TRIES
from trackfield.role import NEIGHBOURHOOD, NS
from trackfield.wire.codec import encode
from trackfield.wire.registry import kind_of

MOST_TRIED: Final = 3000
"""Reports sent on trial, about; of a run with more, single seconds, evenly spread, and the one with most reports."""


@dataclass(frozen=True)
class Crowd:
    """The ``air`` of the reports on trial, of whom the link lost ``lost``. They are one in ``every`` of all.

    ``use_mean`` is the share of the run in which some report is on the air at ``busiest``, where it is largest;
    ``use_peak`` that of the busiest second at any process.
    """

    air: Air
    lost: int
    every: float
    use_mean: float
    use_peak: float
    busiest: str

    @property
    def overlapped(self) -> float:
        """The share of the reports that overlap another one at their receiver."""
        return self.air.overlapped / self.air.expected

    @property
    def spared(self) -> float:
        """The share of the reports that the model will deliver, and that would be lost."""
        return self.air.spared / self.air.expected

    @property
    def flatters(self) -> bool:
        """Whether the losses of the run will be a fiction, as its report will say."""
        spared, lost, expected = (self.every * n for n in (self.air.spared, self.lost, self.air.expected))
        return flatters(spared, lost, round(expected), self.use_mean, self.air.use_limit)


class _Way(NamedTuple):
    """A message of this kind and size, to one address, for all of ``hearers``; over a ``tree``, if it goes there."""

    kind: str
    size: int
    to: str
    hearers: tuple[str, ...]
    medium: str
    tree: Tree | None = None


@dataclass
class _Trial:
    """The frames that are sent on trial, in the order of reports; each radio sends one at a time."""

    link: Link
    frames: list[Transmission] = field(default_factory=list)
    dues: list[Due] = field(default_factory=list)
    lost: int = 0
    _free_ns: dict[tuple[str, str], int] = field(default_factory=dict)

    def report(self, id: str, way: _Way, t_ns: int) -> None:
        """Send a report of this sensor, which is made then."""
        if way.tree is None:
            self._send(Transmission(id, way.to, way.kind, t_ns, 0, way.size, False, way.medium), way.hearers)
            return
        for src, dst in way.tree.way(id, way.to):
            for _ in range(MOST_TRIES):
                arrives_ns = self._send(Transmission(src, dst, HOP, t_ns, 0, way.tree.sizes[HOP]), (dst,))
                if arrives_ns is not None:
                    self._send(Transmission(dst, src, ACK, arrives_ns, 0, way.tree.sizes[ACK]), (src,))
                    t_ns = arrives_ns
                    break
                t_ns += round(TURN * way.tree.patience_ns)

    def _send(self, frame: Transmission, hearers: Sequence[str]) -> int | None:
        """When it arrives at the first of its hearers; None: it is lost."""
        radio = frame.src, frame.medium
        leaves_ns = max(frame.sent_ns, self._free_ns.get(radio, 0))
        frame = frame._replace(sent_ns=leaves_ns, broadcast=frame.dst == NEIGHBOURHOOD)
        fates = [self.link.fate(frame._replace(dst=hearer)) for hearer in hearers]
        self._free_ns[radio] = leaves_ns + fates[0].busy_ns
        self.dues += [Due(len(self.frames), to, f.cause is None) for to, f in zip(hearers, fates, strict=True)]
        self.lost += sum(fate.cause is not None for fate in fates)
        self.frames.append(frame)
        return None if fates[0].cause is not None else leaves_ns + fates[0].delay_ns


def crowd(plan: Plan, ids: Sequence[str], heard: Heard) -> Crowd | None:
    """What to expect of the reports of these sensors; None if there are none, or no radio sends them."""
    ways = _ways(plan)
    rows = _chosen(heard, plan.step_ns)
    if not ways or not len(rows):
        return None
    trial = _Trial(link_of(plan.run, plan.processes, cut=False))
    for t_ns, id in sorted(zip(heard.t_ns[rows].tolist(), (ids[i] for i in heard.sensor[rows].tolist()), strict=True)):
        for way in ways.get(id, ()):
            trial.report(id, way, _told_ns(plan, id, t_ns))
    air = air_of(trial.link, places_of(plan.processes), trial.frames, trial.dues, plan.run.end_ns)
    return (
        None if air is None or not air.expected else _scaled(air, trial.lost, len(heard.t_ns) * heard.every / len(rows))
    )


def _scaled(air: Air, lost: int, every: float) -> Crowd:
    """The same over the whole run."""
    most = max(air.uses, key=lambda use: use.mean)
    return Crowd(air, lost, every, min(every * most.mean, 1.0), max(use.peak for use in air.uses), most.id)


def _ways(plan: Plan) -> Mapping[str, Sequence[_Way]]:
    """How each sensor reports, by its id."""
    found: defaultdict[str, list[_Way]] = defaultdict(list)
    tree = Tree.of(plan)
    for flow in plan.reports:
        kind, size = kind_of(flow.message).name, len(encode(flow.message))
        hearers: defaultdict[str, list[str]] = defaultdict(list)
        for src, dst in flow.pairs:
            hearers[src].append(dst)
        for src, those in hearers.items():
            if flow.near:
                found[src].append(_Way(kind, size, NEIGHBOURHOOD, tuple(those), flow.medium))
            else:
                found[src] += [
                    _Way(kind, size, one, (one,), flow.medium, tree if flow.over_tree else None) for one in those
                ]
    return found


def _told_ns(plan: Plan, id: str, t_ns: int) -> int:
    """When a sensor reports what belongs to this step: at once, or by itself at a pass."""
    return plan.passes.get(id, {}).get(plan.step_of(t_ns), t_ns)


def _chosen(heard: Heard, step_ns: int) -> NDArray[np.intp]:
    """The rows of reports to send on trial: all, or those of whole seconds."""
    rows = np.arange(len(heard.t_ns))
    if len(rows) <= MOST_TRIED:
        return rows
    second = heard.t_ns // max(NS, step_ns)
    known, number, counts = np.unique(second, return_inverse=True, return_counts=True)
    some = np.zeros(len(known), bool)
    share = MOST_TRIED / len(rows)
    some[np.unique(np.linspace(0, len(known) - 1, max(int(share * len(known)), 1)).round().astype(int))] = True
    some[np.argmax(counts)] = True
    return rows[some[number]]
