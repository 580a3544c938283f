"""The radio model beside a measurement, and a field fitted to it: the tables and pictures of docs/links.md.

    python -m tests.measured_links docs

takes a minute. The measurement is the packaged recording; beside it are fields of the link model, recorded as the
nodes of the measurement were (``recorded.py``), whose places are drawn from their seeds in a square. The square's side
is the one at which as large a share of the links delivers something as in the measurement; nothing else is matched.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from launcher.calibrate.link import calibrate_link
from launcher.calibrate.samples import Samples, samples_of
from tests.link_statistics import Statistics, correlation, lost_where, statistics
from tests.recorded import Schedule, recorded
from trackfield.draw import uniform
from trackfield.link import make_link
from trackfield.link.k7 import SYNC_BYTES, parse_k7
from trackfield.link.lognormal_prr import LognormalPrr
from trackfield.link.places import Point
from trackfield.link.trace import recording_in, text_in
from trackfield.scenario.packaged import packaged_data

SEEDS: Final = range(1, 6)
NODES: Final = 50
MODEL: Final[Mapping[str, Any]] = {"model": "lognormal_prr", "radio": "802154-0dbm", "channel": "castalia"}
HEARD: Final = 1e-5
"""A link whose frames are received with a smaller probability delivers nothing in 30,000 of them, or next to it."""
COLOURS: Final = {"measured": "#1b1b1b", "model": "#2f6fb0", "fitted": "#c65b1a"}


def square(section: Mapping[str, Any], seed: int, share: float) -> tuple[float, dict[str, Point]]:
    """The side (m) of the square in which such a share of the links of this field delivers something; the places."""
    low, high = 1.0, 10_000.0
    while high / low > 1.001:
        side = (low * high) ** 0.5
        low, high = (side, high) if heard(section, places(side, seed), seed) > share else (low, side)
    return low, places(low, seed)


def places(side_m: float, seed: int) -> dict[str, Point]:
    return {str(i): (side_m * uniform(seed, "x", i), side_m * uniform(seed, "y", i)) for i in range(NODES)}


def heard(section: Mapping[str, Any], places: Mapping[str, Point], seed: int) -> float:
    """The share of the links that ever deliver anything."""
    radio = make_link({k: v for k, v in section.items() if not k.startswith("burst")}, seed, places)
    assert isinstance(radio, LognormalPrr)
    size = Schedule().bytes + SYNC_BYTES
    shares = [radio.prr(src, dst, size) for src in places for dst in places if src != dst]
    return float(np.mean(np.array(shares) > HEARD))


def measured() -> Path:
    file = packaged_data("grenoble.k7.gz")
    assert file is not None
    return file


def main(folder: Path) -> None:
    """Print the tables, and write ``links-reception.png`` and ``links-time.png``."""
    recording = recording_in(text_in(str(measured())), str(measured()))
    assert recording is not None
    real = samples_of(recording)
    fragment = calibrate_link(measured(), None, 0.0).toml()
    print(f"```toml\n{fragment}```\n")
    truth = statistics(real)
    few, theirs, none = lost_where(real, truth.middle_dbm + 10)
    print(
        f"measured, 10 dB above: {few:.0%} of links' channels have {theirs:.0%} of the losses, {none:.0%} next to none"
    )
    several: dict[str, list[Samples]] = {"measured": [real]}
    for name, section in {"model": MODEL, "fitted": {**MODEL, **tomllib.loads(fragment)["link"]}}.items():
        several[name], sides = [], []
        for seed in SEEDS:
            side, where = square(section, seed, truth.heard)
            sides.append(side)
            several[name].append(samples_of(parse_k7(recorded(section, where, seed, Schedule(), apart=True), name)))
        print(f"{name}: squares of {min(sides):.0f} to {max(sides):.0f} m")
    print(table({name: [statistics(one) for one in samples] for name, samples in several.items()}))
    draw({name: samples[0] for name, samples in several.items()}, folder)


def table(found: Mapping[str, Sequence[Statistics]]) -> str:
    """A row for each figure: the measurement, and the mean over fields with the least and the greatest."""
    lines = [f"| | {' | '.join(found)} |", f"| --- |{' ---: |' * len(found)}"]
    for field in fields(Statistics):
        form = field.metadata["form"]
        cells = []
        for several in found.values():
            values = [getattr(one, field.name) for one in several]
            spread = f" ({min(values):{form}} to {max(values):{form}})" if len(values) > 1 else ""
            cells.append(f"{np.mean(values):{form}}{spread}")
        lines.append(f"| {field.metadata['what']} | {' | '.join(cells)} |")
    return "\n".join(lines)


def draw(samples: Mapping[str, Samples], folder: Path) -> None:
    _reception(samples).savefig(folder / "links-reception.png")
    _time(samples).savefig(folder / "links-time.png")


def _figure(width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _reception(samples: Mapping[str, Samples]) -> Figure:
    """Each link's reception by its RSSI."""
    figure = _figure(10, 3.4)
    for axes, (name, one) in zip(figure.subplots(1, len(samples), sharey=True), samples.items(), strict=True):
        axes.plot(one.links.rssi_dbm, one.links.pdr, ".", ms=4, alpha=0.5, mew=0, color=COLOURS[name])
        axes.set(title=f"{name}: each link, over two days", xlabel="mean RSSI, dBm")
        axes.grid(alpha=0.25)
    figure.axes[0].set(ylabel="delivery ratio")
    return figure


def _time(samples: Mapping[str, Samples]) -> Figure:
    """How many links deliver how much, and how long it stays so."""
    figure = _figure(10, 3.6)
    shares, memory = figure.subplots(1, 2)
    for name, one in samples.items():
        links = one.links
        some = np.sort(links.pdr[links.heard])
        shares.plot(some, np.linspace(0, 1, len(some)), color=COLOURS[name], label=name)
        keep = (links.heard & (links.pdr > 0.1) & (links.pdr < 0.9))[links.of_window]
        lags = np.arange(1, 161)
        window_h = float(np.median(np.diff(one.at_s)[np.diff(links.of_window) == 0])) / 3600
        memory.plot(lags * window_h, [correlation(one, keep, lag) for lag in lags], color=COLOURS[name], label=name)
    shares.set(xlabel="delivery ratio of a link", ylabel="share of the links below it", xlim=(0, 1), ylim=(0, 1))
    memory.set(xlabel="hours between two windows of a link", ylabel="correlation", xlim=(0, None))
    memory.set_title("the same channel comes again every 2.5 h", fontsize=10)
    shares.legend(frameon=False)
    for axes in (shares, memory):
        axes.grid(alpha=0.25)
    return figure


if __name__ == "__main__":
    main(Path(sys.argv[1]))
