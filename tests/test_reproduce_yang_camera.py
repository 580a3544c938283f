"""The camera in the study of Yang et al. (2009): trials, whole runs, and what is said of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import atan2, degrees, hypot, radians, tan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from launcher.reproduce.kernels.study import Figures, Found
from launcher.reproduce.papers.yang.camera import whole
from launcher.reproduce.papers.yang.camera.aimed import (
    ACROSS,
    ANY,
    DELAYS,
    EXPERIMENTS,
    FAR,
    FAST,
    LINES,
    NEAR,
    NOWHERE,
    VIEWS,
    camera_case,
    pointed,
)
from launcher.reproduce.papers.yang.camera.claims import claims
from launcher.reproduce.papers.yang.camera.tables import TITLES, TOLD, parts, share_seen, tables
from launcher.reproduce.papers.yang.figures.camera import camera
from launcher.reproduce.papers.yang.trials.field import SPEED
from launcher.reproduce.papers.yang.trials.setups import USUAL
from launcher.reproduce.tables import UNKNOWN
from trackfield.models import passing
from trackfield.models.pointing import EVI_D30, in_view, towards

EXACT = replace(USUAL, time_s=0.0, strength=0.0)


@pytest.fixture(scope="module")
def trials() -> Mapping[str, Figures]:
    """A hundred trials of each experiment that has a band."""
    seeds = range(1, 101)
    return {camera_case(line, SPEED): EXPERIMENTS[camera_case(line, SPEED)].run(seeds) for line in ("A to C", ANY)}


def _at(figures: Figures, way: str, view: str, delay: float) -> np.ndarray[Any, Any]:
    some = figures[f"{way} {view}"][:, DELAYS.index(delay)]
    return np.asarray(some[~np.isnan(some)])


def test_prediction_decides_one_second_after_the_last_pass(trials: Mapping[str, Figures]) -> None:
    """Of 500 trials all are in the picture with prediction, and none without: five of 100 are beyond any chance."""
    figures = trials[camera_case("A to C", SPEED)]
    seen, lost = (_at(figures, way, NEAR, 1.0) for way in ("with", "without"))
    assert len(seen) > 80
    assert (seen == 1).mean() > 0.95
    assert (lost == 1).mean() < 0.05


def test_without_prediction_a_target_is_lost_the_later_the_more(trials: Mapping[str, Figures]) -> None:
    for figures in trials.values():
        shares = [(_at(figures, "without", NEAR, delay) == 1).mean() for delay in DELAYS]
        assert shares == sorted(shares, reverse=True)
        assert shares[0] > 0.9


def test_what_a_camera_far_away_sees_needs_no_prediction_at_30_mph(trials: Mapping[str, Figures]) -> None:
    for figures in trials.values():
        for way in ("with", "without"):
            assert (_at(figures, way, FAR, 1.0) == 1).all()


@pytest.mark.parametrize("speed", [SPEED, FAST])
def test_by_exact_fixes_all_that_can_be_met_is_in_the_picture(speed: float) -> None:
    figures = pointed(replace(EXACT, speed=speed), None, range(1, 41))
    for view in VIEWS:
        for delay in DELAYS:
            assert set(_at(figures, "with", view, delay)) <= {1.0, NOWHERE}
    assert (figures[f"with {NEAR}"] == NOWHERE).any()


def test_without_prediction_the_target_is_where_it_has_gone_since() -> None:
    """One exact trial by hand: from the last CPA to the end of the turn it has gone (delay + turn) times its speed."""
    line = LINES["A to C"]
    assert line is not None
    figures = pointed(EXACT, line, [1])
    places = USUAL.places
    mount = VIEWS[NEAR].mount(places.mean(axis=0))
    e = np.array([np.sin(radians(87.0)), np.cos(radians(87.0))])
    last = passing.times(np.concatenate([[0.0, 0.0], SPEED * e]), places, 340.0).max()
    to = towards(mount, *(last * SPEED * e).tolist())
    turn_s = max(abs(to.pan) / EVI_D30.pan_s, abs(to.tilt) / EVI_D30.tilt_s)
    for delay, seen in zip(DELAYS, figures[f"without {NEAR}"][0], strict=True):
        assert seen == in_view(mount, to, *((last + delay + turn_s) * SPEED * e).tolist())
    assert set(figures[f"without {NEAR}"][0]) == {0.0, 1.0}


def test_the_cameras_look_at_the_field_or_north() -> None:
    middle = USUAL.places.mean(axis=0)
    for name in (FAR, NEAR):
        assert towards(VIEWS[name].mount(middle), *middle.tolist()).pan == pytest.approx(0.0)
    assert towards(VIEWS[ACROSS].mount(middle), 30.0, 100.0).pan == pytest.approx(0.0)


def test_all_lines_of_whole_runs_are_those_of_the_trials() -> None:
    for line in LINES.values():
        if line is not None:
            (t0, x0, y0), (t1, x1, y1) = whole.waypoints(line, FAST)
            assert hypot(x1 - x0, y1 - y0) / (t1 - t0) == pytest.approx(FAST)
            assert ((x0 + x1) / 2, (y0 + y1) / 2) == pytest.approx((line.x_m, line.y_m))
            assert degrees(atan2(x1 - x0, y1 - y0)) % 360 == pytest.approx(line.heading_deg)


@pytest.fixture(scope="module")
def runs() -> dict[str, Figures]:
    """One run of each experiment with roles."""
    return {name: one.run([1]) for name, one in whole.EXPERIMENTS.items()}


def test_from_sound_to_the_picture(runs: dict[str, Figures]) -> None:
    assert runs[whole.WITH]["seen"].tolist() == [[1.0]]
    assert runs[whole.WITHOUT]["seen"].tolist() == [[0.0]]
    assert runs[whole.WITH]["filmed"].tolist() == [[1.0]]
    assert runs[whole.WITH]["off"] < 3.0
    assert runs[whole.WITHOUT]["off"] > EVI_D30.wide / 2
    assert runs[whole.WITH]["delay"] == runs[whole.WITHOUT]["delay"]
    assert 1.0 < runs[whole.WITH]["delay"] < 2.0  # a second of sound after the peak, and the way
    assert runs[whole.WITH]["after"] > 0


def test_more_and_slower_hops_take_longer(runs: dict[str, Figures]) -> None:
    """Three hops of 20 ms, and three of 40 ms, besides what the radio takes and repeats."""
    base, three, twice = (float(runs[name]["delay"].item()) for name in (whole.WITH, whole.HOPS, whole.TWICE))
    assert three > base + 0.06
    assert twice > base + 0.12
    assert runs[whole.TWICE]["seen"].tolist() == [[1.0]]


def test_what_the_camera_cannot_be_turned_to(runs: dict[str, Figures]) -> None:
    """From B to D the target passes behind a camera at (30, -25); a fast one is seen from the edge of its reach."""
    assert runs[whole.PACKAGED]["seen"].tolist() == [[1.0, 1.0, NOWHERE, 1.0]]
    assert runs[whole.ALL_FAR]["seen"].tolist() == [[1.0, 1.0, 1.0, 1.0]]
    assert runs[whole.FASTER]["seen"].tolist() == [[1.0]]
    assert 10.0 < runs[whole.FASTER]["off"] < EVI_D30.wide / 2
    assert runs[whole.FASTER_ACROSS]["seen"].tolist() == [[1.0]]


def _many(runs: Mapping[str, Figures], count: int = 60, **seen: float) -> dict[str, Figures]:
    """Runs repeated, with what is ``seen`` in all passes of some of them."""
    found = {name: {key: np.repeat(some, count, axis=0) for key, some in one.items()} for name, one in runs.items()}
    for name, value in seen.items():
        some = found[getattr(whole, name)]
        some["seen"] = np.full_like(some["seen"], value)
    return found


def _found(trials: Mapping[str, Figures], runs: Mapping[str, Figures]) -> Found:
    missing = {name: next(iter(trials.values())) for name in EXPERIMENTS if name not in trials}
    return Found(100, {**missing, **trials, **runs})


def test_what_is_said_of_the_camera(trials: Mapping[str, Figures], runs: dict[str, Figures], tmp_path: Path) -> None:
    found = _found(trials, _many(runs))
    assert [title for title, _ in parts(found)] == list(TITLES.values())
    verdicts = [one.verdict for one in claims(found)]
    assert verdicts == ["holds in part", "holds in part", "holds", "holds", "holds"]
    worse = _found(trials, _many(runs, WITHOUT=1.0, TWICE=0.0, FASTER=NOWHERE, FASTER_ACROSS=NOWHERE, ALL_FAR=np.nan))
    assert [one.verdict for one in claims(worse)][1:] == ["does not hold"] * 4
    few = _found(trials, runs)
    assert {one.verdict for one in claims(few)[1:]} == {UNKNOWN}
    assert len(claims(_found(trials, {}))) == 1
    assert [title for title, _ in parts(_found(trials, {}))] == [TITLES["camera"]]
    camera(found).savefig(tmp_path / "camera.png")
    assert (tmp_path / "camera.png").exists()


def test_the_table_of_trials_is_that_of_the_figures(trials: Mapping[str, Figures], runs: dict[str, Figures]) -> None:
    found = _found(trials, _many(runs))
    case = camera_case(ANY, SPEED)
    rows = [row for row in tables(found)["camera"] if row.case == case and row.tracker.startswith(f"{NEAR}, ")]
    for delay in TOLD:
        told = {row.tracker: row.ours.value for row in rows if row.quantity.endswith(f" {delay:g} s")}
        assert told[f"{NEAR}, with prediction"] == share_seen(found, case, "with", NEAR, delay).value
        assert told[f"{NEAR}, with prediction"] + told[f"{NEAR}, out of reach"] <= 1.0
    banded = [row for row in tables(found)["camera"] if row.band]
    assert {(row.band, row.quantity) for row in banded} == {
        ("0.95-1", "in the picture, 1 s"), ("≤ 0.2", "in the picture, 1 s"),
    }  # fmt: skip


def test_the_eight_runs_of_the_field(trials: Mapping[str, Figures], runs: dict[str, Figures]) -> None:
    found = _found(trials, _many(runs, 2))
    text = dict(parts(found))[TITLES["camera, table 1"]]
    assert text.count("\n") == 9
    assert text.count("| yes, ") == 6 + 8
    assert text.count("| out of reach, ") == 2
    alone = dict(parts(_found(trials, runs)))[TITLES["camera, table 1"]]
    assert alone.count("no fix") == 8  # of the second run of each direction, from either camera


def test_half_of_the_picture_is_24_degrees() -> None:
    """What the charts and tables call in the picture: of 48.8 degrees, at the instant of the aim."""
    mount = VIEWS[ACROSS].mount(np.zeros(2))
    aside = 50.0 * tan(radians(EVI_D30.wide / 2))
    for by, seen in ((0.99, True), (1.01, False)):
        assert in_view(mount, towards(mount, 30.0, 25.0), 30.0 + by * aside, 25.0) == seen
