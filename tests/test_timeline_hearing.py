"""Fields that hear on the timeline: interests, data and heads as the run goes on; events and sound once it is over."""

from __future__ import annotations

from collections.abc import Callable
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from launcher.heard import Event, Outcome, Report, Sound, Tried
from launcher.plan.prepare import planned
from launcher.record.folder import keep
from launcher.records import BATTERY, EAR, SENSES, TRACKS, FieldInfo, MessageRow, Place, Truth
from launcher.run import run_virtual
from launcher.timeline.layers.passes import HELD_NS, LOG, LONE
from launcher.timeline.timeline import Timeline
from tests.cpa_fields import SMALL
from tests.rrd import entities, read, verify, views
from trackfield.role import NS
from trackfield.scenario import Scenario
from trackfield.wire.codec import encode, kind_name
from trackfield.wire.interests import Data, Interest

PLACES = {"base": (30.0, -25.0), "a": (0.0, 20.0), "b": (-20.0, 0.0), "c": (0.0, -20.0), "d": (20.0, 0.0)}
IDS = tuple(PLACES)[1:]
STANDING = tuple(float(i % 5 == 0) for i in range(16))


def field(*, listens: bool = False) -> FieldInfo:
    """A base, and nodes a to d that hear targets pass."""
    tags = frozenset({SENSES, TRACKS, BATTERY})
    places = [Place(id, EAR, *PLACES[id], tags) for id in IDS]
    base = Place("base", "sink", *PLACES["base"], frozenset({TRACKS}))
    way = Truth("target", ((0.0, -60.0, 5.0), (12.0, 60.0, 5.0)))
    return FieldInfo("small", "small", (base, *places), (way,), ("ml", "ecpa"), 12.0, hears=True, listens=listens)


def drawn(folder: Path, tell: Callable[[Timeline], object], info: FieldInfo | None = None) -> Path:
    timeline = Timeline(folder / "run.rrd", info or field())
    tell(timeline)
    timeline.close()
    return folder / "run.rrd"


def frame(second: float, src: str, dst: str, message: Any, outcome: str = "delivered") -> MessageRow:
    sent_ns = round(second * NS)
    return MessageRow(kind_name(message), src, dst, "field", sent_ns, sent_ns, outcome, 3, payload=encode(message))


def interest(refresh: int, task: int = 1, sink: str = "a", lasts_s: float = 3.0) -> Interest:
    return Interest(sink.encode(), 0, refresh, task, 0.0, 0.0, 50.0, 0.0, lasts_s, 0, 4)


def lines(file: Path, part: str) -> dict[float, set[tuple[tuple[float, ...], ...]]]:
    """The lines of each picture of an entity of the field, by time."""
    found = {t: value for t, value in read(file, f"/field/{part}", "LineStrips2D:strips") if t}
    return {t: {tuple(map(tuple, strip)) for strip in strips} for t, strips in found.items()}


def line(*ids: str) -> tuple[tuple[float, float], ...]:
    return tuple(PLACES[id] for id in ids)


# --- as the run goes on -----------------------------------------------------------------------------------------------


def test_a_gradient_leads_to_whom_an_interest_was_heard_from_first_until_it_is_over(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        for second, src, dst in ((1.0, "a", "b"), (1.1, "b", "c"), (1.15, "d", "c"), (1.2, "b", "a")):
            timeline.message(frame(second, src, dst, interest(1)))
        timeline.message(frame(2.0, "d", "c", interest(2)))
        timeline.state(8 * NS, "a", "watching", "ear")

    found = lines(drawn(tmp_path, tell), "wanted-passes")
    assert found[1.1] == {line("b", "a"), line("c", "b")}
    assert found[2.0] == {line("b", "a"), line("c", "d")}
    assert found[4.0] == {line("c", "d")}
    assert found[max(found)] == set()


def test_interests_in_fixes_are_drawn_apart_and_those_that_are_lost_not_at_all(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        timeline.message(frame(1.0, "base", "d", interest(1, 2, "base")))
        timeline.message(frame(1.0, "base", "c", interest(1, 2, "base"), "radio"))

    file = drawn(tmp_path, tell)
    assert lines(file, "wanted-fixes")[1.0] == {line("d", "base")}
    assert lines(file, "wanted-passes").get(1.0, set()) == set()


def test_data_is_drawn_on_its_way_for_a_second(tmp_path: Path) -> None:
    file = drawn(tmp_path, lambda timeline: timeline.message(frame(2.0, "b", "a", Data(b"a", 0, b"b", 1, 0, 0, b"x"))))
    found = lines(file, "carried")
    (arrow,) = found[2.0]
    assert (arrow[0], arrow[1]) == line("b", "a")
    assert found[3.0] == set()


def test_malformed_interests_draw_nothing(tmp_path: Path) -> None:
    row = MessageRow("interest", "a", "b", "field", NS, NS, "delivered", 3, payload=b"\xc1")
    file = drawn(tmp_path, lambda timeline: timeline.message(row))
    assert not any(lines(file, "wanted-passes").values())


def test_who_leads_has_its_name_until_it_dies(tmp_path: Path) -> None:
    def tell(timeline: Timeline) -> None:
        timeline.state(1 * NS, "a", "leading", "hearing")
        timeline.state(1 * NS, "a", "watching", "ear")
        timeline.death(3 * NS, "a", "killed")

    file = drawn(tmp_path, tell)
    labels = {t: value for t, value in read(file, "/field/leading", "Points2D:labels") if t}
    assert (labels[1.0], labels[3.0] or []) == (["a"], [])


# --- events -----------------------------------------------------------------------------------------------------------


def event(**changes: Any) -> Event:
    """A target that moves east past a to d, 5 m north of the middle."""
    reports = tuple(
        Report(id, round(t * NS), db, 0.5) for id, t, db in zip(IDS, (6, 4, 6.1, 8), (1, 2, 3, 4), strict=True)
    )
    outcomes = (
        Outcome("ml", round(9.5 * NS), 10 * NS, 6 * NS, "", (35.0, 5.0, 10.0, 0.0), STANDING),
        Outcome("ecpa", round(9.5 * NS), 10 * NS, 6 * NS, "too few reports", None),
    )
    tried = Tried("a", ("b", "c", "d"), ((0.0, 5.0, 10.0, 0.0), (0.0, 5.0, 0.0, 10.0)))
    return Event("a", reports, outcomes, tried)._replace(**changes)


def told(folder: Path, *events: Event) -> Path:
    return drawn(folder, lambda timeline: timeline.events(events))


def test_sensors_are_marked_from_when_they_heard_the_target_and_the_lone_one_at_the_fix(tmp_path: Path) -> None:
    file = told(tmp_path, event())
    labels = {t: value for t, value in read(file, "/field/event/sensors", "Points2D:labels") if t}
    assert labels[4.0] == ["b"]
    assert sorted(labels[6.1]) == ["a", "b", "c"]
    assert sorted(labels[10.0]) == ["a = n0", "b", "c", "d"]
    assert (labels[10.0 + HELD_NS / NS] or []) == []
    colours = {t: value for t, value in read(file, "/field/event/sensors", "Points2D:colors") if t}
    assert [colour == LONE for colour in colours[10.0]] == [name == "a = n0" for name in labels[10.0]]


def test_lines_go_through_the_sensors_and_the_ellipse_is_where_the_fix_was_published(tmp_path: Path) -> None:
    file = told(tmp_path, event())
    ((start, end),) = lines(file, "event/ml/line")[10.0]
    assert start[1] == end[1] == pytest.approx(5.0)
    assert start[0] < -20.0 < 20.0 < end[0]
    assert len(lines(file, "event/candidates")[10.0]) == 2
    (ring,) = lines(file, "event/ml/fix")[10.0]
    assert np.mean(ring[:-1], axis=0) == pytest.approx((35.0, 5.0), abs=1e-4)
    assert "/field/event/ecpa/line" not in entities(file) or not any(lines(file, "event/ecpa/line").values())
    for part in ("event/ml/line", "event/ml/fix", "event/candidates"):
        assert lines(file, part)[10.0 + HELD_NS / NS] == set()


def test_two_events_at_a_time_are_drawn_together(tmp_path: Path) -> None:
    later = event(
        head="d",
        outcomes=(Outcome("ml", round(11.5 * NS), 12 * NS, 8 * NS, "", (35.0, -5.0, 10.0, 0.0), STANDING),),
        tried=None,
    )
    found = lines(told(tmp_path, event(), later), "event/ml/fix")
    assert [len(found[t]) for t in (10.0, 12.0, 14.0, 16.0)] == [1, 2, 1, 0]


def test_what_happens_is_told_in_words(tmp_path: Path) -> None:
    words = [(t, text[0]) for t, text in read(told(tmp_path, event()), LOG, "TextLog:text")]
    assert words[0] == (4.0, "b hears a target loudest: 2.0 dB, 0.5 s wide")
    assert (10.0, "a, ml: a fix, 10.0 m/s towards 90°, of 4 reports") in words
    assert (10.0, "a, ecpa: no fix: too few reports, of 4 reports") in words


def test_an_event_of_which_no_report_is_known_has_its_fix(tmp_path: Path) -> None:
    assert len(lines(told(tmp_path, event(reports=(), tried=None)), "event/ml/line")[10.0]) == 1


# --- sound ------------------------------------------------------------------------------------------------------------


def sound() -> Sound:
    t_s = np.arange(0.0, 2.0, 0.02)
    levels = np.stack((t_s, -30.0 + 0.0 * t_s, -10.0 - np.abs(t_s - 1.0)), axis=1)
    samples = np.sin(np.arange(8000.0))
    return Sound("a", 4 * NS, 4000, samples, levels, 5 * NS, round(6.1 * NS))


def test_levels_waveform_marks_and_sound_stand_where_they_were_heard(tmp_path: Path) -> None:
    file = drawn(tmp_path, lambda timeline: timeline.sounds("loudest", [(sound(), b"RIFF")]), field(listens=True))
    levels = read(file, "/plots/level/loudest", "Scalars:scalars")
    levels = [(t, value) for t, value in levels if t is not None]
    assert levels[0] == (4.0, [-30.0, -11.0])
    assert isnan(levels[-1][1][0])
    wave = [(t, value[0]) for t, value in read(file, "/plots/waveform/loudest", "Scalars:scalars") if t is not None]
    assert (wave[0][0], len(wave)) == (4.0, 401)
    assert min(value for _, value in wave[:-1]) < -0.9 < 0.9 < max(value for _, value in wave[:-1])
    marks = [
        read(file, f"/plots/level/{name}", "Scalars:scalars")
        for name in ("closest\\ point\\ of\\ approach", "triggered")
    ]
    assert [[one for one in each if one[0]] for each in marks] == [[(5.0, [-10.0])], [(6.1, [pytest.approx(-10.98)])]]
    blobs = [(t, bytes(value[0])) for t, value in read(file, "/sound/loudest", "AssetAudio:blob")]
    assert blobs == [(4.0, b"RIFF")]


def test_of_sounds_that_overlap_each_is_drawn_for_half_of_that_time(tmp_path: Path) -> None:
    later = sound()._replace(first_ns=5 * NS, peak_ns=6 * NS, levels=sound().levels + np.array([0.0, 20.0, 20.0]))
    both = [(later, b"2"), (sound(), b"1")]
    file = drawn(tmp_path, lambda timeline: timeline.sounds("loudest", both), field(listens=True))
    levels = [(t, value[0]) for t, value in read(file, "/plots/level/loudest", "Scalars:scalars") if t]
    shown = [(t, value) for t, value in levels if not isnan(value)]
    assert {value for t, value in shown if t < 5.5} == {-30.0}
    assert {value for t, value in shown if t >= 5.5} == {-10.0}
    assert [shown[0][0], shown[-1][0]] == pytest.approx([4.0, 6.98])
    assert [t for t, _ in read(file, "/sound/loudest", "AssetAudio:blob")] == [4.0, 5.0]


def test_views_of_sound_are_there_only_where_sensors_listen(tmp_path: Path) -> None:
    for name, info in (("deaf", field()), ("listening", field(listens=True))):
        (tmp_path / name).mkdir()
        found = views(drawn(tmp_path / name, lambda timeline: None, info))
        assert "Passes" in found
        assert {"Sound, loudest", "Sound, weakest", "Waveform"} <= found.keys() or name == "deaf"
        assert ("Waveform" in found) == (name == "listening")


def test_a_whole_run_has_all_of_it(tmp_path: Path) -> None:
    settings = {"target.steps": 32, "fusion.trackers": ["ml", "ecpa"], "sensor.waveform": True}
    scenario = Scenario.load(SMALL, settings)
    (tmp_path / "logs").mkdir()
    keep(scenario, tmp_path)
    run_virtual(planned(scenario), tmp_path, write=lambda folder: None)
    file = tmp_path / "run.rrd"
    assert verify(file).returncode == 0
    found = entities(file)
    fields = {f"/field/{part}" for part in ("wanted-passes", "wanted-fixes", "carried", "leading", "event/ml/fix")}
    assert fields | {"/field/event/candidates", "/sound/loudest", "/sound/weakest", LOG} <= found
    labels = {t: value or [] for t, value in read(file, "/field/event/sensors", "Points2D:labels") if t}
    assert max(map(len, labels.values())) == 5
    wavs = [bytes(value[0]) for _, value in read(file, "/sound/loudest", "AssetAudio:blob")]
    assert len(wavs) == 1
    assert wavs[0][:4] == b"RIFF"
