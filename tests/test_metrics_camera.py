"""``camera`` of metrics.json: exact small cases, what lives told, and a run."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path as FilePath
from typing import Any

import pytest

from launcher.outside import Counts, Known, Ordered, Outside, Refusal
from launcher.plan.prepare import load, planned
from launcher.record.diary import Diary
from launcher.record.figures.camera.figures import OF_CAMERA, CameraFigures, in_study
from launcher.record.figures.camera.metrics import camera_metrics
from launcher.record.metrics import run_metrics
from launcher.record.outside.kept import write_camera
from launcher.record.outside.told import TOPICS, outside_of
from launcher.record.words import filmed
from launcher.records import Plan
from launcher.study.comparison.rows import camera_rows
from launcher.study.figures import FIGURES
from tests.camera_tellings import END_NS, MOUNT, ONE, PATH, aim, everything, ns, still, turn
from tests.simulated import simulated
from tests.test_metrics import KEYS, expanded
from trackfield.drivers.engine.frames import RANK_TIMER, Told, Undone
from trackfield.role import Tell
from trackfield.world.path import Path

NOTHING = {"mean": None, "p95": None, "max": None}
SETTINGS = ["sensor.waveform=false", "camera.kind=evi-d30", "target.steps=60"]


def figures(outside: Outside, paths: Mapping[str, Path] = ONE) -> dict[str, Any]:
    found = camera_metrics(outside, paths, END_NS)
    assert found is not None
    CameraFigures.model_validate(found)
    json.dumps(found, allow_nan=False)
    return found


@cache
def plan() -> Plan:
    return planned(load("yang-ecpa", settings=SETTINGS))


# --- exact ------------------------------------------------------------------------------------------------------------


def test_without_a_camera_there_is_nothing() -> None:
    assert camera_metrics(None, ONE, END_NS) is None
    assert in_study(None) == dict.fromkeys(OF_CAMERA)


def test_a_camera_of_which_nothing_was_told_has_no_shares() -> None:
    found = figures(Outside(MOUNT))
    assert (found["fixes"], found["shots"], found["outcomes"], found["targets"]) == (0, 0, {}, {})
    assert found["in_frame"] == {"at_aim": None, "aims": 0, "frames": None, "frames_n": 0, "shots": None}
    for key in ("delay_s", "slew_s", "first_seen_s", "place_m", "pan_deg", "tilt_deg"):
        assert found[key] == NOTHING
    assert found["lost"] == {"times": 0, "s": 0.0}
    assert set(found["gateway"].values()) == {0} == set(found["orders"].values())


def test_the_figures_of_what_was_told_by_hand() -> None:
    found = figures(everything())
    assert (found["fixes"], found["shots"], found["replaced"]) == (2, 1, 0)
    assert found["outcomes"] == {"aimed": 1, "superseded": 1}
    assert (found["in_frame"]["at_aim"], found["in_frame"]["aims"], found["in_frame"]["frames_n"]) == (1.0, 1, 6)
    assert found["delay_s"] == {"mean": 1.25, "p95": 1.25, "max": 1.25}
    assert found["slew_s"]["mean"] == 45.0 / 80.0
    assert found["gateway"] == {"passed": 1, "refused": 0, "dropped": 0, "unwanted": 0, "queue_max": 1}
    assert found["orders"] == {"ok": 1, "refused": 0, "unknown": 0, "silent": 0}
    assert found["refused_orders"] == 1


def test_a_share_is_of_the_shots_that_can_be_judged() -> None:
    """One is seen, one not, one replaced, and one aims at later than the run."""
    shots = (
        aim(9.0, 10.0, 0.0, delay_s=1.0),
        aim(12.0, 13.0, 30.0, shot=2, delay_s=2.0),
        aim(14.0, 15.0, 0.0, shot=3, delay_s=3.0),
        aim(14.5, 21.0, 0.0, shot=4, delay_s=4.0),
    )
    found = figures(Outside(MOUNT, (still(),), shots))
    assert (found["shots"], found["replaced"]) == (4, 1)
    assert (found["in_frame"]["at_aim"], found["in_frame"]["aims"]) == (0.5, 2)
    assert found["delay_s"]["mean"] == 2.5 and found["delay_s"]["p95"] == pytest.approx(3.85)
    assert found["pan_deg"] == {"mean": 22.5, "p95": pytest.approx(42.75), "max": pytest.approx(45.0)}, "sizes"


def test_errors_of_one_side_do_not_cancel_those_of_the_other() -> None:
    shots = (aim(6.9, 7.0, -30.0), aim(12.9, 13.0, 30.0, shot=2))
    found = figures(Outside(MOUNT, (still(),), shots))
    assert found["pan_deg"]["mean"] == pytest.approx(45.0)


def test_several_targets_have_figures_of_their_own() -> None:
    other = Path.of([(0.0, 0.0, 60.0, 0.0, 0.0), (20.0, 0.0, 60.0, 0.0, 0.0)])
    paths = {"target": PATH, "other": other, "nobody": other.clip(0.0, 1.0)}
    shots = (aim(2.0, 3.0, 0.0, 58.0), aim(12.0, 13.0, 30.0, shot=2))
    found = figures(Outside(MOUNT, (still(),), shots), paths)
    assert {id: (one["n"], one["at_aim"]) for id, one in found["targets"].items()} == {
        "target": (1, 0.0), "other": (1, 1.0), "nobody": (0, None),
    }  # fmt: skip


def test_the_camera_is_lost_from_when_that_is_told_until_anything_else_is() -> None:
    states = [(1, "ready"), (2, "lost"), (3, "lost"), (5, "ready"), (6, "moving"), (17, "lost")]
    found = figures(Outside(MOUNT, states=tuple(Known(ns(t_s), state) for t_s, state in states)))
    assert found["lost"] == {"times": 2, "s": 3.0 + 3.0}, "the second time until the end, at 20 s"


def test_the_gateway_counts_in_each_of_its_lives() -> None:
    counts = [(1, 0, 2, 3, 1, 0, 0), (2, 0, 5, 4, 1, 2, 0), (3, 1, 0, 0, 0, 0, 0), (4, 1, 1, 6, 0, 0, 7)]
    found = figures(Outside(MOUNT, counts=tuple(Counts(ns(t_s), *rest) for t_s, *rest in counts)))
    assert found["gateway"] == {"passed": 10, "refused": 1, "dropped": 2, "unwanted": 7, "queue_max": 5}


def test_orders_by_how_they_ended() -> None:
    answers = ["ok", "silent", "ok", "unknown"]
    orders = tuple(Ordered(ns(n), n, "status", "video", answer) for n, answer in enumerate(answers))
    found = figures(Outside(MOUNT, orders=orders, refusals=(Refusal(0, "video", "x", "replayed"),) * 2))
    assert found["orders"] == {"ok": 2, "refused": 0, "unknown": 1, "silent": 1}
    assert found["refused_orders"] == 2


def test_every_key_and_no_other() -> None:
    found = figures(everything(), {"target": PATH, "other": PATH})
    names = {"outcomes": "<outcome>", "targets": "<id>"}

    def keys(values: dict[str, Any], before: str = "") -> set[str]:
        each = set()
        for name, value in values.items():
            key = f"{before}.{names.get(before, name)}".lstrip(".")
            each |= keys(value, key) if isinstance(value, dict) else {key}
        return each

    assert {f"camera.{key}" for key in keys(found)} == {key for key in expanded(KEYS) if key.startswith("camera.")}


def test_a_study_has_what_one_would_vary_settings_for() -> None:
    row = in_study(CameraFigures.model_validate(figures(everything())))
    assert row.keys() == set(OF_CAMERA) <= FIGURES.keys()
    assert (row["camera.in_frame.at_aim"], row["camera.delay_s.mean"], row["camera.gateway.dropped"]) == (1.0, 1.25, 0)


def test_a_comparison_has_rows_for_cameras_if_any_run_has_one() -> None:
    one, two = figures(everything()), figures(Outside(MOUNT, (still(),), (aim(12.0, 13.0, 30.0),)))
    rows = {row.name: row for row in camera_rows([{"camera": found} for found in (one, two, None)])}
    assert rows["target in the picture at the aim"].said == ("100.0 %", "0.0 %", "–")
    assert rows["target in the picture at the aim"].best == (True, False, False)
    assert rows["shots"].said == ("1", "1", "–")
    assert "camera lost [times]" not in rows, "no camera was"
    assert camera_rows([{"camera": None}] * 2) == []


def test_a_terminal_is_told_in_two_lines() -> None:
    found = figures(everything())
    found["lost"] = {"times": 1, "s": 3.5}
    first, second = filmed({"camera": found})
    assert first.startswith("camera: 1 shot of 2 fixes; target in the picture at 1 of 1 aim, in ")
    assert first.endswith("; 1.25 s from the last pass to the camera, mean; lost 1 time, for 3.5 s")
    assert second == "gateway: 1 passed, 0 refused, 0 dropped, 0 unwanted, at most 1 waited; orders: 1 ok"
    assert filmed({"camera": None}) == []
    assert filmed({"camera": figures(Outside(MOUNT))})[0] == "camera: 0 shots of 0 fixes"


# --- what lives told --------------------------------------------------------------------------------------------------


def diary(id: str, *told: tuple[float, Tell], incarnation: int = 0) -> Diary:
    spec = next(one for one in plan().processes if one.id == id)
    found = Diary(replace(spec, incarnation=incarnation))
    for number, (t_s, effect) in enumerate(told):
        found.write(Told((ns(t_s), RANK_TIMER, number, "x"), effect))
    return found


def values_of(row: Any) -> tuple[Any, ...]:
    """What a role tells of a row: all but the time, and who it was."""
    own = ("t_ns", "life", "process")
    return tuple(value for name, value in zip(row._fields, row, strict=True) if name not in own)


def test_all_that_processes_tell_is_found_in_their_diaries() -> None:
    told = everything()
    by = {"motion": "camera", "exposed": "video", "gateway": "base", "order": "system", "refused order": "video"}
    rows = {topic: getattr(told, kind) for topic, kind in TOPICS.items()}
    diaries = [
        diary(by.get(topic, "camera-control"), *((row.t_ns / 1e9, Tell(topic, values_of(row))) for row in several))
        for topic, several in rows.items()
    ]
    found, strange = outside_of(plan(), diaries)
    assert found is not None and strange == []
    assert replace(found, mount=MOUNT) == told


def test_lives_of_the_gateway_are_told_apart_and_undone_tellings_are_gone() -> None:
    later = diary("base", (6.0, Tell("gateway", (0, 1, 0, 0, 0))), incarnation=1)
    camera = diary("camera", (0.0, Tell("motion", values_of(still()))), (9.0, Tell("motion", values_of(turn(9, 0, 9)))))
    camera.write(Undone((ns(8.0),)))
    found, _ = outside_of(plan(), [later, diary("base", (1.0, Tell("gateway", (0, 2, 0, 0, 0)))), camera])
    assert found is not None
    assert [(one.life, one.passed) for one in found.counts] == [(0, 2), (1, 1)]
    assert found.turns == (still(),)


@pytest.mark.parametrize(
    ("topic", "values"),
    [
        ("motion", (0.0, 0.0, 0.0, 0.0, 80.0)),
        ("motion", (0.0, 0.0, float("nan"), 0.0, 80.0, 50.0)),
        ("motion", (0.0, 0.0, 1e9, 0.0, 80.0, 50.0)),
        ("motion", ("x", 0.0, 0.0, 0.0, 80.0, 50.0)),
        ("exposed", (-1, 0)),
        ("exposed", (1.5, 0)),
        ("camera", ("tired",)),
        ("camera", ()),
        ("gateway", (2**40, 0, 0, 0, 0)),
        ("order", (1, "status", "video", "perhaps")),
        ("order", (1, "status", "x" * 1000, "ok")),
        ("aimed", values_of(aim(1.0, 2.0, 0.0, outcome="bored"))),
        ("aimed", values_of(aim(1.0, 2.0, float("inf"), pan=0.0, tilt=0.0))),
        ("nonsense", ()),
    ],
)
def test_what_cannot_be_is_left_out_and_said(topic: str, values: tuple[int | float | str, ...]) -> None:
    good = diary("camera", (1.0, Tell("motion", values_of(still(1.0)))))
    found, strange = outside_of(plan(), [good, diary("video", (2.0, Tell(topic, values)), (3.0, Tell(topic, values)))])
    assert found is not None and found == replace(Outside(MOUNT, (still(1.0),)), mount=found.mount)
    (why,) = strange
    assert why.startswith("video told of") and why.endswith("(2 times)")


def test_values_that_a_later_version_adds_are_left_out() -> None:
    found, strange = outside_of(plan(), [diary("video", (2.0, Tell("exposed", (1, 0, "more"))))])
    assert found is not None and strange == [] and len(found.exposures) == 1


# --- a run ------------------------------------------------------------------------------------------------------------


def test_a_run_points_its_camera_at_what_passes(tmp_path: FilePath) -> None:
    ledger, tracks = simulated(plan())
    found = run_metrics(plan(), ledger, tracks)["camera"]
    outside, strange = outside_of(plan(), ledger.diaries.values())
    assert outside is not None and strange == []
    assert found["shots"] == len(outside.shots) > 0
    assert found["in_frame"]["at_aim"] == 1.0
    assert found["in_frame"]["frames_n"] == len(outside.exposures) > 0
    write_camera(outside, tmp_path / "camera.json")
    json.loads((tmp_path / "camera.json").read_text())
