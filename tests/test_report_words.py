"""What a report says in words, and the command that makes it anew."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from launcher import report
from launcher.record.words import joules, span
from launcher.report import page
from launcher.report.cells import number, percent
from launcher.report.folder import read_run
from launcher.report.parts import errors, setting, verdicts
from launcher.report.parts.consistency import consistency
from tests.command_line import Call, trackfield
from tests.reporting import changed, copied, read, run, troubled
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario, summary

__all__ = ["copied", "trackfield", "troubled"]

# --- words ------------------------------------------------------------------------------------------------------------


def test_verdicts(copied: Path) -> None:
    def known(metrics: dict[str, Any]) -> None:
        one, other = metrics["trackers"].values()
        one |= {"verdict": "tracked", "steps": 12, "nees": 9.0, "nees_band": [3.0, 5.0], "median_error": 1.0}
        one |= {"nees_position": 6.0, "nees_position_band": [1.0, 3.0]}
        one |= {"bound_m": 2.0, "times_bound": 1.5, "share_within": 1.0}
        one["rmse"]["position"] = 3.0
        other |= {"verdict": "lost", "lost": True, "steps": 7, "nees": None, "share_within": 7 / 12}

    run = changed(copied, known)
    first, second = verdicts.verdicts(run)
    assert (first.state, first.look, second.state, second.look) == ("tracked", "good", "lost", "bad")
    assert first.text.startswith(
        "RMSE 3.00 m, median error 1.00 m over all 12 steps (5 of them without a report); "
        "1.50 times the bound of 2.00 m over the same steps."
    )
    assert first.text.endswith(
        "NEES 9.00 (95 % band 3.00 to 5.00), of the position 6.00 (95 % band 1.00 to 3.00): overconfident."
    )
    table = errors.trackers(run)
    row = dict(zip(table.head, table.rows[0], strict=True))
    shown = {"verdict": "tracked", "RMSE [m]": "3.00", "bound [m]": "2.00", "/ bound": "1.50", "median [m]": "1.00"}
    assert row | shown | {"steps": "12 of 12"} == row
    assert consistency(run).rows[0] == ["imm-ukf", "9.00", "3.00", "5.00", "6.00", "1.00", "3.00"]
    bare = replace(run, tracks=tuple(replace(track, bound=track.bound * np.nan) for track in run.tracks))
    assert "/ bound" not in errors.trackers(bare).head
    assert "over 7 of 12 steps" in second.text
    assert "Within 50 m of the truth at 58.3 % of the steps." in second.text
    assert "Lost by the rule of the scenario: more than 50 m off, or without a track, at the last step." in second.text
    assert "NEES" not in second.text
    assert first.colour != second.colour


@pytest.mark.parametrize(
    ("nees", "of_position", "said"),
    [
        (2.0, 0.5, "underconfident"),
        (4.0, 2.0, "consistent"),
        (6.0, 4.0, "overconfident"),
        (4.0, 4.0, "consistent as a whole, overconfident of the position"),
        (6.0, None, "overconfident"),
    ],
)
def test_whether_a_covariance_is_right(copied: Path, nees: float, of_position: float | None, said: str) -> None:
    def known(metrics: dict[str, Any]) -> None:
        for m in metrics["trackers"].values():
            m |= {"nees": nees, "nees_band": [3.0, 5.0]}
            m |= {"nees_position": of_position, "nees_position_band": [1.0, 3.0]}

    assert all(verdict.text.endswith(f": {said}.") for verdict in verdicts.verdicts(changed(copied, known)))


@pytest.mark.parametrize(
    ("value", "said"),
    [(None, "–"), (0, "0"), (7, "7"), (12345, "12,345"), (1234.5, "1,234"), (99.94, "99.9"), (1.236, "1.24"),
     (0.0, "0.00"), (0.01234, "0.0123"), (-2.5, "-2.50"), (float("inf"), "–"), (float("nan"), "–")],
)  # fmt: skip
def test_figures_have_three_digits_or_so(value: float | None, said: str) -> None:
    assert number(value) == said
    assert number(value, "m") in (f"{said} m", "–")


@pytest.mark.parametrize(
    ("seconds", "said"),
    [(0.3, "0.3 s"), (40, "40 s"), (100.4, "100 s"), (180, "3 min"), (5400, "90 min"), (7 * 3600, "7 h"),
     (23 * 86_400, "23 days"), (3 * 365.25 * 86_400, "3 years")],
)  # fmt: skip
def test_a_duration_has_the_unit_that_suits_it(seconds: float, said: str) -> None:
    assert span(seconds) == said


@pytest.mark.parametrize(
    ("energy_j", "said"), [(8584.3, "8.58 kJ"), (54.7, "54.7 J"), (0.456, "456 mJ"), (2e7, "20 MJ"), (0.0, "0 J")]
)
def test_an_energy_has_the_unit_that_suits_it(energy_j: float, said: str) -> None:
    assert joules(energy_j) == said


@pytest.mark.parametrize(
    ("share", "said"),
    [(0.0, "0.0 %"), (0.0001, "< 0.1 %"), (0.336, "33.6 %"), (0.9994, "99.9 %"),
     (1999 / 2000, "> 99.9 %"), (1.0, "100.0 %")],
)  # fmt: skip
def test_a_share_that_is_not_nothing_or_not_all_is_never_said_to_be(share: float, said: str) -> None:
    assert percent(share) == said


def test_what_was_run_stands_on_top(copied: Path) -> None:
    text = read(copied).text
    assert summary("zhai-spcpf") in text
    for words in (
        "target.steps = 12", "link.model = fixed", "faults = kill, partition, freeze",
        "sensors 121, layout grid, 50 m apart",
        "sensing bearing (sd 3°) and level, within 56 m", "deadline 0.3 s after each step", "steps 12 of 1 s each",
    ):  # fmt: skip
        assert words in text


def test_the_contents_lead_to_every_section(copied: Path) -> None:
    tags = read(copied).tags
    sections = [attributes["id"] for tag, attributes in tags if tag == "section"]
    assert [attributes["href"] for tag, attributes in tags if (attributes.get("href") or "").startswith("#")] == [
        f"#{id}" for id in sections
    ]


def test_what_the_machine_did_wrong_comes_first(copied: Path) -> None:
    def spoilt(metrics: dict[str, Any]) -> None:
        metrics["timing"]["host_late"] = 3
        metrics["frames"]["host_lost"] = 5
        metrics["frames"]["host_late"] = 2
        metrics["timing"] |= {"unsettled": 4, "foreign_corrections": 6, "retractions": 8}
        metrics["driver"] = "processes"
        metrics["recorder"]["dropped"] = 7
        metrics["processes"]["died"] = [{"id": "n010", "host": "h", "why": "signal 9", "t": 2.5}]
        metrics["processes"]["stopped"] = [{"id": "n011", "host": "h", "t": None, "s": None}]

    changed(copied, spoilt)
    report.write_report(copied)
    made = read(copied)
    assert sum(attributes.get("role") == "alert" for _, attributes in made.tags) == 6
    for words in (
        "3 events came too late", "5 frames were lost by the machine", "7 frames never reached the recorder",
        "4 processes were not settled", "6 frames to foreign devices were taken back or replaced",
        "host late", "frames taken back or replaced 8", "processes not settled at the end 4",
    ):  # fmt: skip
        assert words in made.text
    for words in (
        "2.5 s died: signal 9 n010 not planned",
        "before the start was stopped from outside and never resumed n011",
    ):
        assert words in made.text


# --- the command ------------------------------------------------------------------------------------------------------


def test_commands_to_do_it_again_are_right(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, trackfield: Call) -> None:
    """Those of the page, given as they stand, run, and give the same run."""
    monkeypatch.chdir(tmp_path)
    folder = run(tmp_path / "it is mine")
    given = [words for words, _ in page.commands(read_run(folder))]
    _, again, compare, _, anew = (shlex.split(words)[1:] for words in given)
    assert trackfield(*again).code == 0
    said = trackfield(*compare)
    assert (said.code, "the fate of every frame is the same" in said.out) == (0, True)
    (folder / report.PAGE).unlink()
    assert trackfield(*anew).out == f"{Path('it is mine') / report.PAGE}\n"
    assert (folder / report.PAGE).exists()


@pytest.mark.parametrize(
    ("name", "content", "what"),
    [
        ("metrics.json", None, "has no metrics.json"),
        ("manifest.json", b"{", "its manifest.json is damaged"),
        ("tracks.parquet", b"PAR1", "its tracks.parquet is damaged"),
        ("messages.parquet", None, "has no messages.parquet"),
    ],
)
def test_what_is_no_finished_run_is_named(
    copied: Path, trackfield: Call, name: str, content: bytes | None, what: str
) -> None:
    (copied / name).unlink()
    if content is not None:
        (copied / name).write_bytes(content)
    with pytest.raises(ScenarioError) as failure:
        read_run(copied)
    assert (failure.value.file, failure.value.what) == (str(copied), what)
    said = trackfield("report", str(copied))
    assert (said.code, said.err.count("\n")) == (2, 1)
    assert what in said.err


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({}, []),
        ({"seed": 7, "sensor.doa_sd_deg": 5.0}, ["sensor.doa_sd_deg = 5.0"]),
        ({"link.model": "ideal"}, ["link.model = ideal"]),
        (
            {"sensor.kind": "rss", "sensor.shadow_sd_db": 6.0, "fusion.trackers": ["ukf"]},
            ["sensor.kind = rss", "sensor.shadow_sd_db = 6.0", 'fusion.trackers = ["ukf"]'],
        ),
        (
            {"target.path": "waypoints", "target.waypoints": [[0, 0, 0], [9, 90, 0]]},
            ["target.path = waypoints", "target.waypoints = [[0.0, 0.0, 0.0], [9.0, 90.0, 0.0]]"],
        ),
    ],
)
def test_what_was_changed_in_a_packaged_scenario(tmp_path: Path, settings: dict[str, Any], says: list[str]) -> None:
    """Of a section of another kind no key that is as that kind has it anyway."""
    one: Any = SimpleNamespace(scenario=Scenario.load("zhai-spcpf", settings), folder=tmp_path)
    assert setting.changed(one) == says
