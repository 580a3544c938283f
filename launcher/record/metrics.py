"""metrics.json: all figures of a run (docs/metrics.md explains each key)."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from launcher.record.figures.at_base import base_age, base_rows
from launcher.record.figures.awake import awake_share
from launcher.record.figures.bounds import bound_metrics, headline_bound, run_bounds
from launcher.record.figures.camera.metrics import camera_metrics
from launcher.record.figures.channel import air_of_run, channel_metrics
from launcher.record.figures.clusters import clusters_metrics
from launcher.record.figures.energy import batteries_of, devices_of, energy_metrics, lifetime_metrics
from launcher.record.figures.hops import CARRIERS, hop_latencies, reports_end_to_end
from launcher.record.figures.leaders import age_metrics, leaders_metrics
from launcher.record.figures.overhearing import overheard_ns
from launcher.record.figures.passes.metrics import passes_metrics
from launcher.record.figures.periods import spans_of
from launcher.record.figures.scores import detection_s, first_in_range, offsets, scored
from launcher.record.figures.spending import ledger_metrics, period_of
from launcher.record.ledger import Ledger
from launcher.record.outside.told import outside_of
from launcher.record.tables import Bounds, TrackRow
from launcher.record.views import headline, seen
from launcher.records import MessageRow, Plan, View
from trackfield.drivers.exchange.histogram import Histogram
from trackfield.drivers.spec import role_places
from trackfield.filters import metrics as score
from trackfield.role import NS
from trackfield.wire.keys import id_of

CAUSES: Final = ("radio", "partition", "in_flight", "asleep", "frozen", "dead", "overflow")
NEAREST: Final = "nearest"
"""With several targets each point of a track is scored against the nearest of them."""
THE_END: Final = "end of the scenario"
LAUNCHER_DIED: Final = "the launcher died"
RECORDER_DIED: Final = "the recorder died"
INTERRUPTED: Final = "interrupted"
BY_LAUNCHER: Final = ("orders", "tokens", "questions", "denied", "handshakes", "sessions")
"""What others did that a recorder does not see."""
ROUTER_LOST: Final = "the router was lost"
Metrics = dict[str, Any]


def run_metrics(plan: Plan, ledger: Ledger, tracks: Sequence[TrackRow], bounds: Bounds | None = None) -> Metrics:
    """Every key of metrics.json that the ledger and the tracks can fill; null where there is no value.

    ``bounds`` is what ``run_bounds`` finds for these tracks, if that is known.
    """
    outside, _ = outside_of(plan, ledger.diaries.values())
    batteries, end_ns = batteries_of(plan, ledger), ledger.run.end_ns
    heard = overheard_ns(ledger, devices_of(batteries), period_of(spans_of(plan, end_ns)))
    at_base = base_rows(plan, tracks)
    bounds = run_bounds(plan, tracks) if bounds is None else bounds
    return {
        "scenario": plan.info.scenario,
        "seed": plan.run.seed,
        "driver": None,
        "ended_s": (end_ns - plan.origin_ns) / NS,
        **ended_because(THE_END),
        "wall_s": None,
        "cpu_s": time.process_time() + sum(r.get("cpu_s", 0.0) for r in ledger.finals.values()),
        "trackers": tracker_metrics(plan, tracks, end_ns, bounds),
        "bound": bound_metrics(plan, headline(plan, tracks), headline_bound(plan, tracks, bounds)),
        "leaders": leaders_metrics(plan, ledger.rows, tracks, ledger.diaries.values()),
        "clusters": clusters_metrics(plan, ledger),
        "passes": passes_metrics(plan, tracks),
        "camera": camera_metrics(outside, plan.paths, end_ns),
        "age_of_information_s": {**age_metrics(plan, tracks), **base_age(plan, at_base, end_ns)},
        "processes": _processes(len(plan.processes), _total(ledger, "unwritten")),
        "frames": _frames(plan, ledger),
        "bytes": {"payload": ledger.payload_bytes, "on_air": ledger.on_air or None},
        "channel": channel_metrics(air_of_run(ledger)),
        "latency_ms": {
            **_latencies(plan, ledger.rows, tracks),
            "to_base": _exact([row.told_ns - row.t_ns for row in at_base if row.has_track]),
            "hops": hop_latencies(plan.bases, ledger.rows),
        },
        "host_latency_ms": _quantiles(_merged(ledger, "latency")),
        "timing": _timing(plan, ledger),
        "energy_j": energy_metrics(plan, ledger, batteries, heard),
        "awake_share": awake_share(plan, ledger.diaries.values(), batteries),
        "ledger": ledger_metrics(plan, ledger, batteries, heard),
        "lifetime_s": lifetime_metrics(plan, batteries),
        "clock_error_ms": _clock_errors(ledger),
        "recorder": {"messages": None, "dropped": ledger.dropped(), "complaints": []},
        "interference": {**ledger.interference(), **dict.fromkeys(BY_LAUNCHER, 0)},
        "attempts": {},
    }


def ended_because(why: str) -> Metrics:
    """How a run ended, as metrics.json has it; it is complete only if it reached ``THE_END`` and all was recorded."""
    return {"complete": why == THE_END, "end_reason": why}


def cut_off(metrics: Metrics) -> Metrics:
    """The metrics of a record that broke off: without all that final records or the launcher tell, null and not 0."""
    known = {
        "frames": ("duplicate", "host_lost", "host_late"),
        "processes": ("died", "stopped", "unwritten"),
        "timing": ("inversions", "host_late", "retractions", "unsettled", "foreign_corrections"),
        "lifetime_s": ("first_death", "half_dead", "coverage_lost", "extrapolated"),
        "recorder": ("dropped",),
    }
    parts = {part: metrics[part] | dict.fromkeys(unknown) for part, unknown in known.items()}
    parts["frames"]["by_role"] = _blank(metrics["frames"]["by_role"])
    parts["timing"] |= {key: _blank(metrics["timing"][key]) for key in ("slip_ms", "lag_ms")}
    measured = ("cpu_s", "host_latency_ms", "energy_j", "awake_share", "ledger")
    return metrics | parts | {key: _blank(metrics[key]) for key in measured}


def _blank(value: object) -> Any:
    return {key: _blank(item) for key, item in value.items()} if isinstance(value, dict) else None


def tracker_metrics(
    plan: Plan, tracks: Sequence[TrackRow], end_ns: int | None = None, bounds: Bounds | None = None
) -> Metrics:
    """How well each tracker did in the headline view; then by target, by source and in each view.

    ``end_ns`` is when the run ended (None: as planned).
    """
    own = {name: [row for row in tracks if row.point.tracker == name] for name in plan.info.trackers}
    until_ns = plan.run.end_ns if end_ns is None else end_ns
    reached = first_in_range(plan)
    return {name: _tracker(plan, name, rows, until_ns, bounds or {}, reached) for name, rows in own.items()}


def _tracker(
    plan: Plan, name: str, rows: Sequence[TrackRow], end_ns: int, bounds: Bounds, reached: int | None
) -> Metrics:
    lag, seen_by = plan.lag_of(name), {view.name: seen(rows, view) for view in _ordered(plan, name)}
    scores = {
        view.name: scored(
            plan,
            seen_by[view.name],
            end_ns,
            bounds,
            lag,
            awaited=bool(seen_by[view.name]) or _smooths(plan, view, name, end_ns),
        )
        | {"detection_s": None if lag else detection_s(plan, seen_by[view.name], reached)}
        for view in _ordered(plan, name)
    }
    several = len(plan.paths) > 1
    first = next(iter(scores))
    return {
        **scores[first],
        "association": NEAREST if several else None,
        "targets": {id: _target(seen_by[first], id) for id in plan.paths} if several else {},
        "sources": dict(sorted(Counter(row.point.source for row in rows if row.has_track).items())),
        "views": scores,
    }


def _ordered(plan: Plan, track: str) -> list[View]:
    """The views, the headline first; of a track that is smoothed as a whole, the first that can have it."""
    if not plan.whole(track):
        return list(plan.views)
    return sorted(plan.views, key=lambda view: set(plan.smoothers).isdisjoint(view.sources))


def _smooths(plan: Plan, view: View, track: str, end_ns: int) -> bool:
    """Whether a view can have this track: one that is smoothed is not handed on, but is of who fuses reports.

    One that is smoothed as a whole is of the base that does so, and only if the run went on to its end.
    """
    if plan.whole(track):
        return end_ns >= plan.run.end_ns and not set(plan.smoothers).isdisjoint(view.sources)
    return not plan.lag_of(track) or any(source in plan.banks for source in view.sources)


def _target(rows: Sequence[TrackRow], target: str) -> Metrics:
    """Over the steps in which this target was the one nearest to the track, and its place was recorded."""
    own = [r for r in rows if r.has_track and r.truth and r.true_target == target and not r.interpolated]
    return {"rmse": score.rmse(offsets(own)[:, :2]) if own else None, "steps": len(own)}


def _processes(started: int, unwritten: int) -> Metrics:
    """Of a run in which all went well; the launcher adds the rest."""
    alone: Metrics = {"ready_s": None, "died": [], "stopped": [], "pss_mb_per_node": None}
    return {"started": started, **alone, "unwritten": unwritten}


def _timing(plan: Plan, ledger: Ledger) -> Metrics:
    """How well the machine kept up; processes alone take frames back. The launcher adds who was not settled."""
    processes = any("retractions" in record for record in ledger.finals.values())
    lag = _merged(ledger, "lag")
    return {
        "speed": plan.run.speed,
        "slip_ms": _quantiles(_merged(ledger, "slip")),
        "inversions": _total(ledger, "inversions"),
        "host_late": _total(ledger, "host_late") + ledger.tardy(),
        "retractions": _total(ledger, "retractions") if processes else None,
        "lag_ms": {**_quantiles(lag), "max": lag.quantile_ms(1.0)},
        "unsettled": 0 if processes else None,
        "foreign_corrections": sum(ledger.corrected[id] for id in ledger.foreign) if processes else None,
    }


def _frames(plan: Plan, ledger: Ledger) -> Metrics:
    outcomes = Counter(r.outcome for r in ledger.rows)
    sums, container = ledger.sums(), ledger.lost_by_containers()
    return {
        "sent": sum(ledger.sent_kinds.values()),
        "expected": sums["expected"],
        "delivered": sums["delivered"],
        "late": outcomes["late"],
        "duplicate": _total(ledger, "duplicate"),
        "ignored": outcomes["ignored"],
        "lost": {cause: outcomes[cause] for cause in CAUSES} | {"container": container},
        "host_lost": sums["host_lost"] - container,
        "host_late": sums["host_late"],
        "refused": dict(sorted(ledger.refused.items())),
        "by_kind": {
            kind: {"sent": n, "payload_bytes_max": ledger.payload_max[kind]}
            for kind, n in sorted(ledger.sent_kinds.items())
        },
        "by_role": _by_role(plan, ledger),
    }


def _by_role(plan: Plan, ledger: Ledger) -> Metrics:
    """The frames of each role by name, of processes with several; their records may name no others."""
    roles = {process.id: list(filter(None, role_places(process.factory))) for process in plan.processes}
    names = sorted({name for several in roles.values() for name in several})
    figures: Metrics = {name: {"delivered": 0, "ignored": 0} for name in names}
    for life, record in ledger.finals.items():
        for name in roles.get(id_of(life), ()):
            for what, count in record.get("roles", {}).get(name, {}).items():
                figures[name][what] += count
    return figures


def _latencies(plan: Plan, rows: Sequence[MessageRow], tracks: Sequence[TrackRow]) -> Metrics:
    """Emulated: on the link, from a report's sending to its fusion, and from a step's instant to its track in the
    first view.
    """
    fused: dict[tuple[str, int | None], int] = {}
    for track in tracks:
        for sensor in track.point.sensors:
            report = sensor, track.point.step
            fused[report] = min(track.told_ns, fused.get(report, track.told_ns))
    link = [row.due_ns - row.sent_ns for row in rows if row.delivered and row.due_ns is not None]
    reports = [*(row for row in rows if row.kind not in CARRIERS), *reports_end_to_end(plan.bases, rows)]
    to_filter = [
        fused[row.src, row.step] - row.sent_ns
        for row in reports
        if row.outcome == "delivered" and row.step is not None and (row.src, row.step) in fused
    ]
    to_track = [track.told_ns - track.t_ns for track in headline(plan, tracks) if not track.point.lag]
    return {"link": _exact(link), "to_filter": _exact(to_filter), "to_track": _exact(to_track)}


def _clock_errors(ledger: Ledger) -> Metrics:
    """The errors of senders' clocks after correction, whenever they sent; null where all clocks are perfect."""
    if not ledger.clock_errors:
        return {"rms": None, "max": None}
    errors = np.abs(np.array(list(ledger.clock_errors.values())) / 1e6)
    return {"rms": score.rmse(errors[:, None]), "max": float(errors.max())}


def _exact(durations_ns: Sequence[int]) -> Metrics:
    if not durations_ns:
        return dict.fromkeys(("p50", "p95", "p99", "max"))
    p50, p95, p99, most = np.quantile(np.array(durations_ns) / 1e6, [0.5, 0.95, 0.99, 1.0]).tolist()
    return {"p50": p50, "p95": p95, "p99": p99, "max": most}


def _quantiles(histogram: Histogram) -> Metrics:
    return {"p50": histogram.quantile_ms(0.5), "p99": histogram.quantile_ms(0.99)}


def _merged(ledger: Ledger, name: str) -> Histogram:
    total = Histogram()
    for record in ledger.finals.values():
        total.update(Histogram(record.get(name)))
    return total


def _total(ledger: Ledger, name: str) -> int:
    return sum(int(record.get(name, 0)) for record in ledger.finals.values())
