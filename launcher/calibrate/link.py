"""``calibrate link``: the link model ``lognormal_prr``, with bursts, fitted to a recording of delivery ratios."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import dist, exp, isfinite, log
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import ValidationError

from launcher.calibrate.fading import asymmetry_db, path_loss
from launcher.calibrate.fragment import Fragment
from launcher.calibrate.intervals import Fitted, groups_of, jackknifed
from launcher.calibrate.losses import SURE, burst_s, curve, noise_and_losses, swings
from launcher.calibrate.samples import Bools, Floats, Ints, Samples, samples_of
from trackfield.errors import ScenarioError
from trackfield.link.k7 import Recording
from trackfield.link.measured import RADIO
from trackfield.link.places import Point
from trackfield.link.trace import recording_in, text_in
from trackfield.scenario.links import LognormalPrr
from trackfield.scenario.packaged import or_packaged
from trackfield.scenario.places import read_places
from trackfield.words import quoted

LEAST_PAIRS: Final = 10
"""Of fewer pairs that hear each other nothing can be said."""
PATH_LOSS: Final = ("pl0_db", "exponent", "sigma_db")
KEYS: Final = (*PATH_LOSS, "asymmetry_db", "noise_dbm", "burst_loss", "burst_s")
"""What is fitted."""
_MOST_LN: Final = log(1e9)


@dataclass(frozen=True)
class Fit:
    """The keys of ``[link]`` that were ``fitted``, and why others were ``left`` out; ``tx_dbm`` was assumed."""

    fitted: Mapping[str, Fitted]
    left: Mapping[str, str]
    tx_dbm: float

    @property
    def section(self) -> dict[str, Any]:
        """The keys of the section, rounded as they are written."""
        known = {"model": "lognormal_prr", "radio": RADIO, "tx_dbm": self.tx_dbm}
        return known | {key: float(f"{fitted.value:.4g}") for key, fitted in self.fitted.items()}


def calibrate_link(file: Path, places: Path | None, tx_dbm: float) -> Fragment:
    """The section ``[link]`` of a field like the one that was recorded.

    Raises ``ScenarioError`` for files that cannot be used, and for a recording of too few links.
    """
    fit = fitted(_recording(file), None if places is None else _places(places), tx_dbm, str(file))
    try:
        LognormalPrr.model_validate(fit.section)
    except ValidationError as error:
        key = ".".join(map(str, error.errors()[0]["loc"]))
        what = f"fits only with link.{key} = {fit.section[key]:g}, which no field has"
        raise ScenarioError(what, file=str(file), expected="a recording of a field, in dBm and metres") from None
    return Fragment("link", fit.section, fit.fitted, fit.left, _about(file, places))


def _about(file: Path, places: Path | None) -> list[str]:
    where = f" and {places.name}" if places else ""
    return [
        f"Fitted to {file.name}{where} by trackfield calibrate link; in comments, 95 % intervals.",
        "The power of the senders is assumed; 1 dB more of it means 1 dB more of pl0_db, and nothing else.",
    ]


def _recording(file: Path) -> Recording:
    expected = "a recording in k7 form, a JSON header and lines datetime,src,dst,channel,mean_rssi,pdr,tx_count"
    name = str(or_packaged(file))
    try:
        recording = recording_in(text_in(name), name)
    except ValueError as error:
        raise ScenarioError(str(error), expected=expected) from None
    if recording is None:
        raise ScenarioError("is not in k7 form", file=str(file), expected=expected)
    return recording


def _places(file: Path) -> dict[str, Point]:
    found, _ = read_places(file, None, None)
    return {id: (x, y) for id, x, y in found}


def fitted(recording: Recording, places: Mapping[str, Point] | None, tx_dbm: float, file: str) -> Fit:
    """What can be fitted to a recording; path loss and shadowing only if the ``places`` (m) of its nodes are known.

    Raises ``ScenarioError`` with the name of the recording's ``file``.
    """
    try:
        samples = samples_of(recording)
    except ValueError as error:
        raise ScenarioError(str(error), file=file, expected=f"at least {LEAST_PAIRS} pairs of nodes") from None
    if places is not None:
        _check_places(samples.nodes, places)
    fit = _Fitting(samples, places, tx_dbm)
    if len(fit.both) < LEAST_PAIRS:
        what = f"only {len(fit.both)} pairs of nodes hear each other"
        raise ScenarioError(what, file=file, expected=f"at least {LEAST_PAIRS}")
    found = dict(zip(fit.names, jackknifed(fit.estimate, fit.groups), strict=True))
    return _judged(found, tx_dbm, recording.end_s, placed=places is not None)


def _judged(found: dict[str, Fitted], tx_dbm: float, recorded_s: float, *, placed: bool) -> Fit:
    """Without what the recording does not show."""
    left = {} if placed else dict.fromkeys(PATH_LOSS, "not fitted: needs the places of the nodes (--places)")
    loss, bursts = found.pop("burst_loss"), Fitted(*(exp(min(one, _MOST_LN)) for one in found.pop("ln_burst_s")))
    share = f"{max(loss.low, 0.0):.2g} to {loss.high:.2g} of the frames on strong links are lost"
    if not (loss.low > 0 and isfinite(bursts.value) and isfinite(bursts.high)):
        left |= dict.fromkeys(("burst_loss", "burst_s"), f"no bursts found: {share}")
    elif bursts.value / loss.value > recorded_s:
        what = f"{share}, for longer times than {recorded_s:.0f} s of recording can show"
        left |= dict.fromkeys(("burst_loss", "burst_s"), what)
    else:
        found |= {"burst_loss": loss, "burst_s": bursts}
    return Fit({key: found[key] for key in KEYS if key in found}, left, tx_dbm)


def _check_places(nodes: tuple[str, ...], places: Mapping[str, Point]) -> None:
    unknown, missing = [id for id in places if id not in nodes], [node for node in nodes if node not in places]
    if unknown:
        expected = f"those of the recording, {nodes[0]} to {nodes[-1]}"
        raise ScenarioError(f"{quoted(unknown[0])} is not a node of the recording", key="--places", expected=expected)
    if missing:
        what = f"no place for {len(missing)} nodes of the recording, such as {quoted(missing[0])}"
        raise ScenarioError(what, key="--places", expected="a row id,x,y for each node")


class _Fitting:
    """A recording's links, and what is estimated from any part of them."""

    def __init__(self, samples: Samples, places: Mapping[str, Point] | None, tx_dbm: float) -> None:
        self._samples, self._tx_dbm = samples, tx_dbm
        self._links = links = samples.links
        n = len(samples.nodes)
        self.groups = groups_of(np.minimum(links.src, links.dst) * n + np.maximum(links.src, links.dst))
        self._there, self._back = self._pairs(n)
        level = links.rssi_dbm
        hears = np.isfinite(level[self._there]) & np.isfinite(level[self._back])
        self.both: Ints = np.flatnonzero(hears)
        self._threshold = float(level[links.heard].min()) if links.heard.any() else 0.0
        self._ranges = None if places is None else self._distances([places[node] for node in samples.nodes])

    def _pairs(self, n: int) -> tuple[Ints, Ints]:
        """The links there and back (P,) of all pairs of which both directions were measured."""
        place = np.full((n, n), -1)
        place[self._links.src, self._links.dst] = np.arange(len(self._links.src))
        a, b = np.nonzero(np.triu((place >= 0) & (place.T >= 0), 1))
        return place[a, b], place[b, a]

    def _distances(self, points: list[Point]) -> Floats:
        links = self._links
        return np.array(
            [dist(points[a], points[b]) for a, b in zip(links.src[self._there], links.dst[self._there], strict=True)]
        )

    @property
    def names(self) -> list[str]:
        """What ``estimate`` gives."""
        return [
            *(PATH_LOSS if self._ranges is not None else ()),
            "asymmetry_db",
            "noise_dbm",
            "burst_loss",
            "ln_burst_s",
        ]

    def estimate(self, some: Bools) -> list[float]:
        """The figures by these links (L,) alone."""
        links, samples = self._links, self._samples
        level = links.rssi_dbm
        both = self.both[some[self._there[self.both]]]
        a = asymmetry_db(level[self._there[both]], level[self._back[both]], self._threshold)
        use = some & links.heard
        windows = links.windows.astype(float)
        noise, p = noise_and_losses(level[use], links.pdr[use], windows[use], samples.frame_bytes)
        strong = links.heard & (np.nan_to_num(curve(level - noise, samples.frame_bytes)) >= SURE)
        bad_s = burst_s(swings(samples, strong), some)
        return [*self._path_loss(some, a), a, noise, p, log(bad_s) if bad_s > 0 else float("nan")]

    def _path_loss(self, some: Bools, asymmetry: float) -> tuple[float, ...]:
        if self._ranges is None:
            return ()
        use = some[self._there]
        there, back = (self._links.rssi_dbm[one[use]] for one in (self._there, self._back))
        return path_loss(self._ranges[use], there, back, asymmetry, self._threshold, self._tx_dbm)
