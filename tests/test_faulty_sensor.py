"""The default tracker with one faulty sensor in the middle of the field, eight runs of each target."""

from __future__ import annotations

import numpy as np
import pytest

from tests.faulty_field import FAULTY, KINDS, errors, spoilt
from tests.zhai_field import SCENARIOS, THRESHOLD_DB, hear
from trackfield.filters.metrics import rmse

RUNS = 8


@pytest.mark.parametrize("scenario", list(SCENARIOS))
@pytest.mark.parametrize("kind", KINDS)
def test_one_faulty_sensor_neither_loses_nor_spoils_the_track(kind, scenario):
    """A second's lie is the smallest and the hardest to tell from the target: it costs most."""
    sound, faulty = errors(scenario, "none", RUNS), errors(scenario, kind, RUNS)
    assert np.isfinite(faulty).all()
    assert np.linalg.norm(faulty[:, -1], axis=-1).max() < 10.0
    assert rmse(faulty) < rmse(sound) + {"clock_jump": 1.1, "bias": 1.0}.get(kind, 0.2)


@pytest.mark.parametrize("kind", ["stuck", "babble"])
def test_it_is_the_gate_that_holds_the_track(kind):
    without = errors("s1", kind, RUNS, gate=False)
    assert rmse(without[np.isfinite(without[..., 0])]) > 5.0 * rmse(errors("s1", kind, RUNS))


def test_without_faults_the_gate_costs_next_to_nothing():
    for scenario in SCENARIOS:
        gated, plain = (errors(scenario, "none", RUNS, gate=gate) for gate in (True, False))
        assert rmse(gated) < 1.03 * rmse(plain)


def test_faults_are_what_they_are_called():
    truth = SCENARIOS["s1"](np.random.default_rng(0))
    heard = [hear(target[:2], np.random.default_rng(1), step=step) for step, target in enumerate(truth[1:], start=1)]
    name = f"n{FAULTY:03d}"

    def of_the_faulty(kind):
        spoilt_reports = spoilt(kind, heard, FAULTY, np.random.default_rng(2))
        others = [[id for id in reports.sensors if id != name] for reports in spoilt_reports]
        assert others == [[id for id in reports.sensors if id != name] for reports in heard]
        found = {}
        for step, reports in enumerate(spoilt_reports):
            if name in reports.sensors:
                k = reports.sensors.index(name)
                found[step] = (float(reports.bearings[k]), float(reports.levels[k]))
        return found

    true = {
        step: (float(reports.bearings[k]), float(reports.levels[k]))
        for step, reports in enumerate(heard)
        if name in reports.sensors
        for k in [reports.sensors.index(name)]
    }
    assert 10 < len(true) < len(heard)
    assert of_the_faulty("deaf") == {}
    assert of_the_faulty("clock_jump") == {step + 1: reading for step, reading in true.items()}
    assert of_the_faulty("bias") == {step: (b + np.radians(20.0), level) for step, (b, level) in true.items()}
    stuck, babble = of_the_faulty("stuck"), of_the_faulty("babble")
    assert len(stuck) == len(babble) == len(heard)
    assert len(set(stuck.values())) == 1
    assert len({bearing for bearing, _ in babble.values()}) == len(heard)
    assert all(THRESHOLD_DB <= level <= THRESHOLD_DB + 10.0 for _, level in babble.values())
