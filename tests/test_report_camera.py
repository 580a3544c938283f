"""The part of a report about a camera, and camera.json: written, read back, damaged, kept by a replay."""

from __future__ import annotations

import contextlib
import io
import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import pytest
from PIL import Image

from launcher import report
from launcher.files import CAMERA
from launcher.outside import Known, Outside
from launcher.record.figures.camera.metrics import camera_metrics
from launcher.record.journal import METRICS
from launcher.record.outside.kept import write_camera
from launcher.record.outside.rows import KINDS
from launcher.record.reading.camera import check_camera, read_camera
from launcher.report.folder import Run, read_run
from launcher.report.parts import camera, pointing
from launcher.study.replay import replay
from tests.camera_tellings import END_NS, MOUNT, ONE, aim, everything, ns, still, turn
from tests.damaged_runs import COMMANDS, wrong
from tests.damages import spoil
from tests.reporting import read, run
from trackfield.errors import ScenarioError

WITH_CAMERA = ("sensor.waveform=false", "camera.kind=evi-d30")
HOPS = ("camera.hops=[[60,-60],[100,-60],[70,-40]]", "backbone.model=lognormal_prr", "backbone.radio=wifi11b")


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One pass, and one shot of it, over three hops."""
    return run(tmp_path_factory.mktemp("watched"), *WITH_CAMERA, *HOPS, scenario="yang-ecpa", steps=36)


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Another run, with two shots."""
    folder = tmp_path_factory.mktemp("other")
    return run(folder, *WITH_CAMERA, "camera.predict=false", scenario="yang-ecpa", steps=70)


@pytest.fixture
def bad(watched: Path, tmp_path: Path) -> Path:
    """A copy, to be spoilt."""
    return Path(shutil.copytree(watched, tmp_path / "bad"))


def told_by_hand(folder: Path, outside: Outside) -> Run:
    """The run of a folder as if its camera had told this, and nobody else."""
    found = read_run(folder)
    end_ns = found.site.origin_ns + round(found.metrics["ended_s"] * 1e9)
    metrics = {**found.metrics, "camera": camera_metrics(outside, found.site.paths, end_ns)}
    return replace(found, outside=outside, metrics=metrics)


# --- camera.json ------------------------------------------------------------------------------------------------------


def test_what_was_told_is_read_back(tmp_path: Path) -> None:
    write_camera(everything(), tmp_path / CAMERA)
    assert read_camera(tmp_path) == everything()
    write_camera(Outside(MOUNT), tmp_path / CAMERA)
    assert read_camera(tmp_path) == Outside(MOUNT)


def test_figures_follow_from_the_folder_alone(watched: Path) -> None:
    found = read_run(watched)
    assert found.outside is not None and found.outside.shots
    end_ns = found.site.origin_ns + round(found.metrics["ended_s"] * 1e9)
    assert camera_metrics(found.outside, found.site.paths, end_ns) == found.metrics["camera"]


def test_the_document_tells_each_list_and_its_fields() -> None:
    text = (Path(__file__).parents[1] / "docs" / "metrics.md").read_text().partition("\n## camera.json\n")[2]
    rows = {line.split("`")[1]: line for line in text.partition("\n## ")[0].splitlines() if line.startswith("| `")}
    assert list(rows) == ["mount", *KINDS]
    for name, kind in KINDS.items():
        missing = [field for field in kind._fields[1:] if f"`{field}`" not in rows[name]]
        assert not missing, f"{name}: {missing}"


def spoilt(file: Path, change: Callable[[Any], object]) -> str:
    """What is said of a file in which something was changed."""
    whole = json.loads(file.read_text())
    change(whole)
    file.write_text(json.dumps(whole))
    with pytest.raises(ScenarioError) as caught:
        read_run(file.parent)
    return str(caught.value)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda it: it.pop("turns"), "camera.json: turns: is missing"),
        (lambda it: it.update(aims={}), "camera.json: aims: is no list"),
        (lambda it: it["aims"].clear(), "camera.json: aims: has 0 rows; expected 1, as metrics.json says"),
        (
            lambda it: it["aims"][0].pop("head"),
            "camera.json: aims.0: is no whole row; expected a table with t_ns",
        ),
        (lambda it: it["aims"][0].update(outcome="x"), "camera.json: aims.0.outcome: is 'x'"),
        (lambda it: it["turns"][0].update(pan1="x"), "camera.json: turns.0.pan1: is 'x'"),
        (lambda it: it["turns"][0].update(pan1=1e300), "camera.json: turns.0.pan1: is 1e+300"),
        (lambda it: it["turns"].reverse(), "camera.json: turns: is not in the order of time"),
        (lambda it: it["exposures"][-1].update(t_ns=10**15), "camera.json: exposures.t_ns: is 1,000,000,000,000,000"),
        (lambda it: it["mount"].update(x_m=31.0), "camera.json: mount: is elsewhere; expected those of the run of its"),
        (lambda it: it["mount"].update(x_m=None), "camera.json: mount.x_m: is None; expected numbers"),
        (lambda it: it["mount"].update(more=1.0), "camera.json: mount: has other keys; expected x_m, y_m, z_m"),
    ],
)
def test_a_wrong_value_is_named(bad: Path, change: Callable[[Any], object], said: str) -> None:
    assert said in spoilt(bad / CAMERA, change)


def test_metrics_and_scenario_have_a_camera_both_or_none(bad: Path) -> None:
    assert "metrics.json: camera: is null" in spoilt(bad / METRICS, lambda it: it.update(camera=None))


def test_a_run_without_its_camera_file_says_so(bad: Path) -> None:
    (bad / CAMERA).unlink()
    with pytest.raises(ScenarioError, match=r"has no camera\.json; expected the folder of a finished run"):
        read_run(bad)


def test_a_run_without_a_camera_has_no_such_file(tmp_path: Path) -> None:
    folder = run(tmp_path / "run", steps=5)
    found = read_run(folder)
    assert not (folder / CAMERA).exists()
    assert (found.outside, found.metrics["camera"]) == (None, None)
    assert "Camera" not in read(report.write_report(folder).parent).text


def test_damages_are_refused_or_no_matter(watched: Path, other: Path, tmp_path: Path) -> None:
    """Files damaged as drawn from seeds: never anything but a ``ScenarioError``."""
    good, refused = read_run(watched), 0
    for seed in range(300):
        folder = tmp_path / str(seed)
        folder.mkdir()
        for name in (CAMERA, METRICS):
            shutil.copyfile(watched / name, folder / name)
        done = spoil(Random(seed), folder / CAMERA, other / CAMERA)
        try:
            found = read_camera(folder)
            check_camera(folder, found, good.metrics["camera"]["fixes"], good.site)
        except ScenarioError:
            refused += 1
        except Exception as error:  # noqa: BLE001  whatever it is
            pytest.fail(f"seed {seed}, {done}: {type(error).__name__}: {error}")
        else:
            told = told_by_hand(watched, found) if seed % 10 == 0 else None
            camera_metrics(found, good.site.paths, good.site.end_ns)
            assert told is None or camera.contents(told)
    assert 100 < refused < 300


@pytest.mark.parametrize(("name", "seeds"), [("report", range(8)), ("replay", range(8, 12)), ("open", range(12, 14))])
def test_commands_answer_damages_with_a_message(
    watched: Path, other: Path, tmp_path: Path, name: str, seeds: range
) -> None:
    for seed in seeds:
        work = tmp_path / str(seed)
        shutil.copytree(watched, work / "bad")
        done = spoil(Random(seed), work / "bad" / CAMERA, other / CAMERA)
        with contextlib.chdir(work):
            assert not wrong(COMMANDS[name]()), f"seed {seed}: {done}"


def test_a_replay_keeps_what_the_camera_did(tmp_path: Path) -> None:
    """Of a run without passes: fixes of heads, which hear targets themselves, cannot be made again."""
    quiet = run(tmp_path / "quiet", *WITH_CAMERA, scenario="yang-ecpa", steps=14)
    before = read_run(quiet)
    assert before.outside is not None and before.outside.turns and before.metrics["camera"]["fixes"] == 0
    again = replay(quiet, ["ml"], out=tmp_path / "again")
    assert (again.complaints, again.unreported) == ((), "")
    assert (again.folder / CAMERA).read_bytes() == (quiet / CAMERA).read_bytes()
    assert again.metrics["camera"] == before.metrics["camera"]
    assert "No fix came to camera control" in read(again.folder).text


# --- the page ---------------------------------------------------------------------------------------------------------


def test_the_page_says_what_came_of_each_shot(watched: Path) -> None:
    found, page = read_run(watched), read(report.write_report(watched).parent)
    assert camera.verdict(found.metrics["camera"]) in page.text
    assert "The target was in the picture at 1 of the 1 instants that the camera was aimed for" in page.text
    assert (watched / "plots" / "pointing.png").exists()
    assert "a node between them holds each for 20 ms besides" in page.text
    (row,) = camera.shots(found).rows
    assert row[1:3] == ["1", f"n000, step {found.outside.shots[0].step if found.outside else 0}"]
    assert row[-1] == "yes"


def test_each_hop_has_its_delay(watched: Path) -> None:
    table = camera.ways(read_run(watched))
    assert [row[0] for row in table.rows] == [
        "base → hop1", "hop1 → hop2", "hop2 → hop3", "hop3 → camera-control",
        "camera-control → camera", "camera-control → video",
    ]  # fmt: skip
    for row in table.rows:
        assert row[1] == row[2] != "0", "nothing was lost"
        assert 0.0 < float(row[3].split()[0]) <= float(row[4].split()[0]) < 20.0
    frames = read_run(watched).frames
    longest = frames.link_s[frames.where("kind", "visca") & frames.where("dst", "camera")].max()
    assert longest == pytest.approx(15 * 10 / 9600, abs=5e-5), "a drive is 15 bytes of 10 bits"


def test_a_fix_without_a_shot_says_why(other: Path) -> None:
    outside = Outside(
        MOUNT,
        (still(),),
        (
            aim(9.0, 10.0, 0.0),
            aim(9.1, 10.0, 0.0, shot=0, outcome="superseded"),
            aim(20.0, 21.0, 500.0, 500.0, shot=2),
            aim(45.0, 999.0, 0.0, shot=3),
        ),
    )
    rows = camera.shots(told_by_hand(other, outside)).rows
    assert rows[1][4:] == ["–", "–", "–", "–", "no shot: superseded"]
    assert rows[2][-1] in ("no: the camera did not look there", "no: the target was elsewhere")
    assert rows[3][-1] == "not known: after the end of the run"
    assert rows[3][5:8] == ["–", "–", "–"]


@pytest.mark.parametrize(
    ("outside", "said"),
    [
        (Outside(MOUNT), "No fix came to camera control, so the camera was never aimed."),
        (Outside(MOUNT, (), (aim(1.0, 2.0, 0.0, outcome="later"),)), "The camera was never aimed, though fixes came."),
        (Outside(MOUNT, (), (aim(9.0, 10.0, 0.0),)), "Of none of the shots it can be said whether the target was in"),
        (
            Outside(MOUNT, (still(),), (aim(9.0, 10.0, 0.0), aim(12.0, 13.0, 30.0, shot=2))),
            "The target was in the picture at 1 of the 2 instants that the camera was aimed for.",
        ),
        (everything(), "The target was in the picture at 1 of the 1 instants that the camera was aimed for, and in "),
        (
            Outside(MOUNT, (still(),), (aim(8.0, 9.0, 0.0, outcome="later"), aim(9.0, 10.0, 0.0))),
            "The target was in the picture at 1 of the 1 instants that the camera was aimed for. "
            "By 1 of the 2 fixes it was not aimed.",
        ),
    ],
)
def test_the_verdict_is_a_sentence(outside: Outside, said: str) -> None:
    assert camera.verdict(camera_metrics(outside, ONE, END_NS) or {}).startswith(said)


def test_a_lost_camera_is_in_the_verdict() -> None:
    states = (Known(ns(2), "lost"), Known(ns(5), "ready"))
    found = camera_metrics(Outside(MOUNT, states=states), ONE, END_NS) or {}
    assert camera.verdict(found).endswith(". Camera control lost the camera once, for 3 s in all.")


def test_pictures_and_video_of_the_folder_are_on_the_page(bad: Path) -> None:
    for drawn in ("video.mp4", "plots/camera.png"):
        (bad / drawn).unlink()
    page = report.write_report(bad).read_text()
    assert 'href="video.mp4"' not in page and "A frame of each shot" not in page
    buffer = io.BytesIO()
    Image.new("RGB", (4, 3), "green").save(buffer, "PNG")
    (bad / "plots" / "camera.png").write_bytes(buffer.getvalue())
    (bad / "video.mp4").write_bytes(b"a film")
    page = report.write_report(bad).read_text()
    assert 'href="video.mp4"' in page
    assert 'href="plots/camera.png"' in page and "A frame of each shot" in page


def test_a_picture_that_is_none_is_left_out(bad: Path) -> None:
    for drawn in ("video.mp4", "plots/camera.png"):
        (bad / drawn).unlink()
    (bad / "plots" / "camera.png").mkdir()
    (bad / "video.mp4").symlink_to("video.mp4")
    page = report.write_report(bad).read_text()
    assert "A frame of each shot" not in page and "video.mp4" not in page


# --- the figure -------------------------------------------------------------------------------------------------------


def test_the_curve_of_where_the_camera_looked_has_the_ends_of_each_turn(other: Path) -> None:
    """It begins to turn at 9 s, and is there after 45 degrees at 80 degrees a second."""
    found = told_by_hand(other, replace(everything(), turns=(still(), turn(9.0, 0.0, 45.0))))
    judge = camera.judge(found)
    assert judge is not None
    figure = pointing.figure(found, judge)
    (line,) = [one for one in figure.axes[0].lines if one.get_label() == "where the camera looked"]
    shown = {(round(float(t), 4), round(float(pan), 4)) for t, pan in zip(*line.get_data(), strict=True)}
    early = found.site.origin_ns / 1e9
    assert {(9.0 - early, 0.0), (9.5625 - early, 45.0)} <= shown


def test_nothing_told_is_drawn_as_nothing(other: Path) -> None:
    found = told_by_hand(other, Outside(MOUNT))
    figure = camera.drawn(found)
    assert figure is not None
    assert not [one for one in figure.axes[0].lines if one.get_label() == "where it was told to look"]
    assert camera.drawn(replace(found, outside=None)) is None
