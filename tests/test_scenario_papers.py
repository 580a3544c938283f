"""The packaged fields of Zhou et al. and Yu et al.: the setups of their studies, and the commands for others."""

from __future__ import annotations

import re
import shlex
import tomllib
from math import cos, hypot, log, radians, sin
from typing import Any

import numpy as np
import pytest

from launcher.reproduce.papers.yu import experiments, truth
from launcher.reproduce.papers.zhou import setups
from trackfield.filters.trackers import make_tracker
from trackfield.scenario import Scenario, survey
from trackfield.scenario.packaged import packaged_file


def commands(name: str) -> dict[str, dict[str, Any]]:
    """What each command in the comments of a packaged file sets, by the first word of the line above it."""
    text = re.sub(r" \\\n# +", " ", packaged_file(name).read_text())
    found = {}
    for what, command in re.findall(r"^# (\w+).*\n# +(trackfield run .*)$", text, flags=re.MULTILINE):
        words = shlex.split(command)
        assert words[:3] == ["trackfield", "run", name]
        assert words[3::2] == ["--set"] * len(words[3::2])
        found[what] = dict(one.split("=", 1) for one in words[4::2])
    return {what: {key: _value(value) for key, value in one.items()} for what, one in found.items()}


def _value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


ZHOU = {"walk": ({}, setups.WALK)} | {
    what: (commands("zhou-upf")[what], setup)
    for what, setup in {
        "sharp": setups.SHARP,
        "paperlike": setups.PAPERLIKE,
        "linear": setups.LINEAR,
        "rss": setups.RSS["rss 4 dB"],
    }.items()
}


@pytest.mark.parametrize("name", ZHOU)
def test_the_setups_of_zhou_are_those_of_their_study(name: str) -> None:
    changes, setup = ZHOU[name]
    scenario = Scenario.load("zhou-upf", changes)
    target, field, sensor, fusion = scenario.target, scenario.field, scenario.sensor, scenario.fusion
    assert (field.layout, field.spacing_m, field.within_m) == ("cells", setup.cell_m, 2 * setup.sense_m)
    assert (sensor.kind, sensor.range_m) == (setup.kind, setup.sense_m)
    options = {} if setup.kind == "range" else {"level_dbm": -40.0, "exponent": 3.0, "floor_m": 0.1}
    noise = {"floor_sd_m": setup.noise, "growth_m": 0.0} if setup.kind == "range" else {"shadow_sd_db": setup.noise}
    assert {key: sensor.options[key] for key in {**options, **noise}} == {**options, **noise}
    true_q = setup.q if setup.true_q is None else setup.true_q
    assert (target.q, target.held) == (pytest.approx(true_q**2), True)
    velocity = [target.speed_m_s * f(radians(target.heading_deg)) for f in (sin, cos)]
    assert [*target.start_m, *velocity] == pytest.approx(setups.X0, abs=1e-6)
    assert (target.start_sd, fusion.prior_sd) == (setup.prior_sd, setup.prior_sd)
    assert (scenario.steps, scenario.step_s, fusion.sigma_v) == (setup.steps, setups.DT, setup.q)
    lost = scenario.score.lost
    assert (lost.beyond_m, lost.steps, lost.within, fusion.lost_m) == (setup.sense_m, 1, setups.WITHIN, setup.sense_m)


@pytest.mark.parametrize("name", ["walk", "sharp", "paperlike"])
def test_enough_nodes_sense_the_target_at_each_step(name: str) -> None:
    """A disc of two cells' radius has four whole cells at least, and the area of 4 pi; mean of 250 or more steps.

    The number in a disc has an sd of about 1.7, and changes within a few steps: the mean of all is within 0.5.
    """
    changes, setup = ZHOU[name]
    numbers = []
    for seed in range(1, 6):
        site = survey(Scenario.load("zhou-upf", {**changes, "seed": seed}))
        places = np.array([place[1:] for place in site.sensors])
        for step in range(site.steps + 1):
            here = site.paths["target"].at(float(step) * site.step_ns / 1e9)
            assert here is not None
            numbers.append(int((np.hypot(*(places - here[:2]).T) <= setup.sense_m).sum()))
    assert min(numbers) >= 4
    assert np.mean(numbers) == pytest.approx(4 * np.pi, abs=0.5)


def test_the_field_of_yu_is_that_of_their_study() -> None:
    scenario = Scenario.load("yu-mrbpf")
    target, sensor = scenario.target, scenario.sensor
    kind = truth.Field(compensate=True).kind
    assert dict(sensor.options) == {key: getattr(kind, key) for key in sensor.options}
    velocity = [target.speed_m_s * f(radians(target.heading_deg)) for f in (sin, cos)]
    assert [*target.start_m, *velocity] == pytest.approx(truth.START, abs=1e-6)
    assert (target.q, target.held, target.turns) == (truth.NOISE, False, truth.TURNS)
    assert (scenario.steps, scenario.step_s) == (truth.STEPS, truth.T)
    assert (*scenario.fusion.prior_sd, sensor.emitted_sd) == pytest.approx(truth.PRIOR_SD)
    lost, rule = scenario.score.lost, experiments.RULE
    assert (lost.beyond_m, lost.steps, lost.within) == (rule.beyond_m, rule.steps, rule.within)
    places = np.array([place[1:] for place in survey(scenario).sensors])
    assert places.shape == (truth.SENSORS, 2)
    assert places.min() >= 0.0
    assert places.max() <= truth.SIZE_M + 0.001
    assert places.max() > 0.95 * truth.SIZE_M


@pytest.mark.parametrize("name", ["jm-rbpf", "mrbpf", "rbpf"])
def test_the_trackers_of_yu_are_those_of_their_study(name: str) -> None:
    fusion = Scenario.load("yu-mrbpf").plain()["fusion"]
    assert make_tracker(name, fusion["options"][name]) == experiments.CASES[name].tracker


def test_the_commands_for_other_fields_of_yu_are_right() -> None:
    found = commands("yu-mrbpf")
    assert found.keys() == {"Rates", "Sound"}
    unknown = Scenario.load("yu-mrbpf", found["Rates"]).plain()["fusion"]
    expected = experiments.CASES["jm-rbpf, unknown rate"].tracker
    made = make_tracker("jm-rbpf", unknown["options"]["jm-rbpf"])
    assert (made.turns.most, made.particles, made.q, made.silent) == (
        expected.turns.most, expected.particles, expected.q, expected.silent,
    )  # fmt: skip
    late = Scenario.load("yu-mrbpf", found["Sound"]).sensor
    assert (late.window_s, late.sound_m_s) == (experiments.WINDOW_S, truth.SOUND_M_S)
    assert log(late.emitted) == pytest.approx(log(truth.Field().kind.emitted))
    assert hypot(5.0, 5.0) == pytest.approx(Scenario.load("yu-mrbpf").target.speed_m_s)
