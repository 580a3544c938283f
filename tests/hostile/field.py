"""The run that is attacked: a small field with all that a field may have, and its undisturbed twin."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq

from launcher.plan.prepare import load, planned
from launcher.records import Plan
from launcher.run import run_virtual
from tests.hostile.samples import Known
from trackfield.errors import RunFailed
from trackfield.scenario import Scenario

SPEED: Final = 5.0
NODES: Final = 9
SCENARIO: Final = "spcpf"
SETTINGS: Final = (
    "target.steps=15",
    "sensor.threshold=adaptive",
    "clock.offset_ms=20",
    "clock.sync=true",
    "fusion.trackers=['imm-ukf']",
    "energy.battery_j=1",
    "faults=[{kind='restart', nodes=['n004'], at_s=4, until_s=10}]",
)
"""Reports, thresholds and questions for the time are sent; one node lives twice; batteries run down."""
TREE: Final = "architecture.multihop=true"
TREE_SEED: Final = 3
"""In runs of this seed all that goes over a collection tree."""


def settings(seed: int) -> tuple[str, ...]:
    """What is changed in the scenario of a run of this seed."""
    return (*SETTINGS, TREE) if seed == TREE_SEED else SETTINGS


def arguments(seed: int) -> list[str]:
    """What ``trackfield run`` is told."""
    changes = [part for setting in settings(seed) for part in ("--set", setting)]
    return [SCENARIO, "--nodes", str(NODES), "--seed", str(seed), *changes]


@cache
def plan_of(seed: int) -> Plan:
    scenario: Scenario = load(SCENARIO, settings=[*settings(seed), f"seed={seed}"], nodes=NODES)
    return planned(scenario, SPEED)


def known_of(plan: Plan) -> Known:
    """What a peer can find out about such a run."""
    nodes = tuple(place.id for place in plan.info.places if place.role == "node")
    [centre] = [place.id for place in plan.info.places if place.role == "fusion"]
    return Known(nodes, centre, tuple(p.name for p in plan.processes), plan.info.trackers)


@dataclass(frozen=True)
class Tables:
    """What a run leaves: its tables, and its figures."""

    tracks: pa.Table
    messages: pa.Table
    metrics: dict[str, Any]


@cache
def undisturbed(seed: int) -> Tables:
    """The same run in virtual time, where nobody can interfere."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "logs").mkdir()
        outcome = run_virtual(plan_of(seed), folder)
        if outcome.exit_code:
            raise RunFailed("; ".join(outcome.complaints))
        tracks, messages = (pq.read_table(folder / f"{name}.parquet") for name in ("tracks", "messages"))
        return Tables(tracks, messages, outcome.metrics)
