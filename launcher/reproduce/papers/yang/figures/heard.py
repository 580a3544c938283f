"""Figure 10 of Yang et al.: what a node hears of a passing vehicle, and when the detectors say that it was nearest."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from launcher.colours import PALETTE
from launcher.report.style import INK, SOFT
from launcher.reproduce.papers.yang.solved.messages import RECORDED_S
from launcher.reproduce.papers.yang.solved.waveforms import SNR_DB, detections, recorded
from launcher.reproduce.papers.yang.trials.setups import USUAL
from trackfield.acoustics.signals import RATE

DETECTORS: Final = {"argmax": PALETTE[3], "smooth": PALETTE[1], "fit": PALETTE[0]}


def fig10(seed: int = 3, about_m: float = 10.0) -> Figure:
    """Five seconds of the node that the target passes at ``about_m``: the marks of the detectors, and the truth."""
    _, recordings = recorded(SNR_DB, USUAL, seed)
    one = min(recordings, key=lambda heard: abs(heard.distance_m - about_m))
    begin = one.loudest_s - RECORDED_S / 2.0
    first = int(begin * RATE)
    samples = one.samples[first : first + int(RECORDED_S * RATE)]
    t_s = np.arange(len(samples)) / RATE
    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    axes = figure.subplots()
    axes.plot(t_s, samples / np.abs(samples).max(), color=SOFT, lw=0.35)
    axes.axvline(one.loudest_s - begin, color=INK, lw=2.4, alpha=0.5, label="truth")
    for detector, colour in DETECTORS.items():
        for found in detections(one.samples, detector):
            style: dict[str, Any] = {"color": colour, "lw": 1.4, "ls": "--" if detector == "argmax" else "-"}
            off = found.peak_s - one.loudest_s
            axes.axvline(found.peak_s - begin, label=f"{detector}, {1000 * off:+.0f} ms", **style)
    axes.set(xlabel="time, s", ylabel="amplitude", xlim=(0, RECORDED_S), ylim=(-1.05, 1.05))
    axes.set_title(f"passes at {one.distance_m:.1f} m, 30 mph, {SNR_DB:g} dB at 20 m")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure
