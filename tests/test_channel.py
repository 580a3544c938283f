"""How full the channel of a run was: in metrics.json, on the page, under both drivers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from launcher.plan.air import flatters
from launcher.plan.prepare import load, planned
from launcher.record.figures.channel import air_of_run, channel_metrics, is_fiction
from launcher.record.ledger import Ledger
from launcher.record.virtually import simulate
from launcher.record.words import alarms
from launcher.records import Plan
from launcher.report.folder import read_run
from launcher.report.parts.channel import contents
from tests.running import Run, both_ways
from trackfield.drivers.engine.frames import Frame
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.role import NS

CROWDED = ("zhai-spcpf", "--set", "link.ack=0", "--set", "target.steps=20")
CALM = ("zhai-spcpf", "--set", "target.steps=20")


def plan_of(*settings: str) -> Plan:
    return planned(load("zhai-spcpf", settings=settings))


def read(folder: Path) -> dict[str, Any]:
    metrics: dict[str, Any] = json.loads((folder / "metrics.json").read_text())
    return metrics


def test_a_run_without_a_radio_has_none() -> None:
    ledger, _ = simulate(plan_of("link.model=fixed", "target.steps=3"))
    assert ledger.aired == []
    assert set(channel_metrics(air_of_run(ledger)).values()) == {None}


def test_frames_that_were_taken_back_were_never_on_the_air() -> None:
    """Two at once at a hub, and one that was taken back."""
    specs = [ProcessSpec("hub", "x", "none", x=10.0, peers={"a": (0.0, 0.0), "b": (20.0, 0.0)})]
    specs += [ProcessSpec(id, "x", "none", x=x, peers={"hub": (10.0, 0.0)}) for id, x in (("a", 0.0), ("b", 20.0))]
    link = {"model": "lognormal_prr", "radio": "lora868"}
    ledger = Ledger(RunSpec("r", 1, 100 * NS, link), specs)
    one, other, gone = (
        Frame(id, 0, "k", at, 0, "hub", "field", b"x" * 20) for id, at in (("a", NS), ("b", NS), ("a", 9 * NS))
    )
    for frame in (one, other, gone):
        ledger.sent(frame)
    ledger.sent(gone.taken_back, 1)
    ledger.close()
    assert [(frame.src, frame.sent_ns) for frame in ledger.aired] == [("a", NS), ("b", NS)]
    found = air_of_run(ledger)
    assert found is not None
    assert (found.expected, found.overlapped, found.deaf) == (2, 2, 0)
    assert [use.id for use in found.uses] == ["hub"]


@pytest.mark.parametrize(
    ("spared", "lost", "of", "use", "fiction"),
    [
        (50, 0, 1000, 0.0, True),
        (49, 0, 1000, 0.0, False),
        (30, 20, 1000, 0.0, True),
        (30, 31, 1000, 0.0, False),
        (8, 7, 1000, 0.0, False),
        (4, 0, 10, 0.0, False),
        (0, 0, 1000, 0.2, True),
        (0, 0, 1000, 0.19, False),
    ],
)
def test_when_losses_are_a_fiction(spared: int, lost: int, of: int, use: float, fiction: bool) -> None:
    assert flatters(spared, lost, of, use) is fiction


def test_a_full_channel_is_no_fiction_of_itself_where_radios_do_not_listen() -> None:
    assert not flatters(0, 0, 1000, 0.9, None)
    assert flatters(50, 0, 1000, 0.9, None)


@pytest.mark.rendered
def test_the_page_is_red_where_the_losses_are_a_fiction(tmp_path: Path) -> None:
    for name, arguments, red in (("crowded", CROWDED, True), ("calm", CALM, False)):
        code, said = Run(tmp_path / name, *arguments, "--virtual", reported=True).finish()
        assert code == 0, said
        metrics = read(tmp_path / name)
        assert is_fiction(metrics) is red
        assert ("a fiction" in said) is red
        assert any("a fiction" in alarm for alarm in alarms(metrics)) is red
        page = (tmp_path / name / "report.html").read_text()
        assert ("losses of this run are a fiction" in page) is red
        shown = contents(read_run(tmp_path / name))
        assert [bad for *_, bad in shown["lines"]][-2:] == [red, red]
        assert "<h2>The channel</h2>" in page


def test_both_drivers_find_the_same(tmp_path: Path) -> None:
    home = both_ways(tmp_path, *CROWDED)
    virtual, processes = read(home / "virtual"), read(home / "processes")
    assert virtual["channel"] == processes["channel"]
    assert virtual["channel"]["overlapped_share"] > 0.3
