"""A run so small that its figures can be worked out by hand."""

from __future__ import annotations

from typing import Any

from launcher.record.tables import TrackRow
from launcher.records import TRACKS, FieldInfo, Place, Plan, View
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.role import NS, TrackPoint
from trackfield.world.path import Path

MS = 1_000_000


def tiny() -> Plan:
    """Two nodes, a centre, and a target that goes east at 1 m/s for 4 s."""
    run = RunSpec("tiny", 7, 5 * NS, {"model": "fixed", "loss": 0.0, "delay_ms": 10}, 2.0)
    processes = (ProcessSpec("fusion", "fusion", "none"), *(ProcessSpec(n, "node", "none") for n in ("n0", "n1")))
    path = Path.of([(0.0, 0.0, 0.0, 1.0, 0.0), (4.0, 4.0, 0.0, 1.0, 0.0)])
    places = (Place("fusion", "fusion", 0.0, 0.0, frozenset({TRACKS})),)
    info = FieldInfo(run.run, "tiny-scenario", places, (), ("t",), 5.0)
    return Plan(run, processes, {"target": path}, info, views=(View("base", ("fusion",)),), deadline_s=0.3)


COVARIANCE = (9.0, 0, 0, 0, 0, 16.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0)


def point(
    step: int,
    error: tuple[float, ...] | None,
    *,
    told_ms: int = 300,
    covariance: tuple[float, ...] = COVARIANCE,
    truth: bool = True,
) -> TrackRow:
    """A point off by ``error`` (None: no track), published ``told_ms`` after its instant."""
    true = (float(step), 0.0, 1.0, 0.0)
    mean = () if error is None else tuple(a + b for a, b in zip(true, error, strict=True))
    status: Any = "tracking" if mean else "waiting"
    covariance = covariance if mean else ()
    told = TrackPoint("t", "target", step * NS, status, mean, covariance, ("n0", "n1"), step=step, source="fusion")
    return TrackRow(step * NS + told_ms * MS, told, true if truth else None, "target" if truth else "")
