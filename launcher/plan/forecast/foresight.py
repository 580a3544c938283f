"""What to expect of a plan before it is run: which sensors have the target in reach, and which reports arrive.

All of it is computed from the true paths and places; planned faults are left out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from launcher.plan.forecast.crowd import Crowd, crowd
from launcher.plan.forecast.duty import Duty, duties_of
from launcher.plan.forecast.heads.polled import Polled
from launcher.plan.forecast.heard import Array, Heard, Indices
from launcher.plan.forecast.hearing.passed import Passed
from launcher.plan.forecast.masters.load import Load
from launcher.plan.forecast.masters.relayed import relayed
from launcher.plan.forecast.masters.scheduled import Scheduled
from launcher.plan.forecast.played import without_sound
from launcher.plan.forecast.reception import Shares, hops, receptions, varies
from launcher.plan.forecast.trial import Trial, Way, sent_on_trial, ways_of
from launcher.records import SENSES, Passing, Plan, Polls
from trackfield.drivers.spec import link_of
from trackfield.role import NS
from trackfield.sensing.kinds import make_sensor
from trackfield.wire.messages import Threshold
from trackfield.wire.registry import kind_of
from trackfield.world.events import ENOUGH
from trackfield.world.path import Path

MOST_FRAMES: Final = 1000
"""Frames sent on trial, at most, to learn the delay and air time of a report."""
MOST_SENSORS: Final = 64
"""If more sensors have a target in reach, those with the best links count."""


@dataclass(frozen=True)
class Coverage:
    """A target at the steps at which it is there: ``t_s`` (n,) since the first step, ``in_reach`` (n,) sensors.

    ``fixed`` (n,) is the probability that as many reports as a fix needs arrive in time; ``outside`` (n,)
    whether the target is out of the rectangle around all sensors.
    """

    target: str
    t_s: Array
    in_reach: Indices
    fixed: Array
    outside: NDArray[np.bool_]


@dataclass(frozen=True)
class Foresight:
    """See the module. Of the run's ``steps``, one in ``every`` was looked at.

    ``needs`` is how many sensors a fix takes, ``reports`` how many each that has any will send. With an ``adaptive``
    threshold everything is what comes at the lowest one: no more than that can be expected, and nothing waits.

    ``receptions`` are by kind of message, reports first, on the links of those sensors alone, at the times at which
    they report; ``hops`` are the same on links between processes without sensors, over the run. ``arriving`` is the
    share of all reports that may be expected to arrive, ``of_use`` the share of those that are not too late (None: not
    predicted), ``delay_s`` (n,) how long some take, with the time for which they wait in their nodes for the radio.
    ``use_s`` is up to which age a report is of use; ``air_s`` (n,) the time on air of all reports of each step that has
    any. ``crowd`` is what they are to each other on the channel; None without a radio. ``duties`` are who sends longest
    in any hour, of each role and of each kind of frame; none where no rule limits that. Where leaders choose who
    measures, ``scheduled`` says whom; then the use of the channel and duties are those of all that is sent. What a head
    measures itself counts for fixes, and is no report.
    """

    needs: int
    steps: int
    every: int
    adaptive: bool
    coverage: tuple[Coverage, ...]
    reports: Mapping[str, float]
    receptions: Mapping[str, Shares]
    hops: Mapping[str, Shares]
    arriving: float
    of_use: float | None
    delay_s: Array
    trial: Trial
    use_s: float
    air_s: Array
    crowd: Crowd | None
    duties: tuple[Duty, ...]
    scheduled: Scheduled | Polled | Passed | None = None


def best(shares: Shares) -> dict[str, float]:
    """The share of each sender's messages that arrives at its best receiver."""
    found: dict[str, float] = {}
    for (src, _), share in shares.items():
        found[src] = max(found.get(src, 0.0), share)
    return found


def foresee(plan: Plan) -> Foresight:
    """What to expect of this plan, without the sensors that hear recorded sound."""
    plan, schedule = without_sound(plan), plan.schedule
    if isinstance(schedule, Passing):
        return _passes(Passed.of(plan, schedule))
    field = Polled.of(plan, schedule) if isinstance(schedule, Polls) else Scheduled.of(plan)
    load = None if field is None else Load.of(field)
    plan = plan if field is None else field.plan
    ways = ways_of(plan)
    sensors = [place for place in plan.info.tagged(SENSES) if place.id in ways or not ways or isinstance(field, Polled)]
    ids = [place.id for place in sensors]
    positions = np.array([(place.x, place.y) for place in sensors])
    heard = Heard.of(plan, ids, positions) if field is None else Heard.of_turns(field, ids)
    by_radio = heard.sent
    senders, counts = np.unique(heard.sensor[by_radio], return_counts=True)
    reports = {ids[i]: n * heard.every for i, n in zip(senders.tolist(), counts.tolist(), strict=True)}
    rows = np.flatnonzero(by_radio) if ways else np.empty(0, int)
    some = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_FRAMES)).round().astype(int))]
    trial = sent_on_trial(plan, ids, heard, some, ways)
    wait_s = _waits(plan, heard, trial)
    sent = np.isfinite(wait_s)
    leaves_ns = heard.t_ns + (np.where(sent, wait_s, 0.0) * NS).astype(np.int64)
    order = np.argsort(heard.sensor[by_radio], kind="stable")
    by_sender = np.split(leaves_ns[by_radio][order], np.cumsum(counts)[:-1])
    when = {ids[i]: times.tolist() for i, times in zip(senders.tolist(), by_sender, strict=False)}
    used = receptions(plan, when)
    if isinstance(field, Polled):
        used = {**used, **field.receptions}
        chance = field.chances(zip(heard.t_ns.tolist(), (ids[i] for i in heard.sensor.tolist()), strict=True)) * sent
    else:
        chance = _chances(plan, ids, heard, leaves_ns, _shares(plan, used), ways) * sent
    if isinstance(field, Scheduled):
        chance = chance * relayed(field, ids, heard)
    use_s = max(plan.deadline_s, plan.max_age_s)
    share = np.where(by_radio, chance * trial.in_time(use_s - wait_s), chance)
    delay_s = trial.delay_s + wait_s[some]
    needs = _needs(plan, min(len(ids), schedule.count) if isinstance(schedule, Polls) else len(ids))
    per_report = float(np.mean(trial.air_s + trial.ack_s)) if len(trial.air_s) else 0.0
    receivers = [ways[id].to if ways and field is None else "" for id in ids]
    return Foresight(
        needs=needs,
        steps=heard.steps,
        every=heard.every,
        adaptive=_adaptive(plan),
        coverage=tuple(
            _coverage(plan, id, path, heard, positions, share, needs, receivers) for id, path in plan.paths.items()
        ),
        reports=reports,
        receptions=used,
        hops=hops(plan),
        arriving=float(chance[by_radio].mean()) if by_radio.any() else 0.0,
        of_use=float(share[by_radio].sum() / chance[by_radio].sum()) if chance[by_radio].any() else 1.0,
        delay_s=delay_s[np.isfinite(delay_s)],
        trial=trial,
        use_s=use_s,
        air_s=np.asarray(np.unique(heard.t_ns[by_radio], return_counts=True)[1] * per_report, np.float64),
        crowd=crowd(plan, ids, heard) if load is None else load.crowd,
        duties=duties_of(plan, ids, heard, trial, ways) if load is None else load.duties,
        scheduled=field,
    )


def _passes(field: Passed) -> Foresight:
    """The same of a field whose sensors hear targets pass."""
    plan, load = field.plan, Load.of(field)
    sent = [(event, id) for event in field.events for id in event.heard]
    counts = Counter(id for _, id in sent)
    chances = [field.arrival(event, id) for event, id in sent]
    return Foresight(
        needs=ENOUGH,
        steps=(plan.run.end_ns - 1 - plan.origin_ns) // plan.step_ns,
        every=field.every,
        adaptive=False,
        coverage=(),
        reports=dict(counts),
        receptions=receptions(plan, {id: [plan.origin_ns] for id in counts}),
        hops={},
        arriving=float(np.mean(chances)) if chances else 0.0,
        of_use=None,
        delay_s=np.array([hops * field.hop_s for event in field.events for hops in field.hops(event).values()]),
        trial=Trial(*np.empty((4, 0))),
        use_s=max(plan.deadline_s, plan.max_age_s),
        air_s=np.empty(0),
        crowd=load.crowd,
        duties=load.duties,
        scheduled=field,
    )


def _shares(plan: Plan, used: Mapping[str, Shares]) -> Shares:
    """The receptions of all links by which sensors report."""
    names = (kind_of(flow.message).name for flow in plan.reports)
    return {link: share for name in names for link, share in used[name].items()}


def _adaptive(plan: Plan) -> bool:
    """Whether the centre sets the sensors' threshold."""
    return any(isinstance(flow.message, Threshold) for flow in plan.flows)


def _needs(plan: Plan, sensors: int) -> int:
    """How many sensors a fix takes; where fewer measure, from a prior on, all of them."""
    kinds = [make_sensor(**arguments) for arguments in plan.tracking["sensing"].values()]
    needs = max(1 if kind.passes is not None else kind.fix_sensors for kind in kinds)  # reports of passes add up
    return min(needs, sensors) if plan.tracking.get("prior") else needs


def _waits(plan: Plan, heard: Heard, trial: Trial) -> Array:
    """(n,) how long (s) each report waits until its sender's radio is free; infinite if the queue is full by then."""
    busy_s, wait_s = float(trial.busy_s.mean()) if len(trial.busy_s) else 0.0, np.zeros(len(heard.t_ns))
    if heard.after_ns is not None:
        return np.asarray(heard.after_ns / NS, np.float64)
    if busy_s <= plan.step_ns / NS or _adaptive(plan):
        return wait_s
    free_s: dict[int, float] = {}
    for row, (sensor, t_s) in enumerate(zip(heard.sensor.tolist(), (heard.t_ns / NS).tolist(), strict=True)):
        wait_s[row] = max(free_s.get(sensor, 0.0) - t_s, 0.0)
        if wait_s[row] > plan.run.queue() * busy_s:
            wait_s[row] = np.inf
        else:
            free_s[sensor] = t_s + wait_s[row] + busy_s * heard.every
    return wait_s


def _chances(
    plan: Plan,
    ids: list[str],
    heard: Heard,
    leaves_ns: NDArray[np.int64],
    shares: Shares,
    ways: Mapping[str, Way],
) -> Array:
    """(n,) the probability that each report, sent then, arrives at its best receiver; links have these ``shares``."""
    if not varies(plan) or any(way.tree for way in ways.values()) or not ways:
        at_best = best(shares)
        return np.array([at_best.get(id, 0.0) for id in ids])[heard.sensor]
    link = link_of(plan.run, plan.processes, cut=False)
    receivers: dict[str, list[str]] = {}
    for src, dst in shares:
        receivers.setdefault(src, []).append(dst)
    return np.array(
        [
            max(link.reception(id, dst, ways[id].size, ways[id].kind, t_ns, ways[id].medium) for dst in receivers[id])
            for id, t_ns in zip([ids[i] for i in heard.sensor.tolist()], leaves_ns.tolist(), strict=True)
        ]
    )


def _coverage(
    plan: Plan,
    id: str,
    path: Path,
    heard: Heard,
    positions: Array,
    share: Array,
    needs: int,
    receivers: Sequence[str],
) -> Coverage:
    """The coverage of one target, if reports arrive in time with these probabilities (n,) at each sensor's receiver."""
    there = [(t, state[:2]) for t in heard.times if (state := path.at(t / NS)) is not None]
    times, points = np.array([t for t, _ in there], np.int64), np.reshape([point for _, point in there], (-1, 2))
    mine = (heard.target == list(plan.paths).index(id)) & np.isin(heard.t_ns, times)
    step, share = np.searchsorted(times, heard.t_ns[mine]), share[mine]
    receiver = np.array(receivers)[heard.sensor[mine]]
    each = [_fixed(step[receiver == one], share[receiver == one], len(times), needs) for one in sorted(set(receivers))]
    fixed = each[0] if len(each) == 1 else 1.0 - np.prod([1.0 - one for one in each], axis=0)
    margin = np.maximum(points - positions.max(axis=0), positions.min(axis=0) - points).max(axis=1)
    in_reach = np.bincount(step, minlength=len(times))
    return Coverage(id, (times - plan.origin_ns) / NS, in_reach, fixed, margin > 0.0)


def _fixed(step: Indices, share: Array, steps: int, needs: int) -> Array:
    """(steps,) the probability that reports, of these steps (n,) with these chances (n,), are enough for a fix."""
    in_reach = np.bincount(step, minlength=steps)
    order = np.lexsort((-share, step))
    rank = np.arange(len(step)) - np.repeat(np.cumsum(in_reach) - in_reach, in_reach)
    best = rank < MOST_SENSORS
    chances = np.zeros((steps, min(int(in_reach.max(initial=0)), MOST_SENSORS)))
    chances[step[order][best], rank[best]] = share[order][best]
    return at_least(needs, chances)


def at_least(needs: int, chances: Array) -> Array:
    """(n,) the probability that at least ``needs`` of independent events with ``chances`` (n, k) happen."""
    so_many = np.zeros((len(chances), needs + 1))  # the last column: that many, or more
    so_many[:, 0] = 1.0
    for chance in chances.T[:, :, None]:
        more = so_many * chance
        so_many[:, :needs] -= more[:, :needs]
        so_many[:, 1:] += more[:, :needs]
    return so_many[:, needs]
