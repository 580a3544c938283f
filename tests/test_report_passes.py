"""The part of a report about passes: its table, its maps, and sounds that are played on the page."""

from __future__ import annotations

import base64
import io
import wave
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from launcher import report
from launcher.heard import Event, Report
from launcher.plan.prepare import planned
from launcher.record.folder import keep
from launcher.record.heard.events import events_of_run
from launcher.record.heard.reports import told
from launcher.record.heard.sounds import BEFORE_NS, loudest_and_weakest, sounds
from launcher.record.heard.wav import FULL, LOUDEST, wav
from launcher.record.words import led
from launcher.records import MessageRow
from launcher.report import outages
from launcher.report.folder import read_run
from launcher.report.led import read_led
from launcher.report.parts import errors, latency, passed, passes, verdicts
from launcher.run import run_virtual
from tests.cpa_fields import SMALL, plan_of
from tests.reporting import read
from tests.simulated import simulated
from trackfield.role import NS
from trackfield.scenario import Scenario
from trackfield.wire.codec import encode
from trackfield.wire.passes import CpaReport

pytestmark = pytest.mark.rendered

NAMES = ("n000", "n001", "n002", "n003", "n004")


def folder_of(folder: Path, **changes: object) -> Path:
    """The folder of a run of the small field, with one pass."""
    settings = {key.replace("__", "."): value for key, value in changes.items()}
    scenario = Scenario.load(SMALL, {"target.steps": 32, "fusion.trackers": ["ml", "ecpa"], **settings})
    (folder / "logs").mkdir(parents=True)
    keep(scenario, folder)
    outcome = run_virtual(planned(scenario), folder, ["trackfield", "run", "small", "--virtual"])
    assert (outcome.unreported, outcome.exit_code) == ("", 0)
    return folder


@pytest.fixture(scope="module")
def modelled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sensors that know of passes without sound."""
    return folder_of(tmp_path_factory.mktemp("modelled"))


@pytest.fixture(scope="module")
def listening(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sensors that listen."""
    return folder_of(tmp_path_factory.mktemp("listening"), sensor__waveform=True)


def test_each_event_has_a_row_for_each_tracker(modelled: Path) -> None:
    run = read_run(modelled)
    (event,) = run.heard.events
    assert event.head == "n000"
    assert sorted(event.ranked) == list(NAMES)
    assert [one.strength_db for one in event.reports] != sorted(one.strength_db for one in event.reports)
    table = passes.events(run)
    assert [row[3] for row in table.rows] == ["ml", "ecpa"]
    for row in table.rows:
        assert len(row) == len(table.head)
        assert row[4].endswith(("86°", "87°", "88°"))
    assert table.rows[0][2] == ", ".join(event.ranked)


def test_reports_are_those_of_the_fix_at_the_times_of_the_true_passes(modelled: Path) -> None:
    run = read_run(modelled)
    plan = planned(run.scenario)
    (event,) = run.heard.events
    for one in event.reports:
        known_ns = min(plan.passes[one.sensor].values(), key=lambda at_ns: abs(at_ns - NS - one.at_ns))
        assert abs(known_ns - NS - one.at_ns) < NS // 10


@pytest.mark.parametrize("kind", ["centralised", "cpa", "tree"])
@pytest.mark.parametrize("loss", [0.0, 0.2])
def test_the_reports_of_an_event_are_those_that_its_head_had(kind: str, loss: float) -> None:
    """A centre is sent each of them; a head's own report is in its fix alone."""
    architecture = {"kind": "centralised", "multihop": True} if kind == "tree" else {"kind": kind}
    reach_m = 200.0 if kind == "centralised" else 30.0
    plan = plan_of(SMALL, architecture=architecture, link__range_m=reach_m, link__loss=loss)
    ledger, rows = simulated(plan)
    found = events_of_run(plan, rows, ledger.rows)
    assert [one.head for one in found] == 2 * ["n000" if kind == "cpa" else "fusion"]
    for event in found:
        assert len(event.reports) == len(set(event.ranked)) >= (5 if not loss else 3)
        for one in event.reports:
            known_ns = min(plan.passes[one.sensor].values(), key=lambda at_ns: abs(at_ns - NS - one.at_ns))
            assert abs(known_ns - NS - one.at_ns) < NS // 10


def test_reports_that_sensors_send_to_a_head_arrive(modelled: Path) -> None:
    run = read_run(modelled)
    assert run.frames.senders("delivered") == set(NAMES) - {"n000"}
    assert outages.few_reports(run) == ""
    to_fusion = latency.latencies(run)["sending to fusion"]
    assert len(to_fusion) == 4
    assert run.metrics["latency_ms"]["to_filter"]["max"] == pytest.approx(1e3 * to_fusion.max())


def test_reports_of_different_sensors_may_be_the_same_and_a_lost_frame_may_come_later() -> None:
    plan = plan_of(SMALL)
    payload = encode(CpaReport(7, 1.0, 0, -20.0, 1.0))
    sent = [("n001", 0, "radio"), ("n001", 1, "delivered"), ("n002", 2, "delivered"), ("n003", 3, "radio")]
    frames = [
        MessageRow("cpa-report", src, "n000", "field", at_ns, at_ns, outcome, len(payload), payload=payload)
        for src, at_ns, outcome in sent
    ]
    assert [one.sensor for one in told(plan, frames).sent["n000"]] == ["n001", "n002"]


def test_the_steps_with_a_track_are_of_those_at_which_one_is_expected(modelled: Path) -> None:
    """A fix is predicted on beyond the steps of its pass."""
    run = read_run(modelled)
    m = run.metrics["trackers"]["ml"]
    assert m["steps"] > m["steps_tracked"] > 0
    share = f"{m['steps_tracked']} of {m['steps_expected']}"
    table = errors.trackers(run)
    assert table.rows[0][list(table.head).index("steps")] == share
    text = verdicts.verdicts(run)[0].text
    assert f"over {m['steps']} steps" in text
    assert f"A track at {m['steps_tracked']} of the {m['steps_expected']} steps at which one was expected." in text


def test_heads_hand_nothing_over(modelled: Path) -> None:
    leaders = read_run(modelled).metrics["leaders"]
    assert (leaders["handovers"], leaders["lost_handovers"]) == (None, None)
    assert led(read_run(modelled).metrics)[0] == "leaders: 0 take-overs (0 false), two at once in 0 steps"


def test_what_nobody_knows_is_left_out(modelled: Path) -> None:
    run = read_run(modelled)
    known = passes.lines(run)
    assert next(value for name, value, _ in known if "errors" in name).endswith("°")
    unknown = {key: {"mean": None, "max": None} for key in ("location_m", "speed_m_s", "heading_deg", "delay_s")}
    figures = {name: {**one, **unknown} for name, one in run.metrics["passes"]["trackers"].items()}
    metrics = {**run.metrics, "passes": {"events": 0, "enough": 0, "trackers": figures}}
    blind = replace(run, field=replace(run.field, site=replace(run.site, paths={})), metrics=metrics)
    rest = [line for line in passes.lines(blind) if "heads" not in line[0] and "base" not in line[0]]
    assert [name for name, _, _ in rest] == ["ml: fixes", "ecpa: fixes"]
    assert passes.events(blind).head[-1] == "fix"


def test_a_sensor_that_reported_twice_stands_once() -> None:
    reports = [Report("a", 0, 1.0, 0.5), Report("b", 1, 2.0, 0.5), Report("a", 2, 3.0, 0.5)]
    assert Event("a", tuple(reports), ()).ranked == ["a", "b"]


def test_why_there_is_no_fix_stands_in_lines_over_a_map(modelled: Path) -> None:
    run = read_run(modelled)
    (event,) = run.heard.events
    why = "the reports are not those of one pass on a straight line"
    refused = event._replace(outcomes=tuple(one._replace(refused=why, line=None) for one in event.outcomes))
    axes = Figure().subplots()
    passed.draw(axes, run, refused)
    first, *rest = axes.get_title(loc="left").splitlines()
    assert first.endswith("n000:")
    assert " ".join(rest) == why
    assert max(map(len, rest)) <= passed.LETTERS


def test_an_event_without_a_fix_says_why(tmp_path: Path) -> None:
    """A head waits for more reports of an event as long as they may come."""
    dead = [{"kind": "kill", "nodes": ["n001", "n002"], "at_s": 5}]
    run = read_run(folder_of(tmp_path / "run", faults=dead, target__steps=44))
    (event,) = run.heard.events
    assert {one.refused for one in event.outcomes} == {"too few reports"}
    assert [row[4:] for row in passes.events(run).rows] == 2 * [["no fix: too few reports", *4 * ["–"]]]
    assert run.metrics["passes"]["trackers"]["ml"]["refused"] == {"too few reports": 1}


def test_the_lone_sensor_is_across_the_line_from_the_far_ones(modelled: Path) -> None:
    run = read_run(modelled)
    (event,) = run.heard.events
    assert event.tried is not None
    x, y, vx, vy = run.site.paths["target"].at(event.outcomes[0].event_ns / NS) or (0.0, 0.0, 0.0, 0.0)

    def side(id: str) -> bool:
        return bool((run.sensors[id][0] - x) * vy - (run.sensors[id][1] - y) * vx > 0.0)

    assert {side(id) for id in event.tried.far} == {not side(event.tried.lone)}
    ecpa = next(one.line for one in event.outcomes if one.tracker == "ecpa")
    assert ecpa is not None
    assert min(np.hypot(line[2] - ecpa[2], line[3] - ecpa[3]) for line in event.tried.lines) < 1.0


def test_the_head_of_a_cluster_has_one_reign(modelled: Path) -> None:
    led = read_led(read_run(modelled))
    assert [(turn.leader, turn.how) for turn in led.turns] == [("n000", "start")]


def test_the_section_is_there_only_where_sensors_report_passes(modelled: Path, tmp_path: Path) -> None:
    report.write_report(modelled)
    page = read(modelled)
    assert ("section", {"id": "passes"}) in page.tags
    assert ("section", {"id": "clusters"}) not in page.tags
    assert not [tag for tag, _ in page.tags if tag == "audio"]
    assert "passes of a cluster, by the true paths" in page.text


# --- sound ------------------------------------------------------------------------------------------------------------


def test_what_the_loudest_and_the_weakest_sensor_heard_is_played_from_the_page_alone(listening: Path) -> None:
    report.write_report(listening)
    sources = [dict(attributes)["src"] or "" for tag, attributes in read(listening).tags if tag == "audio"]
    assert len(sources) == 2
    for source in sources:
        kind, _, data = source.partition(",")
        assert kind == "data:audio/wav;base64"
        with wave.open(io.BytesIO(base64.b64decode(data))) as file:
            assert (file.getnchannels(), file.getsampwidth(), file.getframerate()) == (1, 2, 4000)
            assert 6.0 <= file.getnframes() / 4000 <= 7.0
    assert (listening / "plots" / "heard.png").is_file()


def test_sound_made_again_has_the_passes_that_were_reported(listening: Path) -> None:
    run = read_run(listening)
    plan = planned(run.scenario)
    (event,) = run.heard.events
    at_ns = {one.sensor: one.at_ns for one in event.reports}
    found = {one.sensor: one for one in sounds(plan, event, list(at_ns))}
    assert found.keys() == set(NAMES)
    for id, sound in found.items():
        assert sound.peak_ns is not None
        assert sound.known_ns is not None
        assert abs(sound.peak_ns - at_ns[id]) < NS // 20  # clocks of nodes are off by some ms
        assert NS <= sound.known_ns - sound.peak_ns <= 1.2 * NS
        assert abs(sound.first_ns - (at_ns[id] - BEFORE_NS)) < NS // 1000
        loudest = sound.levels[np.nanargmax(sound.levels[:, 2]), 0] * NS + sound.first_ns
        assert abs(loudest - sound.peak_ns) < NS // 50


def test_the_loudest_comes_first(listening: Path) -> None:
    run = read_run(listening)
    (event,) = run.heard.events
    first, last = loudest_and_weakest(event)
    strengths = {one.sensor: one.strength_db for one in event.reports}
    assert (strengths[first], strengths[last]) == (max(strengths.values()), min(strengths.values()))
    assert [one.sensor for one in run.heard.sounds] == [first, last]


def test_a_wav_is_as_loud_as_can_be_and_silence_is_silent() -> None:
    for samples, most in ((np.array([0.0, -0.002, 0.001]), round(LOUDEST * FULL)), (np.zeros(5), 0)):
        with wave.open(io.BytesIO(wav(samples, 4000))) as file:
            written = np.frombuffer(file.readframes(file.getnframes()), "<i2")
        assert len(written) == len(samples)
        assert np.abs(written).max() == most
