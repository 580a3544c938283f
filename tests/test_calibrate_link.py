"""``calibrate link``: models fitted to recordings of fields that are known."""

from __future__ import annotations

import gzip
import tomllib
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from scipy.stats import binom, norm

from launcher.calibrate.fading import asymmetry_db
from launcher.calibrate.link import KEYS, PATH_LOSS, Fit, fitted
from launcher.calibrate.losses import curve
from launcher.calibrate.samples import samples_of
from tests.command_line import Call, trackfield
from tests.links import SURE
from tests.recorded import Schedule, recorded
from trackfield.draw import uniform
from trackfield.link.k7 import parse_k7
from trackfield.link.places import Point
from trackfield.link.reception import cc2420
from trackfield.scenario import Scenario

__all__ = ["trackfield"]

RANGES: Final = {
    "pl0_db": (35.0, 60.0),
    "exponent": (2.0, 3.5),
    "sigma_db": (2.0, 8.0),
    "asymmetry_db": (0.3, 3.0),
    "noise_dbm": (-105.0, -90.0),
    "burst_loss": (0.05, 0.3),
}
SHORT: Final = Schedule(rounds=4, channels=4)
NODES: Final = 24
RADIO: Final = {"model": "lognormal_prr", "radio": "802154-0dbm"}
WIDEST: Final = {"exponent": 0.7, "sigma_db": 1.5, "asymmetry_db": 0.6, "noise_dbm": 0.3, "burst_loss": 0.1}
"""No interval reaches farther from its figure: they are of use."""


def truth_of(seed: int) -> dict[str, float]:
    """A model drawn from its seed: bursts last from 0.1 to 30 s."""
    truth = {key: low + (high - low) * uniform(seed, "truth", key) for key, (low, high) in RANGES.items()}
    return truth | {"burst_s": 10 ** (-1 + 2.5 * uniform(seed, "truth", "burst_s"))}


def places_of(truth: dict[str, float], seed: int, nodes: int = NODES) -> dict[str, Point]:
    """A square in which some hear each other well, some at times, some never."""
    reach = 10 ** ((-truth["noise_dbm"] - 2 - truth["pl0_db"]) / 10 / truth["exponent"])
    return {str(i): (1.5 * reach * uniform(seed, "x", i), 1.5 * reach * uniform(seed, "y", i)) for i in range(nodes)}


def text_of(truth: dict[str, Any], places: dict[str, Point], seed: int, schedule: Schedule = SHORT) -> str:
    return recorded({**RADIO, **truth}, places, seed, schedule)


def fit_of(truth: dict[str, Any], seed: int, *, placed: bool = True) -> Fit:
    places = places_of(truth, seed)
    return fitted(parse_k7(text_of(truth, places, seed), "x"), places if placed else None, 0.0, "x")


def test_known_models_are_fitted_back() -> None:
    """Of intervals of 95 %, those that miss are binomial; an interval that is always wide enough says nothing."""
    seeds, missed, far = range(9), dict.fromkeys(KEYS, 0), []
    for seed in seeds:
        truth = truth_of(seed)
        fit = fit_of(truth, seed)
        assert fit.fitted.keys() == set(KEYS)
        assert not fit.left
        for key, (value, low, high) in fit.fitted.items():
            assert low < value < high
            missed[key] += not low <= truth[key] <= high
            far += [(seed, key)] if value - low > WIDEST.get(key, np.inf) else []
    assert sum(missed.values()) <= binom(len(seeds) * len(KEYS), 0.05).isf(SURE), missed
    assert all(count <= binom(len(seeds), 0.05).isf(SURE) for count in missed.values()), missed
    assert not far


def test_without_places_the_rest_is_the_same() -> None:
    truth = truth_of(3)
    placed, bare = fit_of(truth, 3), fit_of(truth, 3, placed=False)
    assert {key: value for key, value in placed.fitted.items() if key not in PATH_LOSS} == bare.fitted
    assert bare.left.keys() == set(PATH_LOSS)
    assert all("--places" in why for why in bare.left.values())


def test_no_bursts_are_found_where_there_are_none() -> None:
    truth = {key: value for key, value in truth_of(5).items() if not key.startswith("burst")}
    fit = fit_of(truth, 5)
    assert {key for key in fit.left if "no bursts found" in fit.left[key]} == {"burst_loss", "burst_s"}
    assert fit.fitted.keys() == set(KEYS) - {"burst_loss", "burst_s"}


def test_bursts_longer_than_the_recording_are_not_told() -> None:
    fit = fit_of(truth_of(7) | {"burst_loss": 0.2, "burst_s": 40_000.0}, 7)
    assert {"burst_loss", "burst_s"} <= fit.left.keys()


def test_what_is_lost_on_a_channel_all_the_time_is_no_burst() -> None:
    """Half of the links lose a third of their frames on two of four channels; whatever else is lost, in bursts."""
    truth = truth_of(2) | {"burst_loss": 0.1, "burst_s": 5.0}
    recording = parse_k7(text_of(truth, places_of(truth, 2), 2), "x")
    rng = np.random.default_rng(2)
    for src, bursts in recording.bursts.items():
        for burst in bursts:
            for dst, heard in burst.heard.items():
                if burst.channel < 13 and uniform(2, "channel", src, dst) < 0.5:
                    got = rng.binomial(round(heard.pdr * burst.frames), 2 / 3)
                    burst.heard[dst] = heard._replace(pdr=got / burst.frames)
    fit = fitted(recording, None, 0.0, "x")
    assert fit.fitted["burst_loss"].value > 0.13  # all that is lost
    assert fit.fitted["burst_s"].value < 5


@pytest.mark.parametrize("sd", [0.5, 2.0])
def test_asymmetry_of_pairs_near_the_threshold_is_not_underestimated(sd: float) -> None:
    """Pairs of which one direction is too weak are not there: the plain sd is too small by a sixth or more."""
    rng = np.random.default_rng(1)
    there, back = -100 + rng.exponential(sd, 60_000) + rng.normal(0, sd, (2, 60_000))
    seen = (there > -100) & (back > -100)
    plain = float(np.std((there - back)[seen]) / np.sqrt(2))
    assert plain < 0.85 * sd
    assert asymmetry_db(there[seen], back[seen], -100.0) == pytest.approx(sd, rel=4 * norm.isf(SURE) / 60_000**0.5)


def test_the_curve_is_the_radios() -> None:
    snr = np.linspace(-5, 10, 301)
    assert curve(snr, 106) == pytest.approx([cc2420(float(one), 106) for one in snr], abs=1e-5)


def test_receivers_that_hear_nobody_for_long_are_off() -> None:
    truth = {key: value for key, value in truth_of(5).items() if not key.startswith("burst")}
    recording = parse_k7(text_of(truth, places_of(truth, 5), 5), "x")
    whole = samples_of(recording)
    for bursts in recording.bursts.values():
        for burst in bursts:
            if burst.at_s > 0.2 * recording.end_s:
                burst.heard.pop("3", None)
    part = samples_of(recording)
    assert set(zip(whole.src, whole.dst, strict=True)) == set(zip(part.src, part.dst, strict=True))
    lost = whole.dst == whole.nodes.index("3")
    assert part.at_s[part.dst == part.nodes.index("3")].max() < 0.25 * recording.end_s < whole.at_s[lost].max()
    assert part.links.pdr == pytest.approx(whole.links.pdr, abs=0.2)


# --- the command ---


def written(folder: Path, seed: int = 4) -> tuple[Path, Path]:
    truth = truth_of(seed)
    places = places_of(truth, seed)
    (folder / "field.k7.gz").write_bytes(gzip.compress(text_of(truth, places, seed).encode()))
    rows = "".join(f"{id},{x},{y}\n" for id, (x, y) in places.items())
    (folder / "places.csv").write_text(f"id,x,y\n{rows}")
    return folder / "field.k7.gz", folder / "places.csv"


def test_a_fragment_is_a_section_of_a_scenario(trackfield: Call, tmp_path: Path) -> None:
    """What is written is what was fitted, and a scenario takes it."""
    recording, places = written(tmp_path)
    said = trackfield("calibrate", "link", recording, "--places", places, "--out", tmp_path / "link.toml")
    assert said.code == 0, said.err
    text = (tmp_path / "link.toml").read_text()
    points = {str(i): place for i, place in enumerate(places_of(truth_of(4), 4).values())}
    fit = fitted(parse_k7(gzip.decompress(recording.read_bytes()).decode(), "x"), points, 0.0, "x")
    assert tomllib.loads(text) == {"link": fit.section}
    assert all(f"{fit.fitted[key].low:.4g} to {fit.fitted[key].high:.4g}" in text for key in KEYS)
    scenario = tmp_path / "field.toml"
    scenario.write_text(f'name = "field"\n{text}[target]\npath = "s1"\n')
    link = Scenario.load(scenario).link
    assert link.model_dump(exclude_unset=True) == fit.section


def test_a_fragment_is_printed_and_repeatable(trackfield: Call, tmp_path: Path) -> None:
    recording, _ = written(tmp_path)
    once, again = (trackfield("calibrate", "link", recording, "--tx-dbm", 3) for _ in range(2))
    assert once.code == 0
    assert once.out == again.out
    link = tomllib.loads(once.out)["link"]
    assert link["tx_dbm"] == 3.0
    assert "# pl0_db = ..." in once.out
    assert "--places" in once.out


HEAD: Final = '{"tx_length": 100, "interframe_duration": 100}'
COLUMNS: Final = "datetime,src,dst,channel,mean_rssi,pdr,tx_count"
LINE: Final = "2018-01-11T16:32:20.0,0,1,11,-69.9,0.8,100"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is not in k7 form"),
        (b"src,dst,t_s,received,delay_ms\n", "is not in k7 form"),
        (f"{HEAD}\n{COLUMNS}\n".encode(), "has no lines after its header"),
        (f"{HEAD}\n{COLUMNS}\n{LINE.replace('0.8', 'nan')}\n".encode(), ":3: pdr: nan is not a number from 0 to 1"),
        (f"{HEAD}\n{COLUMNS}\n{LINE.replace('0.8', '1.01')}\n".encode(), ":3: pdr: 1.01 is not a number from 0 to 1"),
        (f"{HEAD}\n{COLUMNS}\n{LINE.replace('-69.9', 'nan')}\n".encode(), ":3: mean_rssi: nan is not a number"),
        (f"{HEAD}\n{COLUMNS}\n{LINE}\n".encode(), "only 0 pairs of nodes hear each other; expected at least 10"),
        (gzip.compress(f"{HEAD}\n{COLUMNS}\n{LINE}\n".encode())[:-9], "is cut off"),
        (b"\xff\xfe", "is not text in UTF-8"),
    ],
)
def test_files_that_are_no_recording(trackfield: Call, tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "bad").write_bytes(content)
    said = trackfield("calibrate", "link", "bad")
    assert said.code == 2
    assert said.out == ""
    assert message in said.err
    assert said.err.count("\n") == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("\n5,", "\nfive,"), "'five' is not a node of the recording"),
        (lambda text: text[: text.index("\n20,") + 1], "no place for 4 nodes of the recording, such as '20'"),
        (lambda text: text.replace("id,x,y", "id,x"), "expected"),
        (lambda text: text.replace("\n5,", "\n4,"), "is given twice"),
    ],
)
def test_places_that_do_not_fit(trackfield: Call, tmp_path: Path, change: Any, message: str) -> None:
    recording, places = written(tmp_path)
    places.write_text(change(places.read_text()))
    said = trackfield("calibrate", "link", recording, "--places", places)
    assert said.code == 2
    assert message in said.err
    assert said.err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("link", "missing.k7"), "missing.k7: cannot be read (No such file"),
        (("link", "."), "cannot be read (Is a directory)"),
        (("link",), "Missing argument 'FILE'"),
        (("links", "x"), "Did you mean 'link'?"),
        (("link", "grenoble.k7.gz", "--tx-dbm", "99"), "--tx-dbm"),
        (("link", "grenoble.k7.gz", "--tx-dbm", "nan"), "--tx-dbm"),
        (("link", "grenoble.k7.gz", "--out", "no/such/folder"), "--out"),
        (("link", "grenoble.k7.gz", "--places", "missing.csv"), "missing.csv: cannot be read"),
    ],
)
def test_bad_arguments(trackfield: Call, arguments: tuple[str, ...], message: str) -> None:
    said = trackfield("calibrate", *arguments)
    assert said.code == 2
    assert message in said.err
    assert "Traceback" not in said.err
