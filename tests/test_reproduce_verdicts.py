"""``trackfield reproduce``: what figures from many or few runs let it say."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from launcher.reproduce.intervals import Interval, all_of, any_of, median, positive, share, share_of_steps
from launcher.reproduce.papers.zhai import PAPER
from launcher.reproduce.papers.zhai.cases import CASES
from launcher.reproduce.papers.zhai.claims import JUDGES, claims
from launcher.reproduce.papers.zhai.contrasts import TIME, closer, contrasts, ratio, silent, variance
from launcher.reproduce.papers.zhai.tables import tables
from launcher.reproduce.records import Record, Records
from launcher.reproduce.report import markdown
from launcher.reproduce.scores import Field, Results, Score, usual_scores
from launcher.reproduce.tables import READING, UNKNOWN, Row, claims_table, with_interval

DOCS = Path(__file__).parents[1] / "docs"
GOES = {name: [1.0, 1.1, 1.05] for name in PAPER.timed.trackers} if PAPER.timed else {}
GOES["bootstrap"] = [1.6, 1.7, 1.65]


# --- intervals --------------------------------------------------------------------------------------------------------


def test_an_interval_has_the_true_figure_in_it_as_often_as_it_says() -> None:
    """Also with few runs and a skewed distribution: the root of the mean of squares, as errors are pooled."""
    rng, hits = np.random.default_rng(1), 0
    for squares in rng.gamma(2, 1, (1000, 8)):
        found = positive(lambda weights, some=squares: np.sqrt(weights @ some / weights.sum(axis=1)), 8)  # type: ignore[misc]
        hits += found.at_most(np.sqrt(2)) is None
    assert 0.9 < hits / 1000 < 0.98


def test_shares_and_medians_know_how_few_runs_they_come_from() -> None:
    assert share(5, 5)[1:] == pytest.approx((0.478, 1.0), abs=1e-3)  # Clopper and Pearson, by their tables
    assert share(0, 300)[1:] == pytest.approx((0.0, 0.0122), abs=1e-4)
    assert share_of_steps(np.zeros(5))[1:] == pytest.approx((0.0, 0.522), abs=1e-3)
    assert share_of_steps(np.array([0.01, 0.02, 0.03]))[1:] == pytest.approx((0.0, 0.0448), abs=1e-3)  # t = 4.303
    assert median(np.arange(1.0, 6.0)) == (3.0, None, None)
    assert median(np.arange(1.0, 7.0)) == (3.5, 1.0, 6.0)


def test_one_run_tells_nothing() -> None:
    alone = positive(lambda weights: weights @ np.ones(1), 1)
    assert alone == (1.0, None, None)
    assert (alone.at_most(100), alone.above(0)) == (None, None)
    assert with_interval(alone) == "1 [-]"


def test_what_is_open_decides_nothing_and_hides_nothing() -> None:
    assert [all_of(some) for some in ((True, None), (False, None), (True, True))] == [None, False, True]
    assert [any_of(some) for some in ((True, None), (False, None), (False, False))] == [True, None, False]


# --- few runs and many ------------------------------------------------------------------------------------------------


def played(runs: int) -> Records:
    """Runs in which SP-CPF errs 1.5 m or so and the bootstrap mostly, but not always, a lot more."""
    rng = np.random.default_rng(3)
    found: dict[str, list[Record]] = {name: [] for name in CASES}
    for case in CASES.values():
        for _ in range(runs):
            sizes = np.array([np.exp(rng.normal(2, 1.5)) if "bootstrap" in name else 1.0 for name in case.trackers])
            errors = rng.normal(0, 1, (len(sizes), 12, 4)) * sizes[:, None, None]
            reports = np.where(rng.random(12) < 0.02, 0, 4)
            found[case.name].append(Record(errors, reports, np.ones(12), np.ones(4)))
    return found


def concluded(records: Records) -> Results[Score]:
    return Results(
        len(records["s1"]),
        {name: usual_scores(CASES[name], some) for name, some in records.items()},
        {name: Field.of(some) for name, some in records.items()},
        {name: min(some) for name, some in GOES.items()},
        contrasts(records, GOES),
    )


def verdicts(results: Results[Score]) -> dict[str, str]:
    return {claim.name: claim.verdict for claim in claims(results)}


def test_few_runs_do_not_contradict_many() -> None:
    records = played(100)
    of_all = verdicts(concluded(records))
    assert len(set(of_all.values())) > 2
    few = [verdicts(concluded({name: some[at : at + 5] for name, some in records.items()})) for at in range(0, 40, 5)]
    contrary = [(name, one[name]) for one in few for name in one if one[name] not in (UNKNOWN, of_all[name])]
    assert len(contrary) <= 0.05 * sum(map(len, few)), contrary
    assert any(one[name] == UNKNOWN != of_all[name] for one in few for name in one)
    assert any(one[name] == of_all[name] != UNKNOWN for one in few for name in one)


# --- verdicts ---------------------------------------------------------------------------------------------------------


def exact(value: float) -> Interval:
    return Interval(value, value, value)


def agreeing() -> Results[Score]:
    """Results with which the paper would be right throughout, each figure known exactly."""
    good = Score(1, 0.1, 1, 1, 0.1, 1, 1.5, 1.5, 0, 8)
    bad = replace(good, var_x=9, var_y=9, position=40, median_run=6, lost=0.9, largest=300)
    scores = {
        case.name: {name: bad if name in ("bootstrap", "ekf") else good for name in case.trackers}
        for case in CASES.values()
    }
    network = Field(4, 0.0, 0.1, 240, 2400, 0.1, 55, 1.0)
    compared = {
        name: exact(0.9 if name.startswith(tuple(map(closer, CASES))) else 0.5) for name in contrasts(played(2), GOES)
    }
    compared |= {silent("s1-78"): exact(0.0), silent("s1-79"): exact(0.05)}
    return Results(100, scores, dict.fromkeys(CASES, network), {"spcpf": 0.5, "bootstrap": 1.0}, compared)


def with_score(results: Results[Score], case: str, tracker: str, **figures: float) -> Results[Score]:
    scores = {name: dict(some) for name, some in results.scores.items()}
    scores[case][tracker] = replace(scores[case][tracker], **figures)
    return replace(results, scores=scores)


def with_figures(results: Results[Score], **figures: Interval) -> Results[Score]:
    assert figures.keys() <= results.contrasts.keys()
    return replace(results, contrasts={**results.contrasts, **figures})


def test_a_paper_that_is_right_is_said_to_be() -> None:
    assert set(verdicts(agreeing()).values()) == {"holds"}
    assert len(verdicts(agreeing())) == len(JUDGES)


def at_78(path: str, tracker: str) -> str:
    return ratio(f"{path}-78", tracker, path, "spcpf")


BEATS_S2 = ratio("s2", "spcpf", "s2", "bootstrap")
N_10 = ratio("s1", "spcpf-n10", "s1", "spcpf-n40")
TWICE = ratio("s2", "spcpf", "s1", "spcpf")
RADAR = {name: ratio("radar", name, "radar", "ekf") for name in ("spcpf", "spcpf-paper")}


@pytest.mark.parametrize(
    ("claim", "verdict", "figures"),
    [
        ("A tenth", "does not hold", {BEATS_S2: 1.2}),
        ("A tenth", "does not hold", {closer("s1"): 0.4}),
        ("A tenth", "holds in part", {closer("s3-agile"): 0.4}),
        ("10 ≤ N ≤ 20", "does not hold", {N_10: 1.06}),
        ("78 % is the highest", "does not hold", {silent("s1-78"): 0.02}),
        ("78 % is the highest", "does not hold", {silent("s1-79"): 0.0}),
        ("At 78 %", "does not hold", {at_78("s3", "spcpf"): 1.3, at_78("s1", "spcpf-paper"): 1.3}),
        ("At 78 %", "holds", {at_78("s3", "spcpf"): 1.3}),
        ("The error varies", "does not hold", {variance("y"): 1.1}),
        ("Robust", "does not hold", {TWICE: 2.1}),
        ("Cheaper", "does not hold", {TIME: 1.1}),
        ("With a single radar", "does not hold", dict.fromkeys(RADAR.values(), 1.1)),
        ("With a single radar", "holds", {RADAR["spcpf"]: 1.1}),
    ],
)
def test_a_figure_turns_a_verdict(claim: str, verdict: str, figures: dict[str, float]) -> None:
    found = verdicts(with_figures(agreeing(), **{name: exact(value) for name, value in figures.items()}))
    (name,) = [name for name in found if name.startswith(claim)]
    assert found[name] == verdict


@pytest.mark.parametrize(
    ("claim", "verdict", "figures"),
    [
        ("A tenth", UNKNOWN, {BEATS_S2: (0.5, 1.5)}),
        ("A tenth", UNKNOWN, {BEATS_S2: (0.5, 1.5), closer("s3-agile"): (0.1, 0.2)}),
        ("A tenth", UNKNOWN, {closer("s3-agile"): (0.2, 0.9)}),
        ("A tenth", "does not hold", {BEATS_S2: (1.1, 1.5), closer("s3-agile"): (0.2, 0.9)}),
        ("10 ≤ N ≤ 20", UNKNOWN, {N_10: (1.0, 1.1)}),
        ("78 % is the highest", UNKNOWN, {silent("s1-78"): (0.0, 0.5)}),
        ("At 78 %", UNKNOWN, {at_78("s3", "spcpf"): (1.1, 1.4), at_78("s1", "spcpf-paper"): (1.3, 1.5)}),
        ("At 78 %", "holds", {at_78("s3", "spcpf"): (1.1, 1.4)}),
        ("The error varies", UNKNOWN, {variance("x"): (0.5, 1.1)}),
        ("Robust", UNKNOWN, {TWICE: (1.9, 2.1)}),
        ("Cheaper", UNKNOWN, {TIME: (0.9, 1.1)}),
        ("With a single radar", UNKNOWN, dict.fromkeys(RADAR.values(), (0.9, 1.1))),
    ],
)
def test_a_limit_inside_of_an_interval_leaves_a_verdict_open(
    claim: str, verdict: str, figures: dict[str, tuple[float, float]]
) -> None:
    wide = {name: Interval(sum(ends) / 2, *ends) for name, ends in figures.items()}
    found = verdicts(with_figures(agreeing(), **wide))
    (name,) = [name for name in found if name.startswith(claim)]
    assert found[name] == verdict


@pytest.mark.parametrize(
    ("lost", "ends", "robust", "loses"),
    [
        (0.06, None, "does not hold", "does not hold"),
        (0.0, (0.0, 0.52), UNKNOWN, "does not hold"),
        (0.0, (0.0, 0.04), "holds", "does not hold"),
        (0.9, (0.5, 1.0), "does not hold", UNKNOWN),
    ],
)
def test_lost_runs_are_judged_by_their_interval(
    lost: float, ends: tuple[float, float] | None, robust: str, loses: str
) -> None:
    figures = {"lost": lost, "ends": {} if ends is None else {"lost": ends}}
    results = agreeing()
    for tracker in ("spcpf", "bootstrap"):
        results = with_score(results, "s3", tracker, **figures)  # type: ignore[arg-type]
    found = verdicts(results)
    assert (found["Robust to the wrong model"], found["The bootstrap loses manoeuvring targets"]) == (robust, loses)


def rows(results: Results[Score], table: str, tracker: str) -> list[Row]:
    return [row for row in tables(results)[table] if row.tracker == tracker]


def test_rows_are_judged_by_their_bands() -> None:
    results = agreeing()
    assert [row.verdict for row in rows(results, "scenarios", "spcpf")] == ["in band"] * 3
    worse = with_score(results, "s2", "spcpf", lost=0.06)
    assert [row.verdict for row in rows(worse, "scenarios", "spcpf")] == ["in band", "outside", "in band"]
    few = with_score(results, "s2", "spcpf", ends={"position": (1.4, 3.5)})  # type: ignore[arg-type]
    assert [row.verdict for row in rows(few, "scenarios", "spcpf")] == ["in band", UNKNOWN, "in band"]
    first = rows(with_score(results, "s1", "spcpf", mean_x=1.909), "table I", "spcpf")[0]
    assert (first.published, first.ratio, first.verdict) == (1.909, exact(1.0), "as published")
    assert rows(results, "table I", "spcpf")[0].verdict == "lower"
    assert rows(results, "scenarios", "spcpf")[0].to_bound == 1.5


def test_tables_show_intervals() -> None:
    text = markdown(PAPER, with_score(agreeing(), "s2", "spcpf", ends={"position": (1.4, 3.5)}))  # type: ignore[arg-type]
    assert READING in text
    assert "| 1.5 [1.4, 3.5] " in text


# --- what the docs say ------------------------------------------------------------------------------------------------


def results_of_docs() -> Results[Score]:
    return Results.of_plain(json.loads((DOCS / "papers-zhai" / "results.json").read_text()), Score)


def test_the_docs_say_what_was_found() -> None:
    said, results = (DOCS / "papers.md").read_text(), results_of_docs()
    assert claims_table(claims(results)) in said
    assert f"trackfield reproduce zhai --runs {results.runs}\n" in said
    for part in markdown(PAPER, results).split("\n\n"):
        assert part.startswith("#") or part.strip() in said
