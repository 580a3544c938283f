"""The report of a run with masters and slaves: who led when, who belonged to whom, and the figures of metrics.json."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes

from launcher.record.figures import terms
from launcher.report.figures import FIGURES
from launcher.report.folder import Run, read_run
from launcher.report.led import Led, read_led, seconds
from launcher.report.parts import clusters, errors
from launcher.study.replay import replay
from tests.led_runs import scenario
from tests.reporting import read, run
from trackfield.errors import ScenarioError

KILLED_S, CUT_S = 12.0, (20.0, 28.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The leader m5 is killed; later two masters are cut off for a while."""
    file = scenario(tmp_path_factory.mktemp("scenario"))
    faults = (
        f"faults=[{{kind='kill', nodes=['m5', 'n003'], at_s={KILLED_S}}}, "
        f"{{kind='partition', nodes=['m1', 'm2'], at_s={CUT_S[0]}, until_s={CUT_S[1]}}}]"
    )
    return run(tmp_path_factory.mktemp("run"), faults, scenario=file, steps=60)


@pytest.fixture(scope="module")
def clustered(folder: Path) -> Run:
    return read_run(folder)


@pytest.fixture(scope="module")
def led(clustered: Run) -> Led:
    return read_led(clustered)


def axes_of(name: str, run: Run) -> list[Axes]:
    figure = FIGURES[name](run)
    assert figure is not None
    return list(figure.axes)


def labelled(axes: Axes, label: str) -> np.ndarray:
    [line] = [line for line in axes.lines if line.get_label() == label]
    return np.array(line.get_xydata())


def test_the_tables_tell_the_terms_that_the_recorder_counted(clustered: Run, led: Led) -> None:
    counted = clustered.metrics["leaders"]
    hows = [turn.how for turn in led.turns]
    assert hows.count(terms.HAND_OVER) == counted["handovers"] > 0
    assert hows.count(terms.TAKE_OVER) == counted["take_overs"] > 0
    assert sum(turn.false for turn in led.turns) == counted["false_take_overs"]
    assert len(led.lost) == counted["lost_handovers"] > 0
    assert led.used is not None
    assert led.asked is not None
    assert np.mean(list(led.used.values())) == pytest.approx(counted["reports_used"])
    assert np.mean(list(led.asked.values())) == pytest.approx(counted["reports_asked"])


def test_the_dead_leader_was_taken_over_after_its_silence(clustered: Run, led: Led) -> None:
    first = next(turn for turn in led.turns if turn.how == terms.TAKE_OVER)
    silence_s = clustered.scenario.architecture.timeout_steps * clustered.step_s  # type: ignore[attr-defined]
    assert not first.false
    assert KILLED_S + silence_s - clustered.step_s < seconds(clustered, first.begun_ns) < KILLED_S + silence_s + 2.0


def test_the_strip_has_a_bar_for_each_term_and_a_mark_where_it_began(clustered: Run, led: Led) -> None:
    strip, reports = axes_of("leaders", clustered)
    names = [label.get_text() for label in strip.get_yticklabels()]
    assert set(names) == {turn.leader for turn in led.turns} | {lost.src for lost in led.lost}
    bars = [(bar.get_x(), names[round(bar.get_y() + bar.get_height() / 2)]) for bar in strip.containers for bar in bar]
    assert bars == [(pytest.approx(seconds(clustered, turn.begun_ns)), turn.leader) for turn in led.turns]
    handed = [turn for turn in led.turns if turn.how == terms.HAND_OVER]
    assert labelled(strip, "hand-over")[:, 0] == pytest.approx([seconds(clustered, one.begun_ns) for one in handed])
    lost = labelled(strip, "hand-over lost")
    assert [(round(t, 6), names[round(row)]) for t, row in lost.tolist()] == [
        (round(seconds(clustered, one.sent_ns), 6), one.src) for one in led.lost
    ]
    assert led.used is not None
    used = labelled(reports, "used")
    assert {round(t / clustered.step_s): n for t, n in used.tolist() if np.isfinite(n)} == led.used


def test_the_map_has_an_edge_from_each_slave_to_its_master(clustered: Run) -> None:
    [axes] = axes_of("clusters", clustered)
    members = clustered.metrics["clusters"]["members"]
    at = {place.id: (place.x, place.y) for place in clustered.places}
    edges = {tuple(map(tuple, np.array(line.get_xydata()).tolist())) for line in axes.lines if line.get_ls() == "-"}
    assert edges == {(at[master], at[id]) for master, own in members.items() for id in own}
    alone = labelled(axes, "no master, or dead").tolist()
    taken = {id for own in members.values() for id in own}
    assert alone == [list(at[id]) for id in clustered.sensors if id not in taken]
    assert list(at["n003"]) in alone
    assert {text.get_text() for text in axes.texts} == set(members)


def test_the_page_has_the_figures_of_metrics(folder: Path, clustered: Run) -> None:
    text, metrics = read(folder).text, json.loads((folder / "metrics.json").read_text())
    leaders = metrics["leaders"]
    assert f"hand-overs {leaders['handovers']}, and {leaders['lost_handovers']} lost" in text
    assert f"slaves without a master {metrics['clusters']['orphans_first']} at the first step" in text
    assert [row[0] for row in errors.trackers(clustered).rows] == ["ukf", "ukf, base"]


def test_without_masters_there_is_no_such_section(tmp_path: Path) -> None:
    folder = run(tmp_path / "run", steps=3)
    found = read_run(folder)
    assert not clusters.shown(found)
    assert read_led(found) == Led()
    assert FIGURES["leaders"](found) is None
    assert FIGURES["clusters"](found) is None
    assert 'id="clusters"' not in (folder / "report.html").read_text()


def test_masters_that_are_not_of_the_scenario_are_not_drawn(clustered: Run) -> None:
    metrics = clustered.metrics | {
        "clusters": clustered.metrics["clusters"] | {"members": {"m0": ["?"], "??": ["n001"]}}
    }
    [axes] = axes_of("clusters", replace(clustered, metrics=metrics))
    assert [text.get_text() for text in axes.texts] == ["m0"]


def test_a_run_with_turns_is_not_replayed(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"tracks\.parquet: term: m0 took turns with others at tracking, which a"):
        replay(folder, out=tmp_path / "again")
    assert not (tmp_path / "again").exists()
