"""The report of runs in which any node may lead: who led when, elections, and the figures of metrics.json."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes

from launcher.record.figures import terms
from launcher.record.figures.elections import Election
from launcher.record.figures.elections import Led as Winner
from launcher.report.figures import FIGURES
from launcher.report.folder import Run, read_run
from launcher.report.led import Led, read_led, seconds
from launcher.report.parts import clusters, heads
from tests.peer_runs import scenario
from tests.reporting import read, run
from trackfield.role import NS

STEPS = 40
CUT = ("n001", "n003", "n008", "n013", "n018", "n022")
"""These hear nothing of the others as the target comes, and so they elect a head of their own."""
CUT_UNTIL_S, KILLED_S = 6.0, 14.0
DEAD_S = 6.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two heads are elected, as the field is in two parts; one of them is killed later."""
    faults = (
        f"faults=[{{kind='partition', nodes={list(CUT)}, at_s=0.1, until_s={CUT_UNTIL_S}}}, "
        f"{{kind='kill', nodes=['n012'], at_s={KILLED_S}}}]"
    )
    file = scenario(tmp_path_factory.mktemp("scenario"))
    return run(tmp_path_factory.mktemp("elected"), faults, scenario=file, steps=STEPS)


@pytest.fixture(scope="module")
def elected(folder: Path) -> Run:
    return read_run(folder)


@pytest.fixture(scope="module")
def central(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The head is killed, and another node takes over."""
    settings = ("architecture.kind=location-central", f"faults=[{{kind='kill', nodes=['n012'], at_s={DEAD_S}}}]")
    file = scenario(tmp_path_factory.mktemp("scenario"))
    return read_run(run(tmp_path_factory.mktemp("central"), *settings, scenario=file, steps=STEPS))


def axes_of(name: str, run: Run) -> list[Axes]:
    figure = FIGURES[name](run)
    assert figure is not None
    return list(figure.axes)


def labelled(axes: Axes, label: str) -> np.ndarray:
    [line] = [line for line in axes.lines if line.get_label() == label]
    return np.array(line.get_xydata())


@pytest.mark.parametrize("which", ["elected", "central"])
def test_the_tables_tell_what_the_recorder_counted(which: str, request: pytest.FixtureRequest) -> None:
    ran: Run = request.getfixturevalue(which)
    led, counted = read_led(ran), ran.metrics["leaders"]
    hows = [turn.how for turn in led.turns]
    assert hows.count(terms.HAND_OVER) == counted["handovers"] > 0
    assert hows.count(terms.TAKE_OVER) == counted["take_overs"]
    assert hows.count(terms.ELECTION) == sum(len(one.led) for one in led.elections) > 0
    assert len(led.elections) == counted["elections"]
    assert sum(one.split for one in led.elections) == counted["split_elections"]
    assert sum(not one.led for one in led.elections) == counted["unwon_elections"]
    assert led.over is not None
    assert len(led.over) == counted["dissolved"]
    assert led.asked is not None
    assert np.mean(list(led.asked.values())) == pytest.approx(counted["reports_asked"])
    sensors = int(ran.scenario.architecture.options["sensors"])
    asked = [led.asked[step] for step in sorted(led.asked)]
    searched = next(i for i, many in enumerate(asked) if many == sensors)
    assert asked[:searched] == [2 * sensors] * searched  # before there is a track
    assert set(asked[searched:]) == {sensors}


def test_two_halves_of_a_field_elect_a_head_each(elected: Run) -> None:
    """Both lead until one of them is killed or yields: they are out of each other's reach up to ``CUT_UNTIL_S``."""
    counted = elected.metrics["leaders"]
    [split] = [one for one in read_led(elected).elections if one.split]
    assert {winner.leader in CUT for winner in split.led} == {True, False}
    assert split.healed_ns is not None
    assert counted["healed_s"]["max"] == split.healed_ns / NS
    assert CUT_UNTIL_S < seconds(elected, split.led[1].begun_ns) + split.healed_ns / NS < KILLED_S
    assert counted["two_leader_steps"] > 0


def test_a_dead_head_is_taken_over_within_a_step(central: Run) -> None:
    led = read_led(central)
    [turn] = [one for one in led.turns if one.how == terms.TAKE_OVER]
    assert not turn.false
    assert DEAD_S < seconds(central, turn.begun_ns) < DEAD_S + central.step_s


def test_the_strip_has_a_bar_for_each_term_and_a_mark_for_how_it_began(elected: Run) -> None:
    led = read_led(elected)
    strip, reports = axes_of("heads", elected)
    names = [label.get_text() for label in strip.get_yticklabels()]
    bars = [(bar.get_x(), names[round(bar.get_y() + bar.get_height() / 2)]) for bar in strip.containers for bar in bar]
    assert bars == [(pytest.approx(seconds(elected, turn.begun_ns)), turn.leader) for turn in led.turns]
    for how in (terms.ELECTION, terms.HAND_OVER):
        began = [(seconds(elected, turn.begun_ns), turn.leader) for turn in led.turns if turn.how == how]
        marks = [(t, names[round(row)]) for t, row in labelled(strip, how).tolist()]
        assert marks == [(pytest.approx(t), leader) for t, leader in began]
    asked = labelled(reports, "asked for")
    assert {round(t / elected.step_s): n for t, n in asked.tolist() if np.isfinite(n)} == led.asked


def test_a_term_that_was_given_up_has_a_mark_at_its_end(elected: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    led = read_led(elected)
    last, origin_ns = led.turns[-1], elected.site.origin_ns
    over = {(last.number, last.leader): origin_ns + 30 * NS, (9, "who did not lead"): origin_ns}
    monkeypatch.setattr(heads, "read_led", lambda _: replace(led, over=over))
    strip = axes_of("heads", elected)[0]
    names = [label.get_text() for label in strip.get_yticklabels()]
    assert labelled(strip, "given up").tolist() == [[30.0, names.index(last.leader)]]


def test_elections_are_listed_with_their_claims_and_winners(elected: Run) -> None:
    origin_ns, turn = elected.site.origin_ns, terms.Turn(1, "b", elected.site.origin_ns + NS, terms.ELECTION)
    found = (
        Election(1, origin_ns + NS // 8, (("a", 300), ("b", 20)), (Winner("b", origin_ns + NS, origin_ns + 4 * NS),)),
        Election(2, origin_ns + 3 * NS, (("c", 9),)),
        Election(3, origin_ns + 30 * NS, (("c", 9),)),
        Election(
            4,
            origin_ns + 40 * NS,
            (("a", 1), ("b", 2)),
            (
                Winner("a", origin_ns + 41 * NS, origin_ns + 44 * NS),
                Winner("b", origin_ns + 42 * NS, origin_ns + 43 * NS),
            ),
        ),
    )
    led = Led((turn,), until_ns={(1, "b"): origin_ns + 4 * NS}, elections=found)
    assert heads.elections(elected, led).rows == [
        ["0.12 s", "1", "2", "b, a", "b", "0.875 s", "–"],
        ["3.00 s", "2", "1", "c", "nobody, as b led", "–", "–"],
        ["30.00 s", "3", "1", "c", "nobody", "–", "–"],
        ["40.00 s", "4", "2", "a, b", "a, b", "1 s", "1 s"],
    ]
    many = replace(led, elections=found[:1] * (heads.MOST_ELECTIONS + 3))
    assert len(heads.elections(elected, many).rows) == heads.MOST_ELECTIONS


def test_the_page_has_the_figures_of_metrics(folder: Path, elected: Run) -> None:
    text, metrics = read(folder).text, json.loads((folder / "metrics.json").read_text())
    leaders, awake = metrics["leaders"], metrics["awake_share"]
    split = f"{leaders['split_elections']} by more than one"
    assert f"elections {leaders['elections']}; {leaders['unwon_elections']} won by nobody, {split}" in text
    assert f"awake, mean and most {100 * awake['mean']:.1f} %, {100 * awake['most']:.1f} %" in text
    assert f"terms that a head gave up {leaders['dissolved']}" in text
    assert 0 < awake["mean"] < awake["most"] < 1
    assert clusters.contents(elected) == {"lines": []}
    assert FIGURES["leaders"](elected) is None
    page = (folder / "report.html").read_text()
    assert '<a href="#heads">Heads</a>' in page
    assert 'id="clusters"' not in page


def test_without_such_nodes_there_is_no_such_section(tmp_path: Path) -> None:
    folder = run(tmp_path / "run", steps=3)
    found = read_run(folder)
    assert heads.contents(found) == {"lines": []}
    assert FIGURES["heads"](found) is None
    assert 'id="heads"' not in (folder / "report.html").read_text()
