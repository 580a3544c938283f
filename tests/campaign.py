"""A campaign of faults: small fields under everything at once, drawn from seeds, and what must hold all the same.

    python -m tests.campaign [--runs 200] [--seed 1] [--processes 10]

Each seed draws a scenario (field, target, radio, clocks, batteries, late reports, thresholds) and one to six faults of
any kind, and runs it in virtual time; ``--processes`` says how many of them run as processes too, and have to come to
the same. A seed that fails is printed as the command that repeats it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from math import isfinite
from pathlib import Path
from random import Random
from typing import Any, Final, TypeVar

from fusion.role import Phase as CentrePhase
from launcher.plan.prepare import planned
from launcher.record.ledger import Ledger
from launcher.record.metrics import Metrics, run_metrics
from launcher.record.tables import TrackRow, track_rows
from launcher.records import Plan
from launcher.run import run_processes, run_virtual
from launcher.show import Quiet
from launcher.study.compare import differences
from node.role import Phase as NodePhase
from tests.running import SPEEDS, kept_up
from trackfield.drivers.frames import Charge, Died
from trackfield.drivers.spec import life_name
from trackfield.drivers.virtual import Virtual
from trackfield.errors import RunFailed, ScenarioError
from trackfield.filters.trackers import TRACKERS
from trackfield.role import NS, State
from trackfield.scenario import Scenario

SPACING_M: Final = 50.0
MAX_EVENTS: Final = 1_000_000
"""A field of this size has a hundred times fewer."""
STATES: Final = {phase.value for phases in (NodePhase, CentrePhase) for phase in phases if phase.value != "new"}
KINDS: Final = ("kill", "freeze", "restart", "partition", "stuck", "bias", "deaf", "babble", "clock_jump")
OF_SENSORS: Final = ("stuck", "bias", "deaf", "babble")

T = TypeVar("T")


# --- what is drawn ----------------------------------------------------------------------------------------------------


class Draw(Random):
    """Draws of one seed; rounded, so that a scenario can be read and written."""

    def number(self, low: float, high: float) -> float:
        return round(self.uniform(low, high), 3)

    def maybe(self, share: float, make: Callable[[], T]) -> list[T]:
        return [make()] if self.random() < share else []


@dataclass(frozen=True)
class Case:
    """The scenario of a seed."""

    seed: int

    @cached_property
    def plan(self) -> Plan:
        return self._planned(self.settings)

    @cached_property
    def settings(self) -> dict[str, Any]:
        """Keys of the scenario; faults that contradict earlier ones are left out."""
        draw = Draw(self.seed)
        side, steps = draw.randint(5, 8), draw.randint(15, 30)
        settings = dict(surroundings(draw, side, steps)) | {"seed": self.seed}
        ids = [place.id for place in self._planned(settings).info.places if place.role == "node"]
        faults: list[dict[str, Any]] = []
        wanted = draw.randint(1, 6)
        while len(faults) < wanted:
            one = fault(draw, ids, steps)
            self._planned({**settings, "faults": [one]})
            try:
                self._planned({**settings, "faults": [*faults, one]})
            except ScenarioError:
                continue
            faults.append(one)
        return {**settings, "faults": faults}

    @staticmethod
    def _planned(settings: dict[str, Any]) -> Plan:
        return planned(Scenario.load({"name": "campaign"}, settings, known_trackers=TRACKERS))


@cache
def case(seed: int) -> Case:
    """Planning takes longer than many a run."""
    return Case(seed)


def surroundings(draw: Draw, side: int, steps: int) -> Iterator[tuple[str, Any]]:
    """All of a scenario but its faults."""
    extent = (side - 1) * SPACING_M
    yield "field.layout", draw.choice(["grid", "jittered", "random"])
    yield "field.spacing_m", SPACING_M
    yield "field.extent_m", extent
    yield "sensor.threshold", draw.choice([0.7, 0.75, 0.78, "adaptive"])
    yield "sensor.level_sd_db", draw.choice([0.0, 1.0])
    yield "target.path", "waypoints"
    yield "target.waypoints", route(draw, extent, steps)
    yield "fusion.trackers", ["fix-imm-ukf", *draw.maybe(0.15, lambda: "spcpf")]
    yield "fusion.deadline_s", draw.choice([0.1, 0.3, 0.9])
    yield "fusion.max_age_s", draw.choice([0.0, 0.0, 1.5, 4.0])
    yield "fusion.prior", draw.choice(["paper", "none"])
    for path in draw.maybe(0.2, lambda: route(draw, extent, steps)):
        yield "fusion.path", path
    for key, value in LINKS[draw.choice(sorted(LINKS))](draw).items():
        yield f"link.{key}", value
    if draw.random() < 0.6:
        yield "clock.offset_ms", draw.choice([0.5, 20.0, 400.0, 3000.0])
        yield "clock.drift_ppm", draw.choice([0.0, 20.0, 500.0])
        yield "clock.ramp_ppm_per_h", draw.choice([0.0, 50.0])
        yield "clock.sync", draw.random() < 0.8
        yield "clock.exchanges", draw.randint(1, 8)
        yield "clock.resync_s", draw.choice([1.0, 7.0, 60.0])
    if draw.random() < 0.5:
        yield "energy.battery_j", round(10 ** draw.uniform(-1.3, 0.7), 4)
        yield "energy.sample_mj", draw.choice([0.0, 1.0])
        for joules in draw.maybe(0.2, lambda: draw.number(0.3, 3.0)):
            yield "energy.centre_battery_j", joules


def route(draw: Draw, extent: float, steps: int) -> list[list[float]]:
    """Straight legs through the field that last as long as the run."""
    times = [0.0, *sorted(draw.sample(range(2, steps - 1), draw.randint(0, 2))), float(steps)]
    return [[float(t), draw.number(0, extent), draw.number(0, extent)] for t in times]


LINKS: Final[dict[str, Callable[[Draw], dict[str, Any]]]] = {
    "ideal": lambda draw: {"model": "ideal"},
    "fixed": lambda draw: {"model": "fixed", "loss": draw.number(0, 0.5), "delay_ms": draw.number(1, 1500)},
    "bursts": lambda draw: {
        "model": "gilbert_elliott",
        "good_s": draw.number(1, 20),
        "bad_s": draw.number(0.5, 5),
        "delay_ms": draw.number(1, 50),
        "jitter_ms": draw.number(0, 200),
    },
    "radio": lambda draw: {
        "model": "lognormal_prr",
        "radio": draw.choice(["802154-0dbm", "802154-20dbm", "wifi11b", "mica2"]),
        "ack": draw.choice([0, 1, 3]),
        "busy": draw.number(0, 0.6),
        "queue": draw.choice([1, 4, 32]),
    },
    "csma": lambda draw: {
        "model": "csma154",
        "busy": draw.number(0, 0.8),
        "ack": draw.choice([0, 4]),
        "queue": draw.choice([1, 32]),
    },
    "lora": lambda draw: {"model": "lognormal_prr", "radio": "lora868", "sf": draw.randint(7, 10)},
}


def fault(draw: Draw, ids: Sequence[str], steps: int) -> dict[str, Any]:
    """One fault, of sensors or, where it can be, of the centre too."""
    kind = draw.choice(KINDS)
    fault: dict[str, Any] = {"kind": kind, "at_s": draw.number(0.5, steps - 2)}
    if draw.random() < 0.3:
        fault["share"] = draw.choice([0.1, 0.3, 0.6])
    else:
        centre = [] if kind in OF_SENSORS else ["fusion"]
        fault["nodes"] = sorted(draw.sample([*ids, *centre * 10], draw.randint(1, 3))[:1])
        fault["nodes"] = sorted({*fault["nodes"], *draw.sample(list(ids), draw.randint(0, 2))})
    if kind == "clock_jump":
        fault["jump_ms"] = draw.choice([-1, 1]) * draw.choice([20.0, 700.0, 1000.0, 4000.0])
    if kind == "bias":
        fault["bias_deg"] = draw.choice([-20.0, 20.0, 170.0])
        fault["bias_db"] = draw.choice([-5.0, 0.0, 5.0])
    if kind in ("freeze", "restart", "partition") or (kind in OF_SENSORS and draw.random() < 0.5):
        fault["until_s"] = round(min(fault["at_s"] + draw.choice([1.0, 2.5, 10.0]), steps), 3)
    return fault


# --- what must hold ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Run:
    """A finished run in virtual time."""

    plan: Plan
    ledger: Ledger
    tracks: list[TrackRow]
    metrics: Metrics
    ended: bool


def run(plan: Plan) -> Run:
    events = 0

    def stop() -> bool:
        nonlocal events
        events += 1
        return events > MAX_EVENTS

    ledger = Ledger(plan.run, plan.processes)
    Virtual(plan.run, plan.processes, ledger).run(stop)
    ledger.close()
    tracks = track_rows(ledger.estimates(), plan.paths)
    return Run(plan, ledger, tracks, run_metrics(plan, ledger, tracks), events <= MAX_EVENTS)


def complaints(run: Run) -> Iterator[str]:
    """All that does not hold of a run."""
    if not run.ended:
        yield f"does not end: {MAX_EVENTS} events and no end in sight"
    yield from _accounts(run)
    yield from _lives(run)
    yield from _reports(run)
    for row in run.tracks:
        if not all(map(isfinite, (*row.point.mean, *row.point.covariance))):
            yield f"{row.point.tracker} at step {row.point.step} is no number: {row.point.mean}"


def _accounts(run: Run) -> Iterator[str]:
    """Each frame has one outcome, and the processes counted the same."""
    frames, ledger = run.metrics["frames"], run.ledger
    lost = sum(frames["lost"].values())
    if frames["expected"] != frames["delivered"] + lost + frames["host_lost"]:
        yield f"the ledger does not close: {frames}"
    if frames["host_lost"] or ledger.dropped():
        yield f"{frames['host_lost']} frames lost by the machine, {ledger.dropped()} unseen by the recorder"
    outcomes = Counter("delivered" if row.delivered else row.outcome for row in ledger.rows)
    for outcome in ("delivered", "asleep", "frozen"):
        counted = sum(record.get(outcome, 0) for record in ledger.finals.values())
        if counted != outcomes[outcome]:
            yield f"processes counted {counted} frames {outcome}, the ledger {outcomes[outcome]}"


def _lives(run: Run) -> Iterator[str]:
    """Nobody tells or sends anything while it is dead or frozen, and all states are known ones."""
    sent: dict[str, list[int]] = {}
    for row in run.ledger.rows:
        sent.setdefault(life_name(row.src, row.incarnation), []).append(row.sent_ns)
    for name, diary in run.ledger.diaries.items():
        told = [o for o in (*diary.told, *diary.radio) if not isinstance(o.effect, Charge | Died)]
        for t_ns in sorted({*(o.key[0] for o in told), *sent.get(name, ())}):
            if not diary.owns(t_ns):
                yield f"{name} acts at {t_ns / NS:.6f} s, outside of its life"
            if any(begin <= t_ns < until for begin, until in diary.spec.freezes):
                yield f"{name} acts at {t_ns / NS:.6f} s, while it is frozen"
        for o in told:
            if diary.died is not None and o.key > diary.died:
                yield f"{name} tells {o.effect} after its battery was empty"
            if isinstance(o.effect, State) and o.effect.name not in STATES:
                yield f"{name} is in an unknown state {o.effect.name!r}"


def _reports(run: Run) -> Iterator[str]:
    """No life of a node reports a step twice."""
    frames = {(r.src, r.incarnation, r.step, r.sent_ns, r.copy) for r in run.ledger.rows if r.kind == "doa"}
    times = Counter(frame[:3] for frame in frames)
    for (src, incarnation, step), count in times.items():
        if count > 1:
            yield f"{src} reports step {step} {count} times in its life {incarnation}"


def disagreements(plan: Plan) -> list[str]:
    """What tells a run as processes from one in virtual time, at the highest speed that the machine keeps up with."""
    found: list[str] = []
    for speed in SPEEDS:
        in_time, found = _compared(replace(plan, run=replace(plan.run, speed=speed)))
        if in_time:
            return found
    return [f"the machine is too slow for speed {SPEEDS[-1]:g}", *found]


def _compared(plan: Plan) -> tuple[bool, list[str]]:
    """Whether a run as processes was in time, and what is wrong with it or tells it from one in virtual time."""
    with tempfile.TemporaryDirectory() as scratch:
        folders = [Path(scratch) / driver for driver in ("processes", "virtual")]
        for folder in folders:
            (folder / "logs").mkdir(parents=True)
        try:
            real = run_processes(plan, folders[0], Quiet())
        except RunFailed as error:
            return True, [f"as processes: {error}\n{error.log}"]
        run_virtual(plan, folders[1])
        found = [*(f"as processes: {what}" for what in real.complaints), *differences(*folders, 0.0)]
        return kept_up(real.metrics), found


# --- the campaign -----------------------------------------------------------------------------------------------------


def failures(seed: int, *, processes: bool) -> list[str]:
    """What is wrong with the run of a seed."""
    try:
        plan = case(seed).plan
        found = list(complaints(run(plan)))
        return found or (disagreements(plan) if processes else [])
    except Exception:  # noqa: BLE001  whatever it is, it is what the campaign is after
        return [traceback.format_exc(limit=-3)]


def campaign(seeds: Sequence[int], *, processes: int, say: Callable[[str], object] = print) -> int:
    """The exit code: 1 if any seed fails. The runs as processes are spread over all."""
    begun, failed = time.monotonic(), 0
    both = {seeds[i * len(seeds) // processes] for i in range(processes)} if processes else set()
    for seed in seeds:
        if found := failures(seed, processes=seed in both):
            failed += 1
            say(f"seed {seed} fails: python -m tests.campaign --runs 1 --seed {seed} --processes {int(seed in both)}")
            for what in found[:5]:
                say("  " + what.replace("\n", "\n  "))
    took = f"{time.monotonic() - begun:.0f} s"
    say(f"{len(seeds)} runs, {len(both)} of them as processes too, in {took}: {failed} failed")
    return int(failed > 0)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1, help="of the first run")
    parser.add_argument("--processes", type=int, default=10, help="how many of them run as processes too")
    asked = parser.parse_args()
    return campaign(range(asked.seed, asked.seed + asked.runs), processes=min(asked.processes, asked.runs))


if __name__ == "__main__":
    sys.exit(main())
