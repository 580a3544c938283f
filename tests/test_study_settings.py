"""Which setting is best: paired differences, winners, fronts, what settings have in common, and the part of the page.

Statistical tests draw by key; a right answer fails one of them with the probability that it states.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from statistics import fmean

import pytest

from launcher.plan.prepare import load, planned
from launcher.study.axes import ARCHITECTURE, Design, design
from launcher.study.figures import FIGURES
from launcher.study.results import StudyRun, study_run
from launcher.study.settings.choice import COMPARED, DECISIVE, choice_of, titled
from launcher.study.settings.fairness import Facts, common, facts_of
from launcher.study.settings.paired import difference, front, verdict
from trackfield.draw import normal
from trackfield.errors import ScenarioError

# --- differences ------------------------------------------------------------------------------------------------------


def test_the_interval_of_a_difference_is_that_of_the_books() -> None:
    """Differences 1, 2, 3: mean 2, sd 1, Student's t with 2 degrees of freedom (4.3027)."""
    found = difference({1: 10.0, 2: 20.0, 3: 30.0, 9: 0.0}, {1: 11.0, 2: 22.0, 3: 33.0, 8: 5.0})
    assert found is not None
    assert (found.value, found.runs) == (2.0, 3)
    assert found.low == pytest.approx(2 - 4.3027 / 3**0.5, abs=1e-4)
    assert found.high == pytest.approx(2 + 4.3027 / 3**0.5, abs=1e-4)
    assert not found.separated


def test_pairs_separate_what_the_means_alone_do_not() -> None:
    """Runs differ by tens between seeds, and by 1 between settings."""
    seeds = range(8)
    one = {seed: 50 + 30 * normal(7, seed) for seed in seeds}
    other = {seed: value + 1 + 0.1 * normal(8, seed) for seed, value in one.items()}
    found = verdict([one, other], "less")
    assert found.winner == 0
    shuffled = {seed: other[(seed + 3) % 8] for seed in seeds}
    assert verdict([one, shuffled], "less").winner is None


def test_few_runs_separate_nothing() -> None:
    found = difference({1: 1.0, 2: 1.0}, {1: 5.0, 2: 5.0})
    assert found is not None
    assert (found.value, found.low, found.separated) == (4.0, None, False)
    assert difference({1: 1.0}, {2: 1.0}) is None


def test_what_is_equal_but_for_rounding_is_not_separated() -> None:
    equal = dict.fromkeys(range(5), 0.1 + 0.2)
    assert verdict([equal, dict.fromkeys(range(5), 0.3)], "less").winner is None
    assert verdict([dict.fromkeys(range(5), 0.3), dict.fromkeys(range(5), 0.4)], "less").winner == 0


def test_a_winner_is_separated_from_all_others() -> None:
    a, b, c = ({seed: mean + spread * normal(1, seed, k) for seed in range(6)}
               for k, (mean, spread) in enumerate([(1.0, 0.01), (2.0, 0.01), (1.5, 2.0)]))  # fmt: skip
    assert verdict([a, b], "less").winner == 0
    assert verdict([a, b], "more").winner == 1
    found = verdict([a, b, c], "less")
    assert found.winner is None
    assert {found.best, *found.open} == {0, 2}
    assert verdict([a, {}], "less").winner is None  # alone
    assert verdict([{}, {}], "less").best is None


def test_what_is_lost_wins_nothing_however_good_it_looks() -> None:
    a, b, c = (dict.fromkeys(range(5), float(value)) for value in (1, 2, 3))
    assert verdict([a, b, c], "less").winner == 0
    assert verdict([a, b, c], "less", lost=[0]).winner == 1
    assert verdict([a, b], "less", lost=[0]).winner == 1
    assert verdict([a, b], "less", lost=[0, 1]).winner is None
    assert front([{"x": a}, {"x": b}], {"x": "less"}, lost=[0]) == (1,)


def test_a_wrong_winner_is_rare() -> None:
    """Of four settings without any difference one wins in 5 % of figures at most: of 400 in 37 at most, or a right
    answer fails with a probability below 1e-3 (binomial)."""
    won = 0
    for trial in range(400):
        settings = [{seed: normal(3, trial, seed, k) for seed in range(6)} for k in range(4)]
        won += verdict(settings, "less").winner is not None
    assert won <= 37


def test_the_front_has_what_no_other_dominates_in_all_figures() -> None:
    better = {"error": "less", "life": "more"}
    settings = [
        {"error": {1: 1.0}, "life": {1: 5.0}},
        {"error": {1: 2.0}, "life": {1: 9.0}},
        {"error": {1: 2.0}, "life": {1: 4.0}},
        {"life": {1: 1.0}},
    ]
    assert front(settings, better) == (0, 1)  # type: ignore[arg-type]
    assert front([settings[0], settings[0]], better) == (0, 1)  # type: ignore[arg-type]


# --- what was the same ------------------------------------------------------------------------------------------------


@cache
def facts(*settings: str) -> Facts:
    scenario = load("bus", settings=["target.steps=6", *settings])
    return facts_of(scenario, planned(scenario))


def test_architectures_have_all_but_their_processes_in_common() -> None:
    one, other = facts(), facts("architecture.kind=clusters")
    same, different = common([[one, other]])
    assert not different
    assert len(same) == len(one.same)
    assert one.extras == ("1 fusion (mains)",)
    assert set(other.extras) == {"8 master (mains)", "1 base (mains)"}


def test_masters_with_batteries_are_said_to_have_them() -> None:
    assert "8 master (battery)" in facts("architecture.kind=clusters", "architecture.master_battery_j=100").extras


@pytest.mark.parametrize(
    ("setting", "what"),
    [
        ("field.spacing_m=60", "sensors and their places"),
        ("energy.battery_j=10", "batteries and power of sensors"),
        ("link.extra_loss=0.1", "link"),
        ("sensor.doa_sd_deg=4", "sensing"),
        ("clock.offset_ms=1", "clocks"),
        ("target.hasten=2", "targets and their paths"),
        ("fusion.deadline_s=0.4", "trackers, prior and deadline"),
        ("faults=[{kind='kill',part='base',at_s=3}]", "planned faults"),
    ],
)
def test_what_differs_is_said(setting: str, what: str) -> None:
    _, different = common([[facts(), facts(setting)]])
    assert any(what in name for name in different)
    _, apart = common([[facts(), facts()], [facts(setting), facts(setting)]])
    assert not apart  # it is compared within each group only


# --- studies ----------------------------------------------------------------------------------------------------------


def small(*settings: str, **vary: list[object]) -> Design:
    scenario = load("bus", trackers=["imm-ukf"], settings=["target.steps=8", *settings])
    return design(scenario, (1, 2, 3), {key.replace("__", "."): values for key, values in vary.items()})


def test_a_study_of_architectures_lets_the_field_idle() -> None:
    assert small(architecture__kind=["centralised", "clusters"]).scenario.run.idle_s == 120
    assert small(link__extra_loss=[0, 0.2]).scenario.run.idle_s is None
    told = small("run.idle_s=30", architecture__kind=["centralised", "clusters"])
    assert {one.scenario.run.idle_s for one in told.variants} == {30}


@cache
def whole() -> tuple[Design, tuple[StudyRun, ...]]:
    """Two losses with a centre, three seeds; the deadline takes the place of an architecture."""
    made = small("run.idle_s=20", fusion__deadline_s=[0.2, 0.4], link__extra_loss=[0, 0.3])
    runs = [
        study_run(made.variants[place].scenario.set("seed", seed)).of(made.variants[place].values)
        for place, seed in made.jobs
    ]
    return made, tuple(runs)


def test_every_compared_figure_is_one_of_a_study() -> None:
    assert set(DECISIVE) <= set(COMPARED) <= FIGURES.keys()
    assert ARCHITECTURE == "architecture.kind"


def test_a_choice_names_winners_by_combination_of_the_other_keys() -> None:
    made, runs = whole()
    found = choice_of(made, runs)
    assert found is not None
    assert (found.title, found.settings, found.tracker) == ("Which fusion.deadline_s?", ("0.2", "0.4"), "imm-ukf")
    assert [table.title for table in found.tables] == ["link.extra_loss=0", "link.extra_loss=0.3"]
    for table in found.tables:
        lines = {line.title.partition(" [")[0]: line for line in table.lines}
        late = lines["latency from step to base, 95 %"]
        assert (late.said, [cell.text for cell in late.cells]) == ("0.2", ["200", "400"])
        assert [cell.mark for cell in late.cells] == ["won", ""]
        assert late.cells[1].difference == "+200 to +200"
        assert lines["power without a target"].said.startswith("not separated: ")
    assert dict(found.overview)["latency from step to base, 95 %"] == ("0.2", "0.2")
    assert "trackers, prior and deadline" in found.different
    assert "link" in found.same
    assert found.extras == (("0.2", "1 fusion (mains)"), ("0.4", "1 fusion (mains)"))


def test_the_figures_of_a_choice_are_those_of_the_runs() -> None:
    made, runs = whole()
    own = [run.metrics.plain() for run in runs if run.values == {"fusion.deadline_s": 0.4, "link.extra_loss": 0}]
    found = choice_of(made, runs)
    assert found is not None
    line = next(one for one in found.tables[0].lines if one.title.startswith("power with a target"))
    assert line.title.endswith("[W]")
    assert float(line.cells[1].text) == pytest.approx(
        fmean(one["ledger"]["power_w"]["present"] for one in own), rel=0.01
    )


def test_the_power_by_purpose_adds_up_to_the_power() -> None:
    made, runs = whole()
    found = choice_of(made, runs)
    assert found is not None
    own = [run.metrics.ledger for run in runs if run.values == {"fusion.deadline_s": 0.2, "link.extra_loss": 0}]
    for place, key in enumerate(("present", "idle")):
        told = sum(float(cells[0][place].replace(",", "")) for _, cells in found.powers)
        assert told == pytest.approx(1e3 * fmean(getattr(one.power_w, key) for one in own), rel=0.01)
    assert dict(found.powers)["reports"][0][1] == "0"


def test_nothing_wins_with_two_seeds_and_that_is_said() -> None:
    made, runs = whole()
    found = choice_of(replace(made, seeds=(1, 2)), [run for run in runs if run.seed < 3])
    assert found is not None
    assert "Too few seeds" in found.level
    assert not any(cell.mark == "won" for table in found.tables for line in table.lines for cell in line.cells)


def test_a_centre_that_dies_early_is_said_to_have_lost_the_target() -> None:
    kill = "[{kind='kill',part='base',at_s=3}]"
    made = small("run.idle_s=5", f"faults={kill}", fusion__deadline_s=[0.2, 0.4])
    runs = [study_run(made.variants[place].scenario.set("seed", seed)).of(made.variants[place].values)
            for place, seed in made.jobs]  # fmt: skip
    found = choice_of(made, runs)
    assert found is not None
    assert found.tables[0].lost == "0.2, 0.4"
    assert {line.said for line in found.tables[0].lines} == {"–"}


def test_faults_are_named_in_words() -> None:
    kill = {"kind": "kill", "part": "base", "at_s": 3}
    assert titled({"faults": [], "link.extra_loss": 0.2}) == "faults=none, link.extra_loss=0.2"
    assert titled({"faults": [kill, kill | {"part": "tracking"}]}) == (
        "faults=kill part base at_s 3; kill part tracking at_s 3"
    )
    assert titled({"fusion.trackers": ["ekf", "ukf"], "on": True}) == 'fusion.trackers=["ekf", "ukf"], on=true'


def test_nothing_varied_is_no_choice() -> None:
    scenario = load("bus", settings=["target.steps=4"])
    assert choice_of(design(scenario, (1,)), ()) is None


def test_more_of_a_key_that_is_wrong_is_still_an_error(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="extra_loss"):
        small(link__extra_loss=[0, 1.5])
