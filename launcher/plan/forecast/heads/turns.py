"""Who leads and who is polled at a step of a field in which any node may lead, if trackers know the true path."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from head.peers.choice import DEAF, MOST_SILENT, PAUSE
from launcher.plan.forecast.masters.association import GOOD
from launcher.records import SENSES, Plan, Polls
from node.member import HOLD
from trackfield.filters.types import Array
from trackfield.link.fate import Link
from trackfield.role import NS

MOST_POLLS: Final = 1 + HOLD
"""A sensor measures at a step if it heard one of so many polls."""


class Turn(NamedTuple):
    """At a step ``leader`` leads, and the sensors ``polled`` measure; those that have a target in reach are ``sensed``,
    with its number.

    ``polls`` are how often in a row each was polled, up to the number that counts; those that are ``deaf`` hear few
    polls. ``joins`` told the leader after its poll that they sense the target. If it was elected since the step before,
    ``contenders`` took part, in the election at ``elected_ns``. After the step it hands over to ``heir``, or has
    ``lost`` the target. ``beyond`` are sensors nearer to the target than one of those polled, and out of its reach.
    """

    step: int
    t_ns: int
    leader: str
    polled: tuple[str, ...]
    sensed: Mapping[str, int]
    polls: Mapping[str, int]
    joins: tuple[str, ...] = ()
    contenders: tuple[str, ...] = ()
    elected_ns: int = 0
    heir: str = ""
    lost: bool = False
    beyond: tuple[str, ...] = ()
    deaf: tuple[str, ...] = ()

    @property
    def slots(self) -> dict[str, int]:
        """The slot of each sensor polled."""
        return {id: slot for slot, id in enumerate(self.polled)}


@dataclass
class _Leads:
    """What a leader knows: who said that it senses the target, up to which step, who is left alone up to when, and who
    did not answer how many polls in a row.
    """

    leader: int
    joined: dict[int, int] = field(default_factory=dict)
    avoided: dict[int, int] = field(default_factory=dict)
    missing: dict[int, int] = field(default_factory=dict)
    came: frozenset[int] = frozenset()
    silent: int = 0
    contenders: tuple[int, ...] = ()
    elected_ns: int = 0


@dataclass(frozen=True)
class Heads:
    """The turns of a plan. A leader polls those whose announcements it hears, and no frame is lost.

    The choice by covariance is replaced by one by distance, as nobody knows covariances before a run.
    """

    plan: Plan
    polls: Polls
    link: Link
    announce: int
    poll: int

    def turns(self) -> Iterator[Turn]:
        """Those of all steps at which somebody is polled, in their order."""
        last = (self.plan.run.end_ns - 1 - self.plan.origin_ns) // self.plan.step_ns
        leads: _Leads | None = None
        first, before, told, took_part = 0, dict[int, int](), dict[int, int](), dict[int, int]()
        for step in range(1, last + 1):
            if leads is None:
                leads = self._elected(step)
                if leads is None:
                    continue
                first, before, told = self._first(leads), {}, {}
                took_part = dict.fromkeys(leads.contenders, step + self.polls.expiry_steps)
            if step < first:
                continue
            chosen = self._chosen(leads, step, around=step == first and not self.plan.tracking.get("prior"))
            before = {i: min(before.get(i, 0) + 1, MOST_POLLS) for i in chosen}
            turn, heir = self._turn(leads, step, chosen, before, told)
            yield turn
            if turn.lost:
                leads = None
            elif heir is not None:
                leads, told = _Leads(heir, self._known(heir, told, took_part)), {}

    def close(self, id: str) -> list[str]:
        """The sensors that may measure with this one, and itself."""
        away = self._away(self.places[self.ids.index(id)])
        return [self.ids[i] for i in np.flatnonzero(away <= self.polls.peers_m).tolist()]

    def peers(self, id: str) -> list[str]:
        """Those of them whose announcements it hears, and itself."""
        return [self.ids[i] for i in sorted(self._near[self.ids.index(id)])]

    # --- elections -----------------------------------------------------------------------------------------------

    def _elected(self, step: int) -> _Leads | None:
        """Of those that sense a target then, the nearest to one will lead; None if nobody senses any."""
        sensing = self._sensing(step)
        if not sensing:
            return None
        at = self._where(step)
        away = self._away(at) if at is not None else np.zeros(len(self.ids))
        leader = min(sensing, key=lambda i: (away[i], i))
        heard = tuple(i for i in sensing if i == leader or i in self._near[leader])
        until = step + self.polls.expiry_steps
        begins_ns = self.plan.origin_ns + step * self.plan.step_ns
        others = dict.fromkeys((i for i in heard if i != leader), until)
        return _Leads(leader, others, contenders=heard, elected_ns=begins_ns)

    def _known(self, heir: int, told: Mapping[int, int], took_part: Mapping[int, int]) -> dict[int, int]:
        """Of whom a new head knows that they sense the target: itself, if it said so, and those of its own election."""
        own = {heir: told[heir]} if heir in told else {}
        if heir not in took_part:
            return own
        return own | {i: until for i, until in took_part.items() if i != heir and i in self._near[heir]}

    def _first(self, leads: _Leads) -> int:
        """The first step for which it polls: it leads when the election is over."""
        over_ns = leads.elected_ns + self.polls.backoff_ns // 2 + self.polls.settle_ns
        return (over_ns - self.plan.origin_ns) // self.plan.step_ns + 1

    # --- a step --------------------------------------------------------------------------------------------------

    def _turn(
        self, leads: _Leads, step: int, chosen: Sequence[int], before: Mapping[int, int], told: dict[int, int]
    ) -> tuple[Turn, int | None]:
        """The turn, and who leads after it, if another one does. What the leader knows goes on to the next step."""
        sensed, me, polls = self._sensing(step), leads.leader, self.polls
        joins = self._joins(leads, step, chosen, told) if polls.joins else ()
        deaf = frozenset(i for i in chosen if i != me and not self._hears(me, i))
        came = frozenset(i for i in chosen if i in sensed) - deaf
        beyond = self._beyond(me, chosen, step)
        leads.silent = 0 if came else leads.silent + 1
        lost = leads.silent >= polls.silent_steps
        leads.avoided = {i: until for i, until in leads.avoided.items() if until > step}
        leads.missing = {i: leads.missing.get(i, 0) + 1 for i in deaf}
        leads.avoided |= {i: step + PAUSE for i, times in leads.missing.items() if times >= MOST_SILENT}
        leads.missing = {i: times for i, times in leads.missing.items() if times < MOST_SILENT}
        away = set(chosen) - came - deaf - {me}
        leads.avoided |= dict.fromkeys(away, step + DEAF)
        for i in away:
            leads.joined.pop(i, None)
        leads.came = came
        heir = None if lost else self._heir(leads, step, [i for i in chosen if i not in deaf])
        ids = self.ids
        turn = Turn(
            step,
            self.plan.origin_ns + step * self.plan.step_ns,
            ids[me],
            tuple(ids[i] for i in chosen),
            {ids[i]: sensed[i] for i in chosen if i in sensed},
            {ids[i]: times for i, times in before.items()},
            tuple(ids[i] for i in joins),
            tuple(ids[i] for i in leads.contenders),
            leads.elected_ns,
            "" if heir is None else ids[heir],
            lost,
            tuple(ids[i] for i in beyond),
            tuple(ids[i] for i in sorted(deaf)),
        )
        leads.contenders = ()
        return turn, heir

    def _joins(self, leads: _Leads, step: int, chosen: Sequence[int], told: dict[int, int]) -> tuple[int, ...]:
        """Those that hear the poll, are not asked, and say that they sense the target; again after a while."""
        found = tuple(
            i
            for i in self._sensing(step - 1)
            if i not in (*chosen, leads.leader) and told.get(i, -1) < step and i in self._near[leads.leader]
        )
        for i in found:
            leads.joined[i] = step - 1 + self.polls.expiry_steps
            told[i] = leads.joined[i] - 1
        return found

    def _chosen(self, leads: _Leads, step: int, *, around: bool) -> tuple[int, ...]:
        """Who measures at a step, as ``head/peers/choice.py`` chooses; ``around``: it knows of no place yet."""
        at = None if around else self._where(step)
        away = self._away(self.places[leads.leader] if at is None else at)
        order = sorted(
            (i for i in self._near[leads.leader] if leads.avoided.get(i, -1) < step), key=lambda i: (away[i], i)
        )
        if around:
            order.sort(key=lambda i: i != leads.leader and leads.joined.get(i, -1) < step)
        elif self.polls.joins:
            order.sort(key=lambda i: leads.joined.get(i, -1) < step and i not in leads.came)
        return tuple(sorted(order[: self.polls.count], key=lambda i: i != leads.leader))

    def _heir(self, leads: _Leads, step: int, asked: Sequence[int]) -> int | None:
        """To whom it hands over after a step, if it should not lead on itself."""
        at, me, polls = self._where(step + 1), leads.leader, self.polls
        if at is None:
            return None
        away, chosen = self._away(at), self._chosen(leads, step + 1, around=False)
        if polls.keep_within_m is not None:
            if away[me] <= polls.keep_within_m:
                return None
        elif me in chosen and (polls.sticky or me == min(chosen, key=lambda i: (away[i], i))):
            return None
        listening = self._near[me] if polls.always_on else asked
        nearer = [i for i in listening if i != me and away[i] < away[me]]
        new = set(chosen) if polls.keep_within_m is None else set[int]()
        return min(nearer, key=lambda i: (bool(new) and i not in new, away[i], i), default=None)

    def _beyond(self, leader: int, chosen: Sequence[int], step: int) -> list[int]:
        """Those that sense the target, nearer than one of the chosen, and are not within reach of the leader."""
        at = self._where(step)
        if at is None or not chosen:
            return []
        away = self._away(at)
        farthest = max(away[i] for i in chosen)
        return [i for i in self._sensing(step) if away[i] < farthest and i not in self._near[leader]]

    # --- places --------------------------------------------------------------------------------------------------

    @cached_property
    def ids(self) -> list[str]:
        """The sensors."""
        return [place.id for place in self.plan.info.tagged(SENSES)]

    @cached_property
    def places(self) -> Array:
        """(n, 2) where they are."""
        return np.array([(place.x, place.y) for place in self.plan.info.tagged(SENSES)], float)

    def _away(self, at: Array) -> Array:
        """(n,) how far they are from a place."""
        return np.asarray(np.hypot(*(self.places - at[:2]).T), float)

    def _where(self, step: int) -> Array | None:
        """Where the first of the targets is that are there (4,); None if none is."""
        return next((at for at in self._states(step) if at is not None), None)

    def _states(self, step: int) -> list[Array | None]:
        at_s = (self.plan.origin_ns + step * self.plan.step_ns) / NS
        states = (path.at(at_s) for path in self.plan.paths.values())
        return [None if state is None else np.asarray(state, float) for state in states]

    def _sensing(self, step: int) -> Mapping[int, int]:
        """The sensors that have a target in reach at a step, or a recorded report, with the number of the nearest."""
        if step not in self._sensed:
            for old in [one for one in self._sensed if one < step - 1]:
                del self._sensed[old]
            self._sensed[step] = self._sense(step)
        return self._sensed[step]

    def _sense(self, step: int) -> dict[int, int]:
        states = self._states(step)
        away = np.array([np.full(len(self.ids), np.inf) if at is None else self._away(at) for at in states])
        if not len(away):
            away = np.full((1, len(self.ids)), np.inf)
        target = away.argmin(axis=0)
        there = away.min(axis=0) <= self._reaches
        for i, steps in self._passes.items():
            there[i] = step in steps
        return {i: int(target[i]) for i in np.flatnonzero(there).tolist()}

    @cached_property
    def _sensed(self) -> dict[int, Mapping[int, int]]:
        return {}

    @cached_property
    def _reaches(self) -> NDArray[np.float64]:
        return np.array([self.plan.reaches[id] for id in self.ids])

    @cached_property
    def _passes(self) -> dict[int, Mapping[int, int]]:
        return {i: self.plan.passes[id] for i, id in enumerate(self.ids) if id in self.plan.passes}

    def _hears(self, leader: int, i: int) -> bool:
        """Whether a sensor hears its polls, as a rule."""
        return self.link.reception(self.ids[leader], self.ids[i], self.poll, "poll") >= GOOD

    @cached_property
    def _near(self) -> Mapping[int, frozenset[int]]:
        return _Near(self)


class _Near(dict[int, frozenset[int]]):
    """Whose announcements a leader hears, of those that may measure with it, and itself."""

    def __init__(self, heads: Heads) -> None:
        self._heads = heads

    def __missing__(self, leader: int) -> frozenset[int]:
        heads, ids = self._heads, self._heads.ids
        away = heads._away(heads.places[leader])
        close = np.flatnonzero(away <= heads.polls.peers_m).tolist()
        heard = (
            i
            for i in close
            if i != leader and heads.link.reception(ids[i], ids[leader], heads.announce, "announce") >= GOOD
        )
        self[leader] = frozenset((leader, *heard))
        return self[leader]
