"""Fields that play what real sensors reported: the rest of the field neither knows nor cares."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import trackfield as tf
from launcher.plan.forecast.played import played_in_part
from launcher.plan.prepare import load, planned
from launcher.record.metrics import run_metrics
from launcher.study.compare import differences
from tests.played import OPTIONS, PLACES, SENSORS, STEP_S, STEPS, errors, home, ran, recorded, scenario, way
from tests.running import Run, both_ways
from trackfield.errors import ScenarioError
from trackfield.role import NS
from trackfield.scenario import survey

__all__ = ["home"]


# --- any kind -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", OPTIONS)
def test_any_kind_is_played_and_tracked(home: Path, kind: str) -> None:
    Path("reports.csv").write_text(recorded(kind, OPTIONS[kind]))
    plan, ledger, rows = ran(scenario(kind, OPTIONS[kind]))
    assert ledger.sent_kinds == {"measurement": STEPS * len(PLACES)}
    metrics = run_metrics(plan, ledger, rows)["trackers"]
    assert metrics["imm-ukf"]["steps_expected"] == STEPS - 1  # the target's last fix is before the last step
    assert metrics["imm-ukf"]["verdict"] == "tracked"
    late = errors(rows, "imm-ukf")[STEPS // 2 :]
    assert sum(late) / len(late) < 2.0


def test_numbers_arrive_as_they_were_reported(home: Path) -> None:
    Path("reports.csv").write_text(recorded("range", {}))
    plan, ledger, _ = ran(scenario())
    (first, *_), kind = (row for row in ledger.rows if row.src == "c"), plan.info
    written = next(line.split(",") for line in Path("reports.csv").read_text().splitlines() if ",c," in line)
    assert first.values == pytest.approx([float(written[2])], abs=0.005)
    assert first.sent_ns == round((float(written[0]) + STEP_S / 2) * NS)
    assert kind.step_ns == STEP_S * NS


def test_both_drivers_play_the_same_over_radio_with_clocks_and_faults(home: Path, tmp_path: Path) -> None:
    """Clocks are off and jump, the radio loses frames, a sensor is biased, one dies and comes back."""
    Path("reports.csv").write_text(recorded("range", {}))
    faults = (
        "faults=[{kind='bias', nodes=['a'], by=[4.0], at_s=3, until_s=9}, {kind='restart', nodes=['b'], at_s=4,"
        " until_s=8}, {kind='clock_jump', nodes=['c'], jump_ms=400.0, at_s=6}, {kind='stuck', nodes=['d'], at_s=10}]"
    )
    changes = (
        faults,
        "clock.offset_ms=50",
        "clock.drift_ppm=100",
        "clock.sync=true",
        "link.model=gilbert_elliott",
    )
    Path("played.toml").write_text(scenario().to_toml())
    settings = [part for change in changes for part in ("--set", change)]
    both = both_ways(tmp_path, "played.toml", *settings)
    assert not differences(both / "virtual", both / "processes", 0.0)


def test_a_study_may_vary_what_is_played(home: Path) -> None:
    """Of the same times an emulated target is read: another draw for each seed, where what was reported stays."""
    Path("reports.csv").write_text(recorded("range", {}))

    def values(**more: Any) -> list[float]:
        _, ledger, _ = ran(scenario(**more))
        return [row.values[0] for row in sorted(ledger.rows, key=lambda row: (row.sent_ns, row.src))]

    assert values(seed=1) == values(seed=2)
    emulated = [values(seed=seed, sensor__play="times") for seed in (1, 2)]
    assert emulated[0] != emulated[1]
    assert len(emulated[0]) == len(values()) - 3  # the target is there until its last fix
    assert max(abs(a - b) for a, b in zip(emulated[0], values(), strict=False)) < 8.0


# --- what is beside the recording ---------------------------------------------------------------------------------


def test_without_truth_there_are_tracks_and_no_errors(home: Path, tmp_path: Path) -> None:
    Path("reports.csv").write_text(recorded("range", {}, truth=False))
    Path("played.toml").write_text(scenario().to_toml())
    run = Run(tmp_path / "run", "played.toml", "--virtual", reported=True)
    code, said = run.finish()
    assert code == 0, said
    found = run.metrics()["trackers"]["imm-ukf"]
    assert (found["verdict"], found["rmse"]["position"], found["nees"]) == (None, None, None)
    assert found["steps_tracked"] > 0.9 * found["steps_expected"] > 0.8 * STEPS
    assert "no truth to judge by" in said.replace("\n", " ")
    page = (tmp_path / "run" / "report.html").read_text()
    assert "The recording does not say where the target was, so there is no error to show." in page
    assert "true path" not in page
    assert f"A track at {found['steps_tracked']} of {found['steps_expected']} steps." in page
    assert f">{found['steps_tracked']} of {found['steps_expected']}<" in page


def test_the_truth_may_come_from_a_track_of_its_own(home: Path) -> None:
    """Both have dates: the run begins with the track, and the reports stand where they belong."""
    Path("reports.csv").write_text(
        "time,sensor,v\n" + "".join(f"2024-05-01T12:00:{10 + k:02}Z,{id},{10 + k}\n" for k in range(20) for id in "abc")
    )
    Path("track.csv").write_text(
        "time,lat,lon\n" + "".join(f"2024-05-01T12:00:{8 + k:02}Z,{48 + k / 50000},11\n" for k in range(20))
    )
    Path("sensors.csv").write_text("id,lat,lon\na,48,11\nb,48.0002,11\nc,48,11.0003\n")
    track = {"path": "file", "file": "track.csv", "step_s": 1.0}
    site = survey(scenario(target=track))
    assert site.passes["a"][2] == 2 * NS  # reported 2 s after the track begins
    assert site.paths["target"].start_s == 0.0


def test_others_may_sense_the_recorded_target(home: Path) -> None:
    """Sensors that play nothing sense the target where the recording says that it was."""
    Path("reports.csv").write_text(recorded("range", {}))
    Path("sensors.csv").write_text(SENSORS + "e,20,15\n")
    more = {"sensors": [{"kind": "range", "nodes": ["e"]}]}
    _, ledger, _ = ran(scenario(**more))
    assert sum(row.src == "e" for row in ledger.rows) >= STEPS - 2
    assert ledger.sent_kinds["measurement"] == STEPS * len(PLACES)


def test_a_field_of_other_sensors_may_sense_the_recorded_target(home: Path) -> None:
    """Of a recording that nobody plays: to plan where sensors should stand."""
    Path("reports.csv").write_text(recorded("range", {}))
    target = {"path": "recording", "recording": "reports.csv", "step_s": STEP_S}
    plans = {"sensor": {"kind": "range"}, "target": target, "field": {"layout": "grid", "nodes": 9, "spacing_m": 15.0}}
    plan, _, rows = ran(scenario(**plans))
    assert len(plan.info.places) == 10
    assert plan.paths["target"].at(STEP_S / 2 + 3.0)[:2] == pytest.approx(way(3.0))  # type: ignore[index]
    assert min(errors(rows, "imm-ukf")) < 1.0


def test_reports_that_will_not_be_sent_are_told(home: Path) -> None:
    text = recorded("range", {}).splitlines(keepends=True)
    again = [text[0], *text[1:5], "0.09,a,20,5,8\n", *(row for row in text[5:] if ",d," not in row)]
    Path("reports.csv").write_text("".join(again))
    told = list(played_in_part(planned(scenario(target__steps=10))))
    assert told[0].startswith("61 of 92 recorded reports are left out: a sensor reports once in a step of 0.5 s")
    assert len(told) == 1
    Path("reports.csv").write_text("".join(row for row in text if ",d," not in row))
    assert list(played_in_part(planned(scenario()))) == ["no report was recorded of d"]


# --- what a user can get wrong ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "more", "error"),
    [
        (
            "t_s,sensor,v\n0,z,1\n1,y,1\n",
            {},
            "reports.csv: has reports of 'z' and 1 more, which the field does not have",
        ),
        ("t_s,sensor,v,w\n0,a,1,2\n", {}, "has 2 columns of numbers (v, w), and a report of kind 'range' has 1"),
        ("t_s,sensor,v\n0,a,1\n", {"sensor__play": "times"}, "target: the recording does not say where the target was"),
        ("t_s,sensor,v\n0,a,1\n", {"fusion__prior": "paper"}, "fusion.prior: is 'paper', around where the target is"),
        (
            "t_s,sensor,v\n0,a,1\n",
            {"field": {"layout": "along-path"}},
            "field.layout: is 'along-path', and the recording",
        ),
        ("t_s,sensor,v\n0,a,1\n", {"field": {"layout": "beside"}}, "field.layout: is 'beside', and the recording"),
        ("t_s,sensor,v\n0,a,1\n", {"sensor__recording": "none.csv"}, "none.csv: cannot be read (No such file"),
        ("t_s,sensor,v\n0,a,1\n", {"sensor__play": "all"}, 'sensor.play: is "all"; expected one of readings, times'),
        ("t_s,sensor,v\n0,a,1\n", {"sensor": {"kind": "range"}}, "target.path: no sensors play a recording"),
    ],
)
def test_what_does_not_fit_is_one_error(home: Path, text: str, more: dict[str, Any], error: str) -> None:
    Path("reports.csv").write_text(text)
    with pytest.raises(ScenarioError) as raised:
        planned(scenario(**more))
    assert error in str(raised.value)
    assert len(raised.value.parts) == 1


def test_a_scenario_with_a_recording_needs_no_target(home: Path) -> None:
    Path("reports.csv").write_text(recorded("range", {}))
    text = scenario().plain()
    del text["target"]
    site = survey(tf.Scenario.load(text, {"fusion.deadline_s": 0.2}))
    assert (site.step_ns, list(site.paths)) == (NS, ["target"])
    assert load("hall").keyed_targets[0][0] == "target"
