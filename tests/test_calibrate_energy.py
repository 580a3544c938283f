"""``calibrate energy``: the kind of sensing fitted to passes that the emulator drew."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Final

import numpy as np
import pytest
from scipy.optimize import approx_fprime
from scipy.stats import binom

from launcher.calibrate.energy import _Fitting, calibrate_energy
from launcher.calibrate.reports import reports_of
from tests.command_line import Call, trackfield
from tests.emulated_reports import places_of, walk, written
from tests.links import SURE
from trackfield.draw import normal, uniform
from trackfield.sensing.complete import Kind
from trackfield.sensing.energy import Energy

__all__ = ["trackfield"]

RANGES: Final = {
    "emitted": (2e3, 6e4),
    "alpha": (1.7, 2.7),
    "noise": (0.3, 1.3),
    "relative": (0.1, 0.3),
    "missing": (0.0, 0.3),
}
WIDEST: Final = {"emitted": 2.0, "alpha": 1.1, "noise": 1.3, "relative": 1.5}
"""No interval reaches so many times its figure: they are of use."""
SENSORS: Final = 14
SIDE_M: Final = 150.0
SEEDS: Final = range(12)


def truth_of(seed: int) -> dict[str, float]:
    """Drawn from its seed; what is emitted evenly by its logarithm."""
    found = {key: low + (high - low) * uniform(seed, "truth", key) for key, (low, high) in RANGES.items()}
    low, high = RANGES["emitted"]
    return found | {"emitted": low * (high / low) ** uniform(seed, "truth", "emitted")}


def gains_of(seed: int) -> dict[str, float]:
    """1 in the geometric mean, as those that are fitted."""
    logs = np.array([0.3 * normal(seed, "gain", i) for i in range(SENSORS)])
    return {f"s{i}": float(one) for i, one in enumerate(np.exp(logs - logs.mean()))}


def drawn(folder: Path, seed: int, truth: dict[str, float]) -> tuple[Path, Path]:
    kind = Kind("energy", Energy(range_m=1000.0, gains=gains_of(seed), **truth))
    (file,), sensors = written(folder, kind, places_of(SENSORS, SIDE_M, seed), [walk(seed, SIDE_M, 100.0)], 1.0, seed)
    return file, sensors


def test_known_kinds_are_fitted_back(tmp_path: Path) -> None:
    """Of intervals of 95 %, those that miss are binomial; an interval that is always wide enough says nothing."""
    missed, of_gains, far = dict.fromkeys(RANGES, 0), 0, []
    for seed in SEEDS:
        truth, own = truth_of(seed), gains_of(seed)
        fit = calibrate_energy(*drawn(tmp_path / str(seed), seed, truth))
        assert fit.left.keys() - {"noise", "relative"} == {"range_m", "emitted_sd", "emitted_walk"}
        for key, (value, low, high) in fit.fitted.items():
            assert low < value < high
            missed[key] += not low <= truth[key] <= high
            far += [(seed, key)] if high > WIDEST.get(key, np.inf) * value else []
        of_gains += sum(not one.low <= own[id] <= one.high for id, one in fit.own[1].items())
    assert all(count <= binom(len(SEEDS), 0.05).isf(SURE) for count in missed.values()), missed
    assert sum(missed.values()) <= binom(len(SEEDS) * len(RANGES), 0.05).isf(SURE), missed
    assert of_gains <= binom(len(SEEDS) * SENSORS, 0.05).isf(SURE)
    assert not far


def test_a_reading_that_no_target_gives_is_left_out_and_told(tmp_path: Path) -> None:
    file, sensors = drawn(tmp_path / "pass", 4, truth_of(4))
    rows = file.read_text().splitlines(keepends=True)
    t_s, id, _, x, y = rows[300].split(",")
    found = []
    for line in ("", f"{t_s},{id},1e9,{x},{y}"):
        file.write_text("".join([*rows[:300], line, *rows[301:]]))
        found.append(calibrate_energy(file, sensors))
    clean, cleaned = found
    assert cleaned.notes[1].startswith(f"1 report is left out, more than 6 standard deviations off: 1e+09 of {id} at")
    for key, one in clean.fitted.items():
        assert cleaned.fitted[key] == pytest.approx(one, rel=1e-3)


def test_emitted_and_the_mean_gain_are_one(tmp_path: Path) -> None:
    """Twice the gain of all sensors is twice as much that is emitted, and twice the noise."""
    truth = truth_of(1) | {"missing": 0.0}
    file, sensors = drawn(tmp_path / "pass", 1, truth)
    once = calibrate_energy(file, sensors)
    head, *lines = file.read_text().splitlines()
    doubled = [line.split(",") for line in lines]
    file.write_text("\n".join([head, *(",".join([t, s, str(2 * float(v)), *xy]) for t, s, v, *xy in doubled)]) + "\n")
    twice = calibrate_energy(file, sensors)
    for key, factor in (("emitted", 2.0), ("noise", 2.0), ("alpha", 1.0), ("relative", 1.0)):
        assert twice.fitted[key].value == pytest.approx(factor * once.fitted[key].value, rel=1e-3)
    gains = [one.value for one in twice.own[1].values()]
    assert np.exp(np.mean(np.log(gains))) == pytest.approx(1.0)
    assert gains == pytest.approx([one.value for one in once.own[1].values()], rel=1e-3)


def test_noise_that_does_not_show_is_left(tmp_path: Path) -> None:
    exact = calibrate_energy(*drawn(tmp_path / "exact", 2, truth_of(2) | {"relative": 0.0}))
    assert exact.left["relative"].startswith("cannot be told from 0 beside the other noise; about ")
    assert "noise" in exact.fitted


def test_the_slope_of_the_likelihood_is_its_own(tmp_path: Path) -> None:
    fitting = _Fitting(reports_of([(of := drawn(tmp_path / "pass", 3, truth_of(3)))[0]], of[1]))
    some = np.arange(len(fitting.residual())) % 3 > 0
    at = fitting._start(1.5, 2.0, 0.2)
    _, slope = fitting._unlikely(some, at)
    measured = approx_fprime(at, lambda one: fitting._unlikely(some, one)[0], 1e-7)
    assert slope == pytest.approx(measured, rel=1e-3, abs=1e-3 * np.abs(slope).max())


def test_residuals_are_as_many_standard_deviations(tmp_path: Path) -> None:
    fit = calibrate_energy(*drawn(tmp_path / "pass", 4, truth_of(4)))
    assert fit.residual.std() == pytest.approx(1.0, abs=0.1)
    assert abs(fit.residual.mean()) < 0.1


# --- the command ---


@pytest.mark.rendered
def test_a_fragment_and_a_picture(trackfield: Call, tmp_path: Path) -> None:
    file, sensors = drawn(tmp_path / "pass", 5, truth_of(5))
    said = trackfield("calibrate", "energy", file, "--sensors", sensors, "--out", "e.toml", "--picture", "e.png")
    assert said.code == 0, said.err
    text, fit = (tmp_path / "e.toml").read_text(), calibrate_energy(file, sensors)
    section = tomllib.loads(text)["sensor"]
    assert section.pop("gains") == {id: float(f"{one.value:.4g}") for id, one in fit.own[1].items()}
    assert section == fit.section
    assert section["gain"] == 1.0
    assert "gains are 1 in the geometric mean" in text
    assert (tmp_path / "e.png").read_bytes().startswith(b"\x89PNG")


def test_passes_that_cannot_be_used(trackfield: Call, tmp_path: Path) -> None:
    file, sensors = drawn(tmp_path / "pass", 6, truth_of(6))
    text = file.read_text()
    silent = "\n".join(",".join([*line.split(",")[:2], "-0.5", *line.split(",")[3:]]) for line in text.splitlines()[1:])
    cases = {
        f"{text.splitlines()[0]}\n{silent}\n": "no report is above 0, the greatest is -0.5; expected energies of a",
        text.replace(",s3,", ",x3,"): "has reports of 'x3', whose place is not in sensors.csv",
        "".join(text.splitlines(keepends=True)[:300]): "expected at least 40",
        "": "is empty",
    }
    for content, message in cases.items():
        file.write_text(content)
        said = trackfield("calibrate", "energy", file, "--sensors", sensors)
        assert said.code == 2
        assert message in said.err
        assert said.err.count("\n") == 1
