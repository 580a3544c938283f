"""The energy from the field's batteries: by cause, under several accountings, and how long they last."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, dist, inf
from typing import Any, Final

from launcher.record.figures.overhearing import Overheard, overheard_fj, overheard_ns
from launcher.record.ledger import Ledger
from launcher.records import BATTERY, SENSES, Plan
from trackfield.drivers.engine.meter import Activity, done
from trackfield.drivers.spec import ProcessSpec
from trackfield.link import first_order
from trackfield.link.energy import CAUSES, DEVICES, Power
from trackfield.link.fate import FIELD
from trackfield.role import NS

ACCOUNTINGS: Final = ("metered", "without_listening", "with_overhearing", "first_order")
"""Ways to count that do not change the device (docs/metrics.md); those that do are called by its name."""
_FJ: Final = 1e-15


@dataclass(frozen=True)
class Battery:
    """A battery over all lives of its process, with the ``powers`` and ``activities`` of its devices by medium.

    ``died_ns`` is when it was empty. ``killed`` says that a planned fault killed the process for good: it draws no
    more.
    """

    spec: ProcessSpec
    powers: Mapping[str, Power]
    activities: Mapping[str, Activity]
    metered_ns: int
    died_ns: int | None
    killed: bool = False

    @property
    def power(self) -> Power:
        """That of the field's radio, with the battery and the sensor."""
        return self.powers[FIELD]

    @property
    def activity(self) -> Activity:
        """That of the field's radio, and of the sensor."""
        return self.activities[FIELD]

    @property
    def spent_j(self) -> dict[str, float]:
        """By cause, of all devices."""
        each = [activity.energy_fj(self.powers[medium]) for medium, activity in self.activities.items()]
        return {cause: sum(one[cause] for one in each) * _FJ for cause in CAUSES}

    @property
    def besides_j(self) -> float:
        """What its devices for other media than the field spent."""
        return sum(self.spent_j.values()) - sum(self.activity.energy_fj(self.power).values()) * _FJ

    @property
    def lifetime_s(self) -> float | None:
        """When the battery is empty if all goes on as it went; None on mains, and of a process that was killed."""
        if self.died_ns is not None:
            return self.died_ns / NS
        spent = sum(self.spent_j.values())
        if self.power.battery_fj is None or not spent or self.killed:
            return None
        return self.power.battery_fj * _FJ / spent * self.metered_ns / NS


def batteries_of(plan: Plan, ledger: Ledger) -> list[Battery]:
    """The batteries of the places that run on one and know what they draw."""
    tagged = {place.id for place in plan.info.tagged(BATTERY)}
    lives: defaultdict[str, list[ProcessSpec]] = defaultdict(list)
    for diary in ledger.diaries.values():
        if diary.spec.id in tagged and diary.spec.power:
            lives[diary.spec.id].append(diary.spec)
    found = []
    for specs in lives.values():
        records = [ledger.finals.get(spec.name, {}) for spec in specs]
        died = [d.died[0] for spec in specs if (d := ledger.diaries[spec.name]).died is not None]
        found.append(
            Battery(
                specs[0],
                specs[0].powers,
                _activities(specs[0], [done(r) for r in records if "activity" in r]),
                sum(r.get("metered_ns", 0) for r in records),
                min(died, default=None),
                specs[-1].kill_ns is not None,
            )
        )
    return found


def _activities(spec: ProcessSpec, lives: Sequence[Mapping[str, Activity]]) -> dict[str, Activity]:
    """What its devices did in all lives, by medium."""
    return {medium: Activity.total(life[medium] for life in lives if medium in life) for medium in spec.powers}


def energy_metrics(
    plan: Plan, ledger: Ledger, batteries: Sequence[Battery], heard: Overheard | None = None
) -> dict[str, Any]:
    """``energy_j`` of metrics.json; null where no energy is metered. ``heard`` is what was overheard, if known."""
    if not batteries:
        nothing = {"by": dict.fromkeys(CAUSES), "by_accounting": dict.fromkeys((*ACCOUNTINGS, *DEVICES))}
        return {"total": None, "max_node": None, **nothing, "by_role": {}}
    spent = [one.spent_j for one in batteries]
    by = {cause: sum(one[cause] for one in spent) for cause in CAUSES}
    total = sum(by.values())
    asleep = sum(a.listen_ns * n.powers[medium].sleep_uw for n in batteries for medium, a in n.activities.items())
    silent = total - by["listen"] + asleep * _FJ
    devices = devices_of(batteries)
    overheard = overheard_fj(overheard_ns(ledger, devices) if heard is None else heard, devices) * _FJ
    figures = total, silent, silent + overheard, _first_order_j(ledger, batteries)
    return {
        "total": total,
        "max_node": max(sum(one.values()) for one in spent),
        "by": by,
        "by_accounting": {**dict(zip(ACCOUNTINGS, figures, strict=True)), **_by_device_j(ledger, batteries)},
        "by_role": _by_role_j(plan, batteries),
    }


def _by_role_j(plan: Plan, batteries: Iterable[Battery]) -> dict[str, float]:
    """What those of each role used."""
    roles = {place.id: place.role for place in plan.info.places}
    used = defaultdict[str, float](float)
    for one in batteries:
        used[roles[one.spec.id]] += sum(one.spent_j.values())
    return dict(sorted(used.items()))


def lifetime_metrics(plan: Plan, batteries: Sequence[Battery]) -> dict[str, Any]:
    """``lifetime_s`` of metrics.json: of the batteries alone, at the rate of this run where they outlast it.

    Nodes that were killed are left out.

    Coverage is lost when all sensors within reach of some point of a target's path in this run are empty, if there were
    any. Lifetimes last from the start of the run; times of ``empty`` count from the
    first step, as those of faults do.
    """
    ends = {one.spec.id: t for one in batteries if (t := one.lifetime_s) is not None}
    if not ends:
        return dict.fromkeys(("first_death", "half_dead", "coverage_lost", "extrapolated", "empty"))
    order = sorted(ends.values())
    killed = {one.spec.id for one in batteries if one.killed and one.died_ns is None}
    figures = [order[0], order[ceil(len(order) / 2) - 1], _coverage_lost(plan, ends, killed)]
    names = ("first_death", "half_dead", "coverage_lost")
    empty = [(one.spec.id, one.died_ns) for one in batteries if one.died_ns is not None]
    return {
        **dict(zip(names, figures, strict=True)),
        "extrapolated": any(t is not None and t > plan.run.end_ns / NS for t in figures),
        "empty": [{"id": id, "t": (died_ns - plan.origin_ns) / NS} for id, died_ns in empty],
    }


def _coverage_lost(plan: Plan, ends: Mapping[str, float], killed: Collection[str]) -> float | None:
    from scipy.spatial import cKDTree

    sensors = [place for place in plan.info.tagged(SENSES) if place.id not in killed]
    if not sensors:
        return None
    lasts = [ends.get(place.id, inf) for place in sensors]
    tree = cKDTree([(place.x, place.y) for place in sensors])
    points = [point[1:] for truth in plan.info.truths for point in truth.points]
    near: list[list[int]] = [tree.query_ball_point(point, plan.reach_m) for point in points]
    lost = min((max(lasts[i] for i in heard) for heard in near if heard), default=inf)
    return lost if lost < inf else None


# --- other accountings ------------------------------------------------------------------------------------------------


def devices_of(batteries: Iterable[Battery]) -> dict[str, Mapping[str, Power]]:
    """What each place on a battery has for each medium."""
    return {one.spec.id: one.powers for one in batteries}


def _by_device_j(ledger: Ledger, batteries: Iterable[Battery]) -> dict[str, float]:
    """What each device would have drawn for the same frames, listening and sleeping."""
    received: Counter[str] = Counter()
    heard: Counter[str] = Counter()
    for row in ledger.rows:
        if row.delivered and row.medium == FIELD:
            received[row.dst] += row.bytes
            heard[row.dst] += 1
    totals: dict[str, float] = dict.fromkeys(DEVICES, 0.0)
    for one in batteries:
        for name, device in DEVICES.items():
            sent, frames = ledger.sent_bytes[one.spec.id]
            activity = one.activity._replace(
                send_ns=(sent + frames * device.overhead_bytes) * device.byte_ns,
                receive_ns=(received[one.spec.id] + heard[one.spec.id] * device.overhead_bytes) * device.byte_ns,
            )
            totals[name] += sum(activity.energy_fj(device).values()) * _FJ + one.besides_j
    return totals


def _first_order_j(ledger: Ledger, batteries: Iterable[Battery]) -> float:
    """Heinzelman's model: only bits cost, at the sender with the distance to the furthest receiver."""
    counted = {one.spec.id for one in batteries}
    places = {diary.spec.id: (diary.spec.x, diary.spec.y) for diary in ledger.diaries.values()}
    furthest: dict[tuple[Any, ...], tuple[float, int]] = {}
    total = 0
    for row in ledger.rows:
        if row.medium != FIELD or row.outcome == "overflow":
            continue
        if row.delivered and row.dst in counted:
            total += first_order.receive_fj(8 * row.bytes)
        if row.src in counted:
            frame = (row.src, row.incarnation, row.kind, row.sent_ns, row.copy)
            away = dist(places[row.src], places[row.dst])
            furthest[frame] = max(furthest.get(frame, (0.0, 0)), (away, row.bytes))
    return (total + sum(first_order.send_fj(8 * size, away) for away, size in furthest.values())) * _FJ
