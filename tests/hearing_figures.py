"""The tables of docs/hearing.md: ``python -m tests.hearing_figures``. Runs of the packaged scenario in virtual time.

Errors are those of the fixes, at the instant of the step at which their event was over, over all events and seeds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from math import atan2, degrees, dist, hypot, log10
from statistics import mean, median, pstdev
from typing import Final, NamedTuple

from launcher.plan.architectures import surveyed
from launcher.plan.forecast.foresight import foresee
from launcher.plan.forecast.hearing.passed import Passed
from launcher.plan.forecast.masters.load import Load
from launcher.plan.prepare import planned
from launcher.record.figures.channel import air_of_run, channel_metrics
from launcher.record.ledger import Ledger
from launcher.record.tables import TrackRow
from launcher.records import Plan
from tests.simulated import simulated
from trackfield.role import NS
from trackfield.scenario import Scenario
from trackfield.scenario.override import parse

MODELLED: Final = (
    "sensor.waveform=false", "sensor.time_sd_s=0.1", "sensor.distance_power=0", "sensor.speed_power=0",
    "sensor.strength_sd=0.1", "fusion.trackers=['ml']",
)  # fmt: skip
"""The noise of the paper's simulations."""
ALONE: Final = {"camera.kind": "none"}
"""Without what is beyond the base of the packaged scenario."""
RANDOM: Final = (
    "field={layout='random', nodes=25, spacing_m=20}", "architecture.heads=loudest", "sensor.range_m=20",
    "link.range_m=40", "fusion.x_m=50", "fusion.y_m=50", "target.waypoints=[[0, -40, 30], [14, 140, 70]]",
)  # fmt: skip
CURVED: Final = (
    "field={layout='pentagon'}", "link.range_m=60", "fusion.x_m=30", "fusion.y_m=40",
    "target.waypoints=[[0, -60, 0], [10, 60, 20], [20, 160, 80], [30, 200, 190]]",
)  # fmt: skip
SPEED_M_S: Final = 13.4112
SOUND_M_S: Final = 340.0
FIELDS: Final[Mapping[str, Sequence[str]]] = {"as it is": (), "random": RANDOM, "along a curve": CURVED}
FAULTS: Final[Mapping[str, str]] = {
    "nothing": "",
    "the head n000 is killed during a pass": "{kind='kill', nodes=['n000'], at_s=10}",
    "n003, by which all comes to the base, is killed": "{kind='kill', nodes=['n003'], at_s=15}",
    "n002 is deaf": "{kind='deaf', nodes=['n002'], at_s=0}",
    "n002 and n004 are deaf": "{kind='deaf', nodes=['n002', 'n004'], at_s=0}",
    "n001 reports what is not there": "{kind='babble', nodes=['n001'], at_s=0}",
    "the clock of n004 jumps by 100 ms": "{kind='clock_jump', nodes=['n004'], at_s=5, jump_ms=100}",
    "the base is killed": "{kind='kill', nodes=['base'], at_s=30}",
}
SEEDS: Final = range(1, 4)
BINS_M: Final = (4.0, 7.0, 11.0, 15.0, 20.0, 30.0)
LOOKED_S: Final = 3.0
"""Around a pass that was reported, the true one is looked for in this time."""


class Ran(NamedTuple):
    """A run, and what was expected of it."""

    plan: Plan
    field: Passed
    ledger: Ledger
    rows: Sequence[TrackRow]

    def ended(self, *sources: str) -> list[TrackRow]:
        """The points with which events ended at these processes."""
        return [row for row in self.rows if row.point.source in sources and row.point.event_ns is not None]

    @property
    def heads(self) -> list[TrackRow]:
        """Those of all nodes."""
        return self.ended(*self.plan.reaches)


def run(*settings: str, seed: int) -> Ran:
    """The packaged scenario with these settings."""
    scenario = Scenario.load("yang-ecpa", {**ALONE, "seed": seed, **dict(map(parse, (*MODELLED, *settings)))})
    plan = planned(scenario)
    field = foresee(plan).scheduled
    ledger, rows = simulated(plan)
    assert isinstance(field, Passed)
    assert isinstance(ledger, Ledger)
    return Ran(plan, field, ledger, rows)


def errors(rows: Sequence[TrackRow]) -> tuple[float, float, float]:
    """Medians of the errors of fixes: place (m), speed (m/s), heading (degrees)."""
    found = [_errors(row) for row in rows if not row.point.refused and row.truth is not None]
    if not found:
        return float("nan"), float("nan"), float("nan")
    place, speed, heading = zip(*found, strict=True)
    return median(place), median(speed), median(heading)


def _errors(row: TrackRow) -> tuple[float, float, float]:
    assert row.truth is not None
    (x, y, vx, vy), (tx, ty, tvx, tvy) = row.point.mean[:4], row.truth
    turned = degrees(atan2(vx * tvy - vy * tvx, vx * tvx + vy * tvy))
    return hypot(x - tx, y - ty), abs(hypot(vx, vy) - hypot(tvx, tvy)), abs(turned)


def found() -> Iterator[str]:
    """Mean errors of the fixes of the packaged field as it is, whose passes are found in sound."""
    yield "| tracker | fixes of passes | place | speed | heading |"
    yield "| --- | --- | --- | --- | --- |"
    runs = [planned(Scenario.load("yang-ecpa", {**ALONE, "seed": seed})) for seed in SEEDS]
    rows = [row for plan in runs for row in simulated(plan)[1]]
    ended = [row for row in rows if row.point.source in runs[0].reaches and row.point.event_ns is not None]
    for tracker in runs[0].info.trackers:
        mine = [row for row in ended if row.point.tracker == tracker]
        each = [_errors(row) for row in mine if not row.point.refused]
        place, speed, heading = (mean(one) for one in zip(*each, strict=True))
        yield (
            f"| `{tracker}` | {_fixes(mine)} of {len(mine)} | {place:.2f} m | {speed:.2f} m/s | {heading:.2f} degrees |"
        )


def predicted() -> Iterator[str]:
    """Events, fixes, messages and the channel: predicted, and in the run."""
    yield "| field | events | fixes | messages of data | of interests | use of the channel |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for name, settings in FIELDS.items():
        runs = [run(*settings, seed=seed) for seed in SEEDS]
        loads = [Load.of(one.field) for one in runs]
        kinds = [Counter(frame.kind for frame in load.steps) for load in loads]
        sent = [_sent(one.ledger) for one in runs]
        use = [(_use(one.plan), channel_metrics(air_of_run(one.ledger))["use_mean"]) for one in runs]
        pairs = (
            ([len(one.field.events) for one in runs], [_distinct(one.heads) for one in runs]),
            ([len(one.field.fixes) for one in runs], [_fixes(one.heads) for one in runs]),
            *(([one[kind] for one in kinds], [one[kind] for one in sent]) for kind in ("data", "interest")),
        )
        cells = " | ".join(f"{mean(before):.1f} / {mean(after):.1f}" for before, after in pairs)
        yield f"| {name} | {cells} | {mean(a for a, _ in use):.2%} / {mean(b for _, b in use):.2%} |"


def _distinct(rows: Sequence[TrackRow]) -> int:
    return len({(row.point.source, row.t_ns) for row in rows})


def _fixes(rows: Sequence[TrackRow]) -> int:
    return sum(not row.point.refused for row in rows)


def _use(plan: Plan) -> float:
    crowd = foresee(plan).crowd
    assert crowd is not None
    return crowd.use_mean


def _sent(ledger: Ledger) -> Counter[str]:
    return Counter(kind for _, kind, *_ in {(row.src, row.kind, row.sent_ns, row.copy) for row in ledger.rows})


def failures() -> Iterator[str]:
    """Fixes of the runs in which something fails."""
    yield "| what | events that ended | fixes in the network | place | speed | heading | told the base |"
    yield "| --- | --- | --- | --- | --- | --- | --- |"
    for what, fault in FAULTS.items():
        runs = [run(*((f"faults=[{fault}]",) if fault else ()), seed=seed) for seed in SEEDS]
        heads = [row for one in runs for row in one.heads]
        place, speed, heading = errors(heads)
        how_far = f"{place:.2f} m | {speed:.2f} m/s | {heading:.1f} degrees" if _fixes(heads) else "| |"
        yield (
            f"| {what} | {len(heads) / len(runs):.1f} | {_fixes(heads) / len(runs):.1f} "
            f"| {how_far} | {mean(_fixes(one.ended('base')) for one in runs):.1f} |"
        )


def detected() -> Iterator[str]:
    """How precise times and strengths are that are found in sound, by the distance of the pass."""
    yield "| passed at | passes | time, sd | assumed | amplitude, sd |"
    yield "| --- | --- | --- | --- | --- |"
    found = [one for seed in SEEDS for one in _passes(seed)]
    sensing = Scenario.load("yang-ecpa").sensor.sensing.own
    for low, high in pairwise(BINS_M):
        some = [one for one in found if low <= one[0] < high]
        middle = mean(away for away, _, _ in some)
        time_sd, amplitude_sd = (pstdev(one[i] for one in some) for i in (1, 2))
        yield (
            f"| {low:.0f} to {high:.0f} m | {len(some)} | {1e3 * time_sd:.0f} ms "
            f"| {1e3 * sensing.time_sd(middle, SPEED_M_S):.0f} ms | {10 ** (amplitude_sd / 20) - 1:.1%} |"
        )


def _passes(seed: int) -> Iterator[tuple[float, float, float]]:
    """Each reported pass: how near the target came (m), the error of its time (s) and of its level at 1 m (dB)."""
    site = surveyed(Scenario.load("yang-ecpa", {"seed": seed}))
    (path,) = site.paths.values()
    for number, (_, x, y) in enumerate(site.sensors):
        sensor, at_ns = site.sensor(number), site.sensor(number).next_window(0)
        while at_ns is not None:
            heard = sensor.sample(at_ns)
            if heard is not None:
                time_s, strength_db = at_ns / NS + heard.values[0], heard.values[1]
                times = [time_s + LOOKED_S * (k / 1000 - 1) for k in range(2001)]
                away_m, passed_s = min((dist(state[:2], (x, y)), t) for t in times if (state := path.at(t)))
                yield away_m, time_s - passed_s - away_m / SOUND_M_S, strength_db + 20 * log10(away_m)
            at_ns = sensor.next_window(at_ns + 1)


def main() -> None:
    """Print all tables."""
    for lines in (detected(), found(), predicted(), failures()):
        for line in lines:
            print(line)
        print()


if __name__ == "__main__":
    main()
