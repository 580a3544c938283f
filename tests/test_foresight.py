"""What ``validate`` expects of the reports of a run, and what then becomes of them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import pytest

from launcher.plan.prepare import load, planned
from launcher.record.ledger import Ledger
from tests.command_line import Call, trackfield
from tests.simulated import simulated

__all__ = ["trackfield"]

DRIVES = ("fusion.path=[[0,-200,0],[60,200,0]]", "target.waypoints=[[0,-200,0],[60,200,0]]")
REPORTS = re.compile(r"reports: (?:about|up to) (\d+) from .*; ([\d.]+)% arrive, ([\d.]+)% of those in time")


@dataclass(frozen=True)
class Reports:
    """How many are sent, arrive, and arrive in time, and in which share of the steps enough do for a fix."""

    sent: float
    arrived: float
    in_time: float
    fixes: float


def validated(trackfield: Call, *settings: str) -> tuple[Reports, str]:
    """What ``validate`` expects, and all that it says."""
    said = trackfield("validate", "zhai-spcpf", *(part for setting in settings for part in ("--set", setting)))
    assert said.code == 0, said.err
    reports, fixes = REPORTS.search(said.err), re.search(r"in time in (?:up to )?(\d+)%", said.err)
    assert reports
    assert fixes
    sent, arrived, in_time = (float(figure) for figure in reports.groups())
    return Reports(sent, sent * arrived / 100, sent * arrived * in_time / 1e4, int(fixes[1]) / 100), said.err


def happened(*settings: str, use_s: float = 0.3) -> Reports:
    """What becomes of the reports in a run, if they can be used up to this age."""
    ledger, _ = simulated(planned(load("zhai-spcpf", settings=settings, trackers=["ekf"])))
    assert isinstance(ledger, Ledger)
    rows = [row for row in ledger.rows if row.kind == "doa" and row.step is not None]
    arrived = [(row.step, row.due_ns / 1e9 - row.step) for row in rows if row.delivered and row.due_ns and row.step]
    in_time = [step for step, age_s in arrived if age_s <= use_s]
    fixes = sum(in_time.count(step) >= 2 for step in set(in_time)) / 60
    return Reports(len(rows), len(arrived), len(in_time), fixes)


def test_a_centre_that_drives_beside_the_target_gets_all_reports(trackfield: Call) -> None:
    """Over the whole run each of these links carries less than half, but all of it while its sensor reports."""
    settings = (*DRIVES, "link.model=ideal", "link.range_m=80")
    expected, text = validated(trackfield, *settings)
    assert "reports may be expected to arrive" not in text
    assert "11 sensor nodes that will report: mean 100.0%, worst 100.0% (" in text
    found = happened(*settings)
    assert expected.sent == expected.arrived == expected.in_time == found.in_time == 110
    assert expected.fixes == pytest.approx(found.fixes, abs=0.005)


def test_a_centre_that_drives_away_from_the_target_gets_few(trackfield: Call) -> None:
    settings = ("fusion.path=[[0,0,0],[60,100,400]]", "link.model=ideal", "link.range_m=120")
    expected, text = validated(trackfield, *settings)
    found = happened(*settings)
    assert expected.arrived == pytest.approx(found.arrived, abs=0.5)
    assert 0 < found.arrived < 0.5 * found.sent
    assert f"; {found.arrived} of {found.sent} reports may be expected to arrive, " in text
    assert expected.fixes == pytest.approx(found.fixes, abs=0.005)


@pytest.mark.parametrize(("until_s", "arrive"), [(2, 4), (31, 121)])
def test_a_trace_is_expected_to_lose_what_it_loses(trackfield: Call, tmp_path: Path, until_s: int, arrive: int) -> None:
    """Half of its lines say received, for a small or a large part of the run."""
    lines = [f"n{i:03},fusion,{t_s},{int(t_s == 0)},2" for i in range(121) for t_s in (0, until_s)]
    (tmp_path / "radio.csv").write_text("\n".join(["src,dst,t_s,received,delay_ms", *lines]))
    settings = ("link.model=trace", f"link.file={tmp_path / 'radio.csv'}")
    expected, text = validated(trackfield, *settings)
    found = happened(*settings)
    assert found.arrived == arrive
    shares = {share for *_, share in planned(load("zhai-spcpf", settings=settings)).info.receptions}
    assert list(shares) == pytest.approx([until_s / 61], abs=0.02)
    assert f"; {arrive} of 241 reports may be expected to arrive, " in text
    assert expected.fixes == pytest.approx(found.fixes, abs=0.005)


@pytest.mark.parametrize(("age_s", "late"), [(3, "90%"), (5, "80%")])
def test_reports_wait_for_the_radio_of_their_own_node(trackfield: Call, age_s: int, late: str) -> None:
    """A report takes the radio for 2.64 s, and the next one comes after 1 s. The last one arrives after the run."""
    settings = ("link.radio=lora868", "link.sf=12", f"fusion.max_age_s={age_s}")
    expected, text = validated(trackfield, *settings)
    found = happened(*settings, use_s=age_s)
    assert expected.in_time == pytest.approx(found.in_time + 1, abs=0.5)
    assert expected.fixes == pytest.approx(found.fixes, abs=0.005)
    assert f"{late} of the reports that arrive are too late (delay 9.19 s, " in text


def test_the_waits_of_a_run_of_which_some_steps_are_looked_at(
    trackfield: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = ("link.radio=lora868", "link.sf=12", "fusion.max_age_s=5")
    exact, _ = validated(trackfield, *settings)
    monkeypatch.setattr("launcher.plan.forecast.heard.MOST_REPORTS", 121)
    about, text = validated(trackfield, *settings)
    assert "in about 60 of 60 steps" in text
    assert about.in_time == pytest.approx(exact.in_time, rel=0.3)


def test_reports_that_find_the_queue_full_do_not_arrive(trackfield: Call) -> None:
    settings = ("link.radio=lora868", "link.sf=12", "link.queue=2", "fusion.max_age_s=60")
    expected, _ = validated(trackfield, *settings)
    ledger, _ = simulated(planned(load("zhai-spcpf", settings=settings, trackers=["ekf"])))
    assert isinstance(ledger, Ledger)
    dropped = sum(row.outcome == "overflow" for row in ledger.rows)
    assert dropped > 50
    assert expected.sent - expected.arrived == pytest.approx(dropped, abs=0.5)


def test_of_an_adaptive_threshold_the_lowest_is_looked_at_and_that_is_said(trackfield: Call) -> None:
    """The centre raises it at once, so that a run has a small part of these reports."""
    expected, text = validated(trackfield, "sensor.threshold=adaptive")
    found = happened("sensor.threshold=adaptive")
    assert found.sent < 0.1 * expected.sent
    assert found.fixes < 0.2 < expected.fixes
    coverage, reports = text.splitlines()[1:3]
    assert " within 126 m of the target, the reach at the lowest threshold, in 60 of 60 steps (" in coverage
    assert coverage.endswith(" enough reports for a fix (2) in time in up to 100%")
    assert reports.startswith("reports: up to 1176 from 64 sensor nodes, at the lowest threshold; ")
    assert text.splitlines()[-1] == "valid"


def test_an_adaptive_threshold_is_not_warned_of_a_channel_that_is_full_at_the_lowest_one(trackfield: Call) -> None:
    radio = ("link.radio=lora868", "link.sf=7")
    _, fixed = validated(trackfield, *radio)
    assert "warning: the reports of a step take " in fixed
    _, adaptive = validated(trackfield, *radio, "sensor.threshold=adaptive")
    assert "warning: the reports of a step take " not in adaptive
    assert "duty cycle of" not in adaptive
    _, lossy = validated(trackfield, "sensor.threshold=adaptive", "link.loss=0.95")
    assert re.search(r"warning: less than 50% of doa.*; up to \d+ of 1176 reports .* in up to \d+ of 60 steps", lossy)
