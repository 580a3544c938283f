"""Runs in virtual time are what they were: frames and their fates, reports used, and tracks as far as machines agree.

``python -m tests.test_digests`` writes ``tests/golden/digests.json`` anew, after a change that is meant to change runs.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from hashlib import blake2b
from pathlib import Path
from typing import Any, Final

import pytest

from launcher.plan.prepare import load, planned
from launcher.record.virtually import simulate
from tests.same_cases import CLOCKS, FAULTS, FIELDS, LATE, settings_of
from tests.same_tables import FRAME

GOLDEN: Final = Path(__file__).with_name("golden") / "digests.json"
TRACKERS: Final = ("fix-imm-ukf", "ekf", "ukf", "predict-only")
"""No particle filters: a last bit that differs decides what those draw next."""
CASES: Final[dict[str, tuple[str, tuple[str, ...]]]] = {
    **{name: (field.scenario, settings_of(name, "plain")) for name, field in FIELDS.items()},
    "spcpf-everything": ("spcpf", ("target.path=s3", *CLOCKS, *LATE, FAULTS, "energy.battery_j=0.4")),
}
EVERY: Final = 5
"""Of so many steps one is kept."""
TOLERANCE: Final = 1e-6
RELATIVE: Final = 1e-9
"""Processors differ in the last bits of a matrix product, which show in the large covariances of the radar."""
Track = dict[str, str]
"""By step: x, y, vx, vy and the diagonal of their covariance, in metres and seconds; nothing before the track."""


@cache
def story(name: str) -> dict[str, Any]:
    """What is kept of a case's run."""
    scenario, settings = CASES[name]
    ledger, rows = simulate(planned(load(scenario, settings=settings, seed=1, trackers=TRACKERS)))
    frames = sorted(repr(tuple(getattr(row, field) for field in FRAME)) for row in ledger.rows)
    points, tracks = [], dict[str, Track]()
    for point in (row.point for row in rows):
        points.append(repr((point.tracker, point.lag, point.step, point.status, point.sensors)))
        if point.step % EVERY == 0 or point.step == rows[-1].point.step:
            key = f"{point.tracker.partition('+')[0]} lag {point.lag}"
            values = (*point.mean, *point.covariance[::5])
            tracks.setdefault(key, {})[str(point.step)] = " ".join(f"{value:.8f}" for value in values)
    return {"frames": len(frames), "digest": digest(frames), "points": digest(sorted(points)), "tracks": tracks}


def digest(lines: Sequence[str]) -> str:
    """Of these lines, in their order."""
    return blake2b("\n".join(lines).encode(), digest_size=16).hexdigest()


def golden(name: str) -> dict[str, Any]:
    return json.loads(GOLDEN.read_text(encoding="utf-8"))[name]  # type: ignore[no-any-return]


def numbers(track: Track) -> dict[str, list[float]]:
    return {step: [float(value) for value in text.split()] for step, text in track.items()}


@pytest.mark.parametrize("name", CASES)
def test_every_frame_has_the_fate_it_had(name: str) -> None:
    old, new = golden(name), story(name)
    assert (new["frames"], new["digest"]) == (old["frames"], old["digest"]), (
        f"{name}: frames or their fates are not what they were; python -m tests.same_as COMMIT shows which"
    )


@pytest.mark.parametrize("name", CASES)
def test_every_point_has_the_status_and_the_reports_it_had(name: str) -> None:
    assert story(name)["points"] == golden(name)["points"]


@pytest.mark.parametrize("name", CASES)
def test_every_track_goes_where_it_went(name: str) -> None:
    old, new = golden(name)["tracks"], story(name)["tracks"]
    assert new.keys() == old.keys()
    for tracker in old:
        was, now = numbers(old[tracker]), numbers(new[tracker])
        hint = f"{name}: {tracker} is not what it was; python -m tests.same_as COMMIT shows where"
        assert now.keys() == was.keys(), hint
        for step in was:
            assert now[step] == pytest.approx(was[step], rel=RELATIVE, abs=TOLERANCE), f"{hint} (here step {step})"


if __name__ == "__main__":
    GOLDEN.write_text(json.dumps({name: story(name) for name in CASES}, indent=1) + "\n", encoding="utf-8")
