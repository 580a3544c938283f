"""How well passes are found: the tables of docs/listening.md.

    python -m tests.detectors [--runs 20]
    python -m tests.detectors --picture docs/listening.png

Each run is a pass that is drawn from its seed, in wind and ambient noise. Errors are in widths w = d/v of the pass.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple

import numpy as np
import soundfile

from launcher.listening.passes import listen
from launcher.listening.picture import draw
from tests.sounds import NO_PASS, SECONDS, no_pass, passing
from trackfield.acoustics.listener import DETECTORS, Detection, Listener
from trackfield.acoustics.signals import RATE
from trackfield.filters.types import Array

PASSES: Final = ((3.0, 13.4), (8.0, 13.4), (20.0, 30.0), (20.0, 13.4), (35.0, 13.4))
"""Distances (m) and speeds (m/s)."""
AFTER_S: Final = (1.0, 1.5, 2.5)
"""With 2.5 s after the peak, the 5 s of ``argmax`` are those around it, as Yang et al. record."""


class Found(NamedTuple):
    """What was told of n passes.

    ``counts`` (n,) is how many for each; of those that were told once, ``errors`` (k,) are those of the time in widths,
    ``scores`` (k,) the errors over their sds, ``widths`` (k,) over the true width, ``strengths_db`` (k,) over the true
    strength, ``delays_s`` (k,) between the true peak and when it was told.
    """

    counts: Array
    errors: Array
    scores: Array
    widths: Array
    strengths_db: Array
    delays_s: Array

    @property
    def share(self) -> float:
        """Of passes that were told once."""
        return float((self.counts == 1).mean())


Make = Callable[[], Listener]


def found(makers: Sequence[Make], distance_m: float, speed_m_s: float, snr_db: float, seeds: range) -> list[Found]:
    """What a listener of each maker tells of the same passes."""
    width_s = distance_m / speed_m_s
    told: list[list[tuple[list[Detection], float]]] = [[] for _ in makers]
    for seed in seeds:
        samples, peak_s = passing(seed, distance_m, speed_m_s, snr_db)
        for make, kept in zip(makers, told, strict=True):
            kept.append((make().feed(samples), peak_s))
    return [_found(kept, width_s, distance_m) for kept in told]


def _found(told: list[tuple[list[Detection], float]], width_s: float, distance_m: float) -> Found:
    once = [(some[0], peak_s) for some, peak_s in told if len(some) == 1]
    errors = np.array([one.peak_s - peak_s for one, peak_s in once])
    return Found(
        np.array([float(len(some)) for some, _ in told]),
        errors / width_s,
        errors / np.array([one.time_sd_s for one, _ in once]),
        np.array([one.width_s / width_s for one, _ in once]),
        np.array([one.strength_db + 20.0 * np.log10(distance_m) for one, _ in once]),
        np.array([one.known_s - peak_s for one, peak_s in once]),
    )


def rms(values: Array) -> float:
    return float(np.sqrt(np.square(values).mean()))


def by_distance(runs: int) -> Iterator[str]:
    """Each detector's error by distance, speed and signal-to-noise ratio."""
    yield "| SNR | distance | speed | w | told once | `argmax` | `smooth` | `fit` | mean | width | strength |"
    yield "| ---: " * 11 + "|"
    for snr_db in (10.0, 3.0):
        for distance_m, speed_m_s in PASSES:
            listeners = [partial(Listener, name) for name in DETECTORS]
            argmax, smooth, fit = found(listeners, distance_m, speed_m_s, snr_db, range(runs))
            argmax_w, smooth_w, fit_w = (rms(one.errors) for one in (argmax, smooth, fit))
            yield (
                f"| {snr_db:g} dB | {distance_m:g} m | {speed_m_s:g} m/s | {distance_m / speed_m_s:.2f} s "
                f"| {fit.share:.0%} | {argmax_w:.2f} w | {smooth_w:.2f} w | {fit_w:.3f} w "
                f"| {fit.errors.mean():+.3f} w | {rms(fit.widths - 1.0):.1%} | {rms(fit.strengths_db):.2f} dB |"
            )


def by_length(runs: int) -> Iterator[str]:
    """Each detector's error by how much is heard after the peak, of a pass at 20 m, 13.4 m/s and 10 dB."""
    yield "| heard after the peak | told after the peak, mean | at most | `argmax` | `smooth` | `fit` |"
    yield "| ---: " * 6 + "|"
    for after_s in AFTER_S:
        listeners = [partial(Listener, name, after_s=after_s) for name in DETECTORS]
        argmax, smooth, fit = found(listeners, 20.0, 13.4, 10.0, range(runs))
        yield (
            f"| {after_s:g} s | {fit.delays_s.mean():.2f} s | {fit.delays_s.max():.2f} s "
            f"| {rms(argmax.errors):.2f} w | {rms(smooth.errors):.2f} w | {rms(fit.errors):.3f} w |"
        )


def false_alarms(runs: int) -> Iterator[str]:
    """How often a pass is told of what is none."""
    yield "| recordings | of each | false alarms |"
    yield "| --- | ---: | ---: |"
    for name in NO_PASS:
        alarms = sum(len(Listener().feed(no_pass(name, seed))) for seed in range(runs))
        yield f"| {name.replace('_', ' ')} | {runs} of up to {SECONDS} s | {alarms} |"


def pictured(file: Path) -> None:
    """A pass at 20 m, 13.4 m/s and 10 dB, as ``listen`` draws it."""
    with TemporaryDirectory() as folder:
        sound = Path(folder) / "pass.wav"
        samples, _ = passing(2, 20.0, 13.4, 10.0)
        soundfile.write(sound, 0.8 * samples / np.abs(samples).max(), RATE)
        draw(listen(sound, "fit", ""), sound.name, file)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--picture", type=Path)
    runs, picture = vars(parser.parse_args()).values()
    if picture is not None:
        pictured(picture)
        return
    for made in (by_distance, by_length, false_alarms):
        for line in made(runs):
            print(line, flush=True)
        print()


if __name__ == "__main__":
    main()
