"""Table 1 of Yang et al. with roles: passes of a run, what the base is told of them, and what is said of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from launcher.plan.plan import make_plan
from launcher.reproduce.kernels.study import Figures, Found
from launcher.reproduce.papers.yang.figures.runs import fig12
from launcher.reproduce.papers.yang.published import FIELD
from launcher.reproduce.papers.yang.scores import KINDS, mean_error
from launcher.reproduce.papers.yang.trials.field import MPH, SPEED, Setup
from launcher.reproduce.papers.yang.whole.roles import ARGMAX, DIRECTIONS, FIT, TABLE_1, UNTOLD, WAYS
from launcher.reproduce.papers.yang.whole.runs import SCENARIO, TRACKERS, passes_of, run
from launcher.reproduce.papers.yang.whole.tables import TITLES, claims, parts, tables, way_errors
from trackfield.scenario import Scenario


@pytest.fixture(scope="module")
def modelled() -> Figures:
    """Two runs whose sensors have the noise model: they are much faster than those with sound."""
    return run({"sensor.waveform": False}, [1, 2])


def test_the_passes_of_a_run_are_those_of_the_paper() -> None:
    plan = make_plan(Scenario.load(SCENARIO), run="yang")
    places = np.array([(place.x, place.y) for place in plan.info.places if place.id.startswith("n")])
    assert places == pytest.approx(Setup().places, abs=0.01)
    passes = passes_of(plan, places)
    assert len(passes) == len(DIRECTIONS)
    headings = [np.degrees(np.arctan2(one.truth[2], one.truth[3])) % 360 for one in passes]
    assert headings == pytest.approx([87.0, 267.0, 128.0, 308.0], abs=0.1)
    for one in passes:
        assert np.hypot(*one.truth[2:]) == pytest.approx(SPEED, rel=1e-3)
        assert one.from_s < one.last_s < one.until_s
        away = one.truth[:2] - places.mean(axis=0)
        assert away @ one.truth[2:] == pytest.approx(0.0, abs=1e-6)


def test_the_base_is_told_of_every_pass(modelled: Figures) -> None:
    for name in TRACKERS:
        assert modelled[f"location {name}"].shape == (2, len(DIRECTIONS))
        assert np.nanmax(modelled[f"location {name}"]) < 6.0
        assert (modelled[f"reports {name}"] <= 5).all()
    assert np.isfinite(modelled["location ml"]).mean() >= 0.75
    delay = modelled["delay ml"][np.isfinite(modelled["delay ml"])]
    assert delay.min() > 1.0  # a second of audio is heard after the peak
    assert delay.max() < 4.0
    assert (modelled["data"] >= 5).all()
    assert (modelled["frames"] >= modelled["data"] + modelled["interests"]).all()


def test_the_field_table_has_the_means_of_the_paper() -> None:
    """Of Table 1: 1.78 m, 3.25 mph, 5.375 degrees."""
    location, speed, heading = (np.mean([run[column] for run in TABLE_1]) for column in (1, 2, 3))
    assert (location, speed * MPH, heading) == pytest.approx(FIELD, abs=0.003)
    assert (speed, heading) == (3.25, 5.375)
    assert {run.direction for run in TABLE_1} == set(DIRECTIONS)


def test_what_is_said_of_runs(modelled: Figures, tmp_path: Path) -> None:
    found = Found(2, dict.fromkeys((ARGMAX, FIT, UNTOLD), modelled))
    assert [title for title, _ in parts(found)] == list(TITLES.values())
    assert parts(Found(2, {})) == [] and claims(Found(2, {})) == []
    assert {row.case for row in tables(found)["roles"]} == set(WAYS)
    text = dict(parts(found))[TITLES["table 1"]]
    assert text.count("\n") == 1 + len(TABLE_1)
    location = way_errors(found, "fit + ml", "location")
    assert f"{location[0, 0]:.3g} / " in text.splitlines()[2] and f"{location[1, 0]:.3g} / " in text.splitlines()[3]
    nowhere = Found(2, dict.fromkeys((ARGMAX, FIT, UNTOLD), modelled | {"location ml": np.full((2, 4), np.nan)}))
    assert dict(parts(nowhere))[TITLES["table 1"]].count("no fix") == len(TABLE_1)
    fig12(found).savefig(tmp_path / "fig12.png")
    assert (tmp_path / "fig12.png").exists()


@pytest.mark.parametrize(("factor", "told"), [(0.5, ["holds", "holds"]), (30.0, ["does not hold", "does not hold"])])
def test_verdicts_follow_the_figures(modelled: Figures, factor: float, told: list[str]) -> None:
    spread = 0.9 + 0.2 * np.random.default_rng(2).random((40, 4))
    limits = dict(zip(KINDS, (0.6, 0.15, np.radians(1.0)), strict=True))
    figures = {f"{kind} {name}": factor * limits[kind] * spread for kind in KINDS for name in TRACKERS}
    found = Found(40, dict.fromkeys((ARGMAX, FIT, UNTOLD), modelled | figures))
    assert mean_error(way_errors(found, "fit + ml", "heading")).value == pytest.approx(factor, rel=0.05)
    assert [claim.verdict for claim in claims(found)] == told
