"""Whole fields with a camera: a fix leaves the field and the camera looks, whatever fails on the way."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from launcher.study.compare import differences
from tests.camera_fields import HOPS, NOISE, Watching, expected, watched
from tests.running import both_ways
from trackfield.role import NS

FIELDS: dict[str, dict[str, Any]] = {"next to it": {}, "three hops": HOPS}
EVERY = ["aimed", "aimed", "out of reach", "aimed"]
"""What becomes of the four passes: the third target goes where the camera cannot look from where it stands."""
CROSSING: dict[str, Any] = {
    "target.waypoints": [[0, -133.928, -7.019], [20, 133.928, 7.019], [40, -133.928, -7.019]],
    "targets": [
        {
            "id": "second",
            "path": "waypoints",
            "waypoints": [[6, -105.682, 69.568], [26, 105.682, -95.568], [46, -105.682, 69.568]],
        }
    ],
}
"""Two vehicles on paths that cross, as in the head comment of the packaged file."""


def down(id: str, from_s: float, until_s: float) -> dict[str, Any]:
    """A process is down for some time."""
    return {"faults": [{"kind": "restart", "nodes": [id], "at_s": from_s, "until_s": until_s}]}


def dead(id: str, at_s: float) -> dict[str, Any]:
    """A process dies."""
    return {"faults": [{"kind": "kill", "nodes": [id], "at_s": at_s}]}


def cut(medium: str, from_s: float, until_s: float) -> dict[str, Any]:
    """The gateway is cut off from one of its media."""
    return {"faults": [{"kind": "partition", "nodes": ["base"], "medium": medium, "at_s": from_s, "until_s": until_s}]}


def delays(run: Watching) -> list[float]:
    """How long (s) after the last pass of its event each fix was there, as camera control measured it."""
    return [said.values[3] for said in run.told("aimed")]


# --- as it should be --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("field", FIELDS)
def test_each_fix_turns_the_camera_if_its_target_is_in_reach(field: str) -> None:
    run = watched(**FIELDS[field])
    watch = expected(run.plan)
    assert run.outcomes == EVERY
    assert run.outcomes == ["out of reach" if fixed in watch.missed else "aimed" for fixed in watch.told]
    assert run.gateway == (0, 4, 0, 0, 0)
    assert run.frames() == {1: 40, 2: 40, 3: 40}  # 4 s, 10 a second


@pytest.mark.parametrize("field", FIELDS)
def test_the_target_is_in_the_picture_when_the_camera_is_there(field: str) -> None:
    run = watched(**FIELDS[field])
    aims = [said for said in run.told("aimed") if said.values[-1] == "aimed"]
    for said in aims:
        assert run.sees((said.values[5] - run.plan.origin_ns) / NS)
    assert len(aims) == 3


def test_without_prediction_the_camera_misses_who_goes_by_it() -> None:
    """Two of the four go away from the camera, and their bearings change by 2 and by 10 degrees: they stay in the
    picture of 48.8 degrees. Those that go past it are gone, by 50 and by 81 degrees.
    """
    run = watched(camera__predict=False)
    aims = [said for said in run.told("aimed") if said.values[-1] == "aimed"]
    assert [run.sees((said.values[5] - run.plan.origin_ns) / NS) for said in aims] == [False, True, False, True]


@pytest.mark.parametrize("field", FIELDS)
def test_camera_control_has_fixes_when_it_was_predicted(field: str) -> None:
    """To 80 ms: a message of diffusion takes two hops, one of the backbone may be lost and sent again."""
    run = watched(**FIELDS[field])
    watch = expected(run.plan)
    told_s = [said.at_s for said in run.told("aimed")]
    due_s = [((one.base_ns or 0) - run.plan.origin_ns) / NS + watch.backbone.after_s for one in watch.told]
    assert told_s == pytest.approx(due_s, abs=0.08)
    assert min(told - due for told, due in zip(told_s, due_s, strict=True)) > -0.01


def test_hops_come_on_top_of_the_measured_delay() -> None:
    """By clocks that are off by milliseconds."""
    near, far = watched(), watched(**HOPS)
    more_s = expected(far.plan).backbone.after_s - expected(near.plan).backbone.after_s
    for one, other in zip(delays(near), delays(far), strict=True):
        assert other - one == pytest.approx(more_s, abs=0.03)
    assert more_s == pytest.approx(0.07, abs=0.005)  # three times 20 ms, and four times 1.4 ms on the air and more


def test_two_vehicles_at_a_time_are_both_looked_at() -> None:
    run = watched(**CROSSING)
    assert run.outcomes == ["aimed", "out of reach", "aimed", "aimed"]
    aimed = [said for said in run.told("aimed") if said.values[-1] == "aimed"]
    for said in aimed:
        assert run.sees((said.values[5] - run.plan.origin_ns) / NS)


def test_in_the_field_nothing_changes_by_a_camera() -> None:
    """Every frame of the field, with its instant and its fate."""
    alone, beyond = watched(camera__kind="none"), watched()

    def inside(run: Watching) -> list[tuple[object, ...]]:
        return sorted(
            (row.sent_ns, row.src, row.dst, row.kind, row.copy, row.outcome, row.due_ns or 0, row.payload)
            for row in run.ledger.rows
            if row.medium == "field"
        )

    assert inside(alone) == inside(beyond)
    assert len(inside(alone)) > 1000
    assert {row.medium for row in alone.ledger.rows} == {"field"}


# --- what fails -------------------------------------------------------------------------------------------------------


def test_a_gateway_that_is_cut_from_the_backbone_keeps_a_fix_until_it_is_back() -> None:
    run = watched(**cut("backbone", 12.0, 15.0))
    assert run.outcomes == EVERY
    assert run.gateway == (0, 4, 0, 0, 0)
    first = run.told("aimed")[0]
    assert 15.0 < first.at_s < 16.0
    later_s = first.at_s - watched().told("aimed")[0].at_s
    assert first.values[3] == pytest.approx(delays(watched())[0] + later_s, abs=1e-4)  # its clock drifts by 20 ppm
    assert run.sees((first.values[5] - run.plan.origin_ns) / NS)


def test_a_gateway_that_is_cut_from_the_field_is_told_later() -> None:
    """By the next exploration of diffusion; camera control predicts over all that time."""
    run = watched(**cut("field", 11.0, 16.0))
    assert run.outcomes == EVERY
    assert 16.0 < run.told("aimed")[0].at_s < 19.0
    assert run.gateway == (0, 4, 0, 0, 0)


def test_control_that_was_restarted_in_mid_pass_takes_what_the_gateway_still_sends() -> None:
    run = watched(**down("camera-control", 12.5, 13.5))
    assert run.outcomes == EVERY
    first = run.told("aimed")[0]
    assert 13.5 < first.at_s < 14.0
    assert run.sees((first.values[5] - run.plan.origin_ns) / NS)
    assert run.gateway == (0, 4, 0, 0, 0)


def test_control_that_was_restarted_while_the_camera_turns_aims_again() -> None:
    run = watched(**down("camera-control", 13.2, 14.2))
    first, again, *_ = run.told("aimed")
    assert run.outcomes == ["aimed", *EVERY]
    assert first.values[1:5] == again.values[1:5]  # the same fix
    assert [first.values[0], again.values[0]] == [1, 2]
    assert run.sees((again.values[5] - run.plan.origin_ns) / NS)


def test_behind_a_dead_hop_nobody_is_told() -> None:
    """The gateway keeps what waits, and no more than somebody wants."""
    run = watched(**HOPS, **dead("hop2", 30))
    assert run.outcomes == EVERY[:1]
    waiting, passed, _, dropped, unwanted = run.gateway
    assert (waiting + unwanted, passed, dropped) == (3, 1, 0)
    assert unwanted >= 1


def test_behind_a_hop_that_is_back_all_are_told() -> None:
    run = watched(**HOPS, **down("hop2", 30, 34))
    assert run.outcomes == EVERY
    assert 34.0 < run.told("aimed")[1].at_s < 37.0
    assert run.gateway == (0, 4, 0, 0, 0)


def test_a_camera_that_died_is_said_to_be_lost() -> None:
    run = watched(**dead("camera", 30))
    assert run.told("camera")[-1].values == ("lost",)
    assert run.outcomes == ["aimed", "aimed", "camera lost", "camera lost"]  # the second was to show it
    assert run.gateway == (0, 4, 0, 0, 0)
    assert set(run.frames()) == {1, 2}


def test_a_camera_that_is_back_looks_at_who_is_still_to_come() -> None:
    run = watched(**down("camera", 30, 34))
    words = [said.values[0] for said in run.told("camera") if 30 < said.at_s < 36]
    assert words == ["lost", "ready", "moving", "there"]
    again = run.told("aimed")[2]
    assert 34.0 < again.at_s < 35.5
    assert run.sees((again.values[5] - run.plan.origin_ns) / NS)
    assert run.outcomes == ["aimed", "aimed", "aimed", "out of reach", "aimed"]


def test_without_video_the_camera_still_looks() -> None:
    run = watched(**dead("video", 30))
    assert run.outcomes == EVERY
    assert run.frames() == {1: 40}


def test_a_base_that_is_back_knows_who_wants_fixes() -> None:
    run = watched(**down("base", 30, 31))
    assert run.outcomes == EVERY
    assert run.gateway[:2] == (0, 3)  # of its second life


def test_video_that_is_stopped_by_an_order_makes_no_frames() -> None:
    orders = [[30, "stop", "video"], [50, "start", "video"], [60, "status", "hop2"]]
    run = watched(**HOPS, camera__orders=orders)
    assert [said.values[1:] for said in run.told("order")] == [
        ("stop", "video", "ok"),
        ("start", "video", "ok"),
        ("status", "hop2", "ok"),
    ]
    assert run.frames() == {1: 40, 3: 40}


# --- both drivers -----------------------------------------------------------------------------------------------------


def test_as_processes_it_is_the_same(tmp_path: Path) -> None:
    """Two passes over three hops that lose frames, and a camera that is away between them, equal to the last bit."""
    settings = {**NOISE, **HOPS, "target.steps": 76, **down("camera", 16, 20)}
    arguments = [word for key, value in settings.items() for word in ("--set", f"{key}={_toml(value)}")]
    home = both_ways(tmp_path, "yang-ecpa", *arguments, "--quiet")
    assert differences(home / "virtual", home / "processes", 0.0) == []


def _toml(value: Any) -> str:
    """A value as on the command line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}={_toml(one)}' for key, one in value.items())}}}"
    return repr(value)
