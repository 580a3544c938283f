"""A picture of a recording and its passes: the waveform, the energies, the fitted curves, the times of the peaks."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from launcher.colours import PALETTE
from launcher.listening.passes import Listened
from trackfield.acoustics.fitting import smoothed
from trackfield.filters.types import Array

_SOFT: Final = "#7c8796"
_SMOOTHED: Final = 13
_SPAN_WIDTHS: Final = 12.0
"""A curve is drawn so far to both sides of its peak."""
_LOWEST_DB: Final = -120.0


def draw(listened: Listened, name: str, file: Path) -> None:
    """Write the picture, a PNG file. Raises ``OSError`` if it cannot be written."""
    with mpl.rc_context({"axes.spines.right": False, "axes.spines.top": False, "font.size": 9}):
        figure = Figure(figsize=(10, 5.6), dpi=110, layout="constrained")
        FigureCanvasAgg(figure)
        wave, level = figure.subplots(2, 1, sharex=True, height_ratios=(2, 3))
        _waveform(wave, listened)
        _levels(level, listened)
        for number, one in enumerate(listened.passes):
            for axes in (wave, level):
                axes.axvline(one.detection.peak_s, color=PALETTE[4], lw=1.4, zorder=4)
            _curve(level, listened, number)
            text = f" {one.detection.peak_s:.2f} s\n width {one.detection.width_s:.2f} s"
            level.text(one.detection.peak_s, 0.03, text, transform=level.get_xaxis_transform())
        wave.set_title(f"{name}: {_count(len(listened.passes))}", loc="left")
        level.set(xlim=(0.0, listened.seconds), xlabel="time of the recording, s", ylabel="mean square, dB")
        level.legend(frameon=False, loc="upper right")
        for axes in (wave, level):
            axes.grid(alpha=0.25)
            axes.set_axisbelow(True)
        figure.savefig(file, format="png")


def _count(passes: int) -> str:
    return "no pass" if passes == 0 else "one pass" if passes == 1 else f"{passes} passes"


def _waveform(axes: Axes, listened: Listened) -> None:
    """Between the lowest and the highest sample of each 20 ms."""
    axes.fill_between(listened.outline_s, listened.low, listened.high, color=PALETTE[1], lw=0.3, alpha=0.75)
    axes.set(ylabel="amplitude")


def _levels(axes: Axes, listened: Listened) -> None:
    """Energies of 20 ms, and their running mean by which a pass is triggered."""
    levels = _db(listened.energies)
    axes.plot(listened.t_s, levels, ".", ms=4, mew=0, alpha=0.7, color=_SOFT, label="20 ms")
    if len(levels) >= _SMOOTHED:
        half = _SMOOTHED // 2
        axes.plot(
            listened.t_s[half:-half],
            _db(smoothed(listened.energies, _SMOOTHED)),
            lw=1.1,
            color=PALETTE[1],
            label="0.26 s",
        )
    loud = levels[levels > _LOWEST_DB]
    if len(loud):
        axes.set_ylim(float(np.quantile(loud, 0.01)) - 4.0, float(loud.max()) + 4.0)


def _curve(axes: Axes, listened: Listened, number: int) -> None:
    """A pass on its noise and the tails of those before it, until it was told."""
    one, earlier = listened.passes[number], listened.passes[:number]
    near = np.abs(listened.t_s - one.curve.peak_s) < _SPAN_WIDTHS * one.curve.width_s
    t_s = listened.t_s[near & (listened.t_s < one.detection.known_s)]
    power = one.curve.floor + sum((other.curve.at(t_s) for other in (*earlier, one)), np.zeros(len(t_s)))
    fit, told = ("fit", "told") if number == 0 else (None, None)
    axes.plot(t_s, _db(power), color=PALETTE[4], lw=1.6, label=fit)
    axes.axvline(one.detection.known_s, color=_SOFT, lw=0.9, ls=":", label=told)


def _db(power: Array) -> Array:
    return np.asarray(10.0 * np.log10(np.maximum(power, 1e-13)))
