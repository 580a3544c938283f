"""How much masters and slaves will send, or nodes of which any may lead, or those that hear targets pass.

That is how full the channel will be, and whether a radio sends for too long.
Single steps, evenly spread, stand for all; the setup is counted as it is, and so are the events of those that hear.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from launcher.plan.air import Air, Due, Use, air_of
from launcher.plan.forecast.crowd import Crowd
from launcher.plan.forecast.duty import HOUR_S, Duty, allowances
from launcher.plan.forecast.heads.polled import Polled
from launcher.plan.forecast.heads.polling import Polling
from launcher.plan.forecast.hearing.diffusing import Diffusing
from launcher.plan.forecast.hearing.passed import Passed
from launcher.plan.forecast.masters.scheduled import Scheduled
from launcher.plan.forecast.masters.traffic import Traffic
from launcher.plan.forecast.sent import Sent
from launcher.records import SENSES
from trackfield.drivers.spec import places_of
from trackfield.link.fate import Transmission
from trackfield.role import NEIGHBOURHOOD, NS

MOST_LOOKED: Final = 200
"""Steps of which all messages are sent on trial, at most."""


@dataclass(frozen=True)
class Load:
    """The messages of a field with a schedule: those of the ``setup``, and of ``steps``, one in ``every`` of all.

    In long runs of sensors that hear targets pass, ``steps`` are all those with events, and one in ``every_quiet`` of
    the others is in ``quiet``.
    """

    field: Scheduled | Polled | Passed
    setup: Sequence[Transmission]
    steps: Sequence[Transmission]
    every: float
    quiet: Sequence[Transmission] = ()
    every_quiet: float = 1.0

    @classmethod
    def of(cls, field: Scheduled | Polled | Passed) -> Load:
        """What is expected to be sent."""
        plan, traffic = field.plan, _traffic(field)
        steps = (plan.run.end_ns - 1 - plan.origin_ns) // plan.step_ns
        known = list(field.turns) if isinstance(field, Scheduled) else [*range(1, steps + 1, field.every)]
        some, last_ns = _spread(known), plan.run.end_ns

        def of_steps(some: Sequence[int]) -> Iterator[Sent]:
            for step in some:
                begin_ns = plan.origin_ns + step * plan.step_ns
                yield from traffic.of_step(step)
                yield from traffic.at_intervals(begin_ns, min(begin_ns + plan.step_ns, last_ns))

        setup = _frames(traffic.of_setup())
        if isinstance(traffic, Diffusing) and len(some) < len(known):
            others = [step for step in known if step not in traffic.busy]
            busy, quiet = [step for step in known if step in traffic.busy], _spread(others)
            every = len(others) / len(quiet) if quiet else 1.0
            return cls(field, setup, _frames(of_steps(busy)), 1.0, _frames(of_steps(quiet)), every)
        return cls(field, setup, _frames(of_steps(some)), steps / len(some) if some else 1.0)

    # --- the channel ---------------------------------------------------------------------------------------------

    @cached_property
    def crowd(self) -> Crowd | None:
        """What reports are to each other and to all else on the channel; None without a radio or reports."""
        kinds = {kind for kind, _ in self.field.reports.values()}
        fates = [(n, one, self.field.link.fate(one)) for n, one in enumerate(self.steps) if one.kind in kinds]
        air = self._air(self.steps, [Due(n, one.dst, fate.cause is None) for n, one, fate in fates])
        if air is None or not air.expected:
            return None
        uses = [use._replace(mean=self.every * use.mean) for use in air.uses]
        for frames, times in ((self.setup, 1.0), (self.quiet, self.every_quiet)):
            more = self._air(frames, [])
            others = {use.id: use for use in more.uses} if more is not None else {}
            uses = [_both(use, others.get(use.id), times) for use in uses]
        most, lost = max(uses, key=lambda use: use.mean), sum(fate.cause is not None for _, _, fate in fates)
        return Crowd(air, lost, self.every, most.mean, max(use.peak for use in uses), most.id)

    def _air(self, frames: Sequence[Transmission], dues: Sequence[Due]) -> Air | None:
        plan = self.field.plan
        at = {place.id for place in plan.info.places if SENSES not in place.tags}
        if isinstance(self.field, Polled):
            at |= {id for turn in self.field.turns.values() for id in turn.polled}
        elif isinstance(self.field, Passed):
            at = {place.id for place in plan.info.places}
        return air_of(self.field.link, places_of(plan.processes), frames, dues, plan.run.end_ns, sorted(at))

    # --- duty cycles ---------------------------------------------------------------------------------------------

    @property
    def duties(self) -> tuple[Duty, ...]:
        """Of each role the one that sends longest in any hour, with what the band allows; none if it allows all."""
        shares = allowances(self.field.plan)
        most, roles = dict[str, Duty](), {place.id: place.role for place in self.field.plan.info.places}
        for id, seconds in self._busiest.items():
            duty = shares.get(id, 1.0)
            if duty < 1.0 and (roles[id] not in most or seconds > most[roles[id]].seconds):
                most[roles[id]] = Duty(id, f"its messages as {roles[id]}", seconds, duty * HOUR_S)
        return tuple(most[role] for role in sorted(most))

    @property
    def _busiest(self) -> Mapping[str, float]:
        """For how long (s) each sends in its busiest hour."""
        sent: dict[str, list[tuple[int, float]]] = {}
        for frames, times in ((self.setup, 1.0), (self.steps, self.every), (self.quiet, self.every_quiet)):
            for frame in frames:
                fate = self.field.link.fate(frame)
                sent.setdefault(frame.src, []).append((frame.sent_ns, times * fate.air_ns / NS))
                if fate.ack_air_ns:
                    sent.setdefault(frame.dst, []).append((frame.sent_ns, times * fate.ack_air_ns / NS))
        return {id: _most_in_an_hour(those) for id, those in sent.items()}


def _traffic(field: Scheduled | Polled | Passed) -> Traffic | Polling | Diffusing:
    """What is sent in such a field."""
    match field:
        case Passed():
            return Diffusing(field)
        case Polled():
            return Polling(field)
    return Traffic(field)


def _frames(sent: Iterator[Sent]) -> list[Transmission]:
    """As frames, in the order in which they leave; of those of one kind and instant each is another copy."""
    copies, found = dict[tuple[int, str, str], int](), list[Transmission]()
    for one in sorted(sent):
        key = one.t_ns, one.src, one.kind
        copies[key] = copies.get(key, -1) + 1
        to_all = one.dst == NEIGHBOURHOOD
        frame = Transmission(one.src, one.dst, one.kind, one.t_ns, copies[key], one.size, to_all)
        found.append(frame._replace(preamble_ns=one.preamble_ns))
    return found


def _spread(steps: Sequence[int]) -> list[int]:
    """Some of these, evenly spread."""
    chosen = np.linspace(0, len(steps) - 1, min(len(steps), MOST_LOOKED)).round().astype(int)
    return [steps[i] for i in chosen.tolist()]


def _both(use: Use, other: Use | None, times: float) -> Use:
    """The use by some frames, and by others so many ``times``."""
    if other is None:
        return use._replace(mean=min(use.mean, 1.0))
    return use._replace(mean=min(use.mean + times * other.mean, 1.0), peak=max(use.peak, other.peak))


def _most_in_an_hour(sent: Sequence[tuple[int, float]]) -> float:
    """The largest sum (s) of those that leave within an hour, each (ns, s)."""
    t_ns, seconds = (np.array(column) for column in zip(*sorted(sent), strict=True))
    before = np.concatenate([[0.0], np.cumsum(seconds)])
    return float(np.max(before[np.searchsorted(t_ns, t_ns + round(HOUR_S * NS))] - before[:-1]))
