"""Fields of four sensors that play what was recorded of a target that crosses."""

from __future__ import annotations

from collections.abc import Sequence
from math import dist
from pathlib import Path
from typing import Any, Final

import pytest

import trackfield as tf
from launcher.plan.prepare import planned
from launcher.record.ledger import Ledger
from launcher.record.tables import TrackRow
from launcher.records import Plan
from tests.simulated import simulated
from trackfield.draw import normal
from trackfield.sensing.kinds import make_sensor
from trackfield.world.scene import Still

PLACES: Final = {"a": (0.0, 0.0), "b": (40.0, 0.0), "c": (40.0, 30.0), "d": (0.0, 30.0)}
STEPS: Final = 30
STEP_S: Final = 0.5
SENSORS: Final = "id,x,y\n" + "".join(f"{id},{x},{y}\n" for id, (x, y) in PLACES.items())


def way(t_s: float) -> tuple[float, float]:
    """A target that crosses the field."""
    return 5.0 + 2.0 * t_s, 8.0 + 1.0 * t_s


def recorded(kind: str, options: dict[str, Any], *, truth: bool = True, seed: int = 7) -> str:
    """What the sensors of a kind report of the target, once in a step, each at its own time."""
    sensor, rows = make_sensor(kind, options), []
    for k in range(STEPS):
        for number, (id, place) in enumerate(PLACES.items()):
            t_s = round(k * STEP_S + 0.01 * number, 3)
            x, y = way(t_s)
            normals = tuple(normal(seed, id, i, k) for i in range(sensor.n))
            values = sensor.simulate(Still((x, y, 2.0, 1.0)), 0, place, normals)
            assert values is not None
            place_of = f",{x},{y}" if truth else ""
            rows.append((t_s, f"{t_s},{id},{','.join(map(str, values))}{place_of}\n"))
    header = ["t_s", "sensor", *(f"v{i}" for i in range(sensor.n)), *(["x", "y"] if truth else [])]
    return ",".join(header) + "\n" + "".join(row for _, row in sorted(rows))


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("sensors.csv").write_text(SENSORS)
    return tmp_path


def scenario(kind: str = "range", options: dict[str, Any] | None = None, **more: Any) -> tf.Scenario:
    """A field that plays ``reports.csv``; keys of ``more`` have two underscores for the dot."""
    text: dict[str, Any] = {
        "name": "played",
        "field": {"layout": "file", "file": "sensors.csv"},
        "sensor": {"kind": kind, "recording": "reports.csv", **(options or {})},
        "target": {"path": "recording", "step_s": STEP_S},
        "fusion": {"prior": "none", "deadline_s": 0.2, "trackers": ["imm-ukf", "ukf"], "lost_m": 20.0},
    }
    return tf.Scenario.load(text, {key.replace("__", "."): value for key, value in more.items()})


def ran(scenario: tf.Scenario) -> tuple[Plan, Ledger, list[TrackRow]]:
    plan = planned(scenario)
    return plan, *simulated(plan)


def errors(rows: Sequence[TrackRow], tracker: str) -> list[float]:
    own = [row for row in rows if row.point.tracker == tracker and row.has_track and row.truth]
    return [dist(row.point.mean[:2], row.truth[:2]) for row in own if row.truth]


OPTIONS: Final[dict[str, dict[str, Any]]] = {
    "range": {"floor_sd_m": 0.5},
    "rss": {"shadow_sd_db": 1.0},
    "energy": {"noise": 0.05, "relative": 0.05},
    "doa": {"doa_sd_deg": 1.0},
}
