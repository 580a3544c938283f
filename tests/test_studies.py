"""The studies: what they say of runs, exactly where it is known, and how they say it."""

from __future__ import annotations

import sys
from collections.abc import Mapping

import pytest

from launcher.plan.prepare import load, planned
from tests import studies
from tests.simulated import simulated, spcpf
from tests.studies import STUDIES, Outcome, Study, Way, first_set, lines, measured, outcome

QUIET = Way("zhai-spcpf", ("target.steps=12", "link.model=ideal"))


def cells(line: str) -> list[str]:
    """Of a line of a table."""
    assert line.startswith("| ")
    assert line.endswith(" |")
    return line[2:-2].split(" | ")


def table(study: Study, found: Mapping[Way, list[Outcome]]) -> list[dict[str, str]]:
    """Its rows by the names of their columns; the first table alone."""
    header, dashes, *rows = [cells(line) for line in lines(study, found) if line][: 2 + len(study.rows)]
    assert set(dashes) == {"---"}
    return [dict(zip(header, row, strict=True)) for row in rows]


@pytest.fixture(scope="module")
def clocks() -> dict[tuple[str, ...], dict[str, str]]:
    """The rows of zhai-spcpf s1 of the study of clocks, three runs each."""
    whole = STUDIES["clocks"]
    wanted = [("right", "-"), ("300 ms", "on"), ("300 ms", "off")]
    rows = {("zhai-spcpf s1", *name): whole.rows["zhai-spcpf s1", *name] for name in wanted}
    study = Study(whole.names, rows, whole.tables)
    found = measured([way for ways in rows.values() for way in ways], range(1, 4))
    return {(row["clocks"], row["sync"]): row for row in table(study, found)}


def test_clocks_that_are_off_cost_the_track_unless_they_are_set(clocks) -> None:
    error = {name: float(row["RMSE, m"]) for name, row in clocks.items()}
    assert error["300 ms", "off"] > 1.4 * error["300 ms", "on"]
    assert error["300 ms", "on"] < 1.4 * error["right", "-"]


def test_what_setting_them_takes(clocks) -> None:
    """Once set, a clock is as right as the radio's delays are alike in both directions: to some 2 ms."""
    right, off, on = clocks["right", "-"], clocks["300 ms", "off"], clocks["300 ms", "on"]
    assert right["sync frames"] == off["sync frames"] == "0"
    assert int(on["sync frames"]) > 200
    assert float(on["radio, J"]) > float(off["radio, J"])
    assert (off["set before, %"], off["then rms, ms"], off["then max"]) == ("0", "-", "-")
    assert float(on["set before, %"]) > 90
    assert float(on["then rms, ms"]) <= float(on["then max"]) < 3.0


def test_right_clocks_have_no_error(clocks) -> None:
    right = clocks["right", "-"]
    assert {right[key] for key in ("clock rms, ms", "max", "set before, %", "then rms, ms", "then max")} == {"-"}
    assert right["tracked / with gaps / lost"] == "3 / 0 / 0"


def test_an_outcome_is_what_the_run_said() -> None:
    one = outcome(QUIET, 3)
    settings = [*QUIET.settings, "fusion.trackers=['imm-ukf']"]
    _, tracks = simulated(spcpf(3, settings))
    assert len(one.errors) == len(one.sds) == len(tracks) == 12
    assert one.blank == 0
    assert studies.rmse([one]) == f"{one.of('trackers', 'imm-ukf', 'rmse', 'position'):.2f}"
    assert one.clock_ms == one.set_ms == ()


@pytest.mark.parametrize("seed", [4, 8])
def test_a_track_stays_in_a_field_in_which_one_or_two_hear_the_target(seed: int) -> None:
    one = outcome(Way("zhai-spcpf", ("target.path=s3", "sensor.threshold=0.78", "link.model=ideal")), seed)
    assert 1.0 < one.of("frames", "by_kind", "doa", "sent") / len(one.errors) < 2.0
    assert max(one.errors) < 50.0


def test_a_step_without_a_track_is_counted() -> None:
    """The centre is down for the deadlines of steps 3 to 6, and goes on with where it was at step 7."""
    down = "faults=[{kind='restart', nodes=['fusion'], at_s=3, until_s=8}]"
    one = outcome(Way("zhai-spcpf", (*QUIET.settings, down)), 3)
    assert (len(one.errors), one.blank) == (8, 4)


def test_when_a_node_first_knows_the_time() -> None:
    """Whose clock was set is right to the millisecond from then on, whoever was not is off by what it was drawn."""
    settings = ["target.steps=12", "clock.offset_ms=300"]
    ledger, _ = simulated(spcpf(2, settings))
    first = first_set(ledger)
    assert first
    errors = {(t, src): abs(error) / 1e6 for (t, src), error in ledger.clock_errors.items()}
    after = [error for (t, src), error in errors.items() if src in first and t > first[src]]
    before = [error for (t, src), error in errors.items() if src not in first or t <= first[src]]
    assert after
    assert before
    assert max(after) < 3.0 < max(before)
    one = outcome(Way("zhai-spcpf", tuple(settings)), 2)
    assert sorted(one.set_ms) == sorted(after)
    assert sorted(one.clock_ms) == sorted(before + after)


def test_figures_are_of_all_runs_together() -> None:
    runs = [Outcome(QUIET, errors, sds, blank, (), (), {}) for errors, sds, blank in
            (((3.0, 0.0), (1.0, 2.0), 1), ((4.0, 0.0), (3.0, 4.0), 2))]  # fmt: skip
    assert studies.rmse(runs) == "2.50"
    assert studies.largest(runs) == "4"
    assert studies.blank(runs) == "1.5"
    assert studies.worst_sd(0.5)(runs) == "2.50"


@pytest.mark.parametrize("name", STUDIES)
def test_every_way_of_every_study_can_be_planned(name: str) -> None:
    for ways in STUDIES[name].rows.values():
        for way in ways:
            planned(load(way.scenario, seed=1, settings=way.settings))


def test_a_table_has_a_row_for_each_row_and_a_cell_for_each_column() -> None:
    study = STUDIES["energy"]
    one = outcome(Way("zhai-spcpf", ("target.steps=5", "energy.battery_j=20000")), 1)
    found = {way: [one] for ways in study.rows.values() for way in ways}
    said = list(lines(study, found))
    first, second = said[: said.index("")], said[said.index("") + 1 :]
    assert len(first) == len(second) == 2 + len(study.rows)
    for part, figures in zip((first, second), study.tables, strict=True):
        assert cells(part[0]) == [*study.names, *figures]
        assert {len(cells(line)) for line in part} == {len(study.names) + len(figures)}
    metered = dict(zip(cells(second[0]), cells(second[2]), strict=True))["metered, J"]
    assert metered == f"{one.of('energy_j', 'total'):.2f}"


def test_an_unknown_study_is_refused(monkeypatch, capsys) -> None:
    monkeypatch.setattr(sys, "argv", ["studies", "tides"])
    with pytest.raises(SystemExit, match="2"):
        studies.main()
    assert "there is no study tides; there are clocks, thresholds, faults, energy" in capsys.readouterr().err
