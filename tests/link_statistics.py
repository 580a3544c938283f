"""What a recording of delivery ratios says about links in general."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Final

import numpy as np
from scipy.optimize import least_squares

from launcher.calibrate.samples import Floats, Ints, Links, Samples

GOOD: Final = 0.9
BETWEEN: Final = (0.1, 0.9)
HOUR_S: Final = 3600.0


def what(text: str, form: str = ".0%") -> float:
    """A field of ``Statistics``: its words, and how it is printed."""
    return field(metadata={"what": text, "form": form})  # type: ignore[no-any-return]


@dataclass(frozen=True)
class Statistics:
    """Figures of a recording; a link is directed, a pair has two, a window is a burst at one receiver."""

    heard: float = what("links that ever deliver anything, of all")
    between: float = what("of these: deliver 10 to 90 % over the whole time")
    good: float = what("of these: deliver 90 % or more")
    windows_between: float = what("windows of these links with 10 to 90 %")
    width_db: float = what("RSSI from 10 to 90 % of reception (logistic)", ".1f")
    middle_dbm: float = what("RSSI at its middle, dBm", ".1f")
    strong_between: float = what("windows with less than 90 %, 10 dB above the middle", ".1%")
    level_db: float = what("sd of the RSSI's difference between directions, dB", ".2f")
    one_way: float = what("pairs heard one way only, of those heard")
    unequal: float = what("pairs whose directions differ by more than 10 points")
    very_unequal: float = what("pairs whose directions differ by more than 50 points", ".1%")
    of_links: float = what("variance of windows: between links")
    of_channels: float = what("variance of windows: between the channels of a link")
    of_time: float = what("variance of windows: over time, on one channel")
    of_draws: float = what("variance of windows: counting 100 frames", ".1%")
    good_min: float = what("a link stays at 90 % or more, min", ".0f")
    bad_min: float = what("a link stays below 90 %, min", ".0f")
    next_window: float = what("correlation with the next window, on another channel", ".2f")
    next_round: float = what("correlation with the next window on the same channel", ".2f")
    day_apart: float = what("correlation with the window a day later, same channel", ".2f")
    moved: float = what("links that differ by more than 10 points between the two days")


def names() -> list[str]:
    """The figures' names, in order."""
    return [one.name for one in fields(Statistics)]


def _both(links: Links, nodes: int) -> tuple[Ints, Ints]:
    """The pairs (P,) of which something was received in both directions: the links there and back."""
    place = np.full((nodes, nodes), -1)
    some = np.flatnonzero(links.heard)
    place[links.src[some], links.dst[some]] = some
    there = some[(links.src[some] < links.dst[some]) & (place[links.dst[some], links.src[some]] >= 0)]
    return there, place[links.dst[there], links.src[there]]


def statistics(samples: Samples) -> Statistics:
    links, n = samples.links, len(samples.nodes)
    heard = links.heard
    pdr, level = links.pdr[heard], links.rssi_dbm[heard]
    of = links.of_window
    use = heard[of]
    windows, owner = samples.pdr[use], of[use]
    middle, scale = logistic(level, pdr)
    strong = links.rssi_dbm[owner] > middle + 10
    shares = np.zeros((2, n, n))
    shares[0, links.src, links.dst], shares[1, links.src, links.dst] = links.pdr, 1
    there, back = np.triu(shares[0], 1), np.triu(shares[0].T, 1)
    known = np.triu((shares[1] > 0) & (shares[1].T > 0), 1)
    some = known & ((there > 0) | (back > 0))
    apart = np.abs(there - back)[some]
    first, second = _both(links, n)
    return Statistics(
        heard=float(heard.sum() / (n * (n - 1))),
        between=_between(pdr),
        good=float(np.mean(pdr >= GOOD)),
        windows_between=_between(windows),
        width_db=2 * np.log(9) * scale,
        middle_dbm=middle,
        strong_between=float(np.mean(windows[strong] < GOOD)),
        level_db=float(np.std(links.rssi_dbm[first] - links.rssi_dbm[second])),
        one_way=float(np.mean(((there > 0) ^ (back > 0))[some])),
        unequal=float(np.mean(apart > 0.1)),
        very_unequal=float(np.mean(apart > 0.5)),
        **_parts(samples, use),
        **_stays(samples, use),
        **_correlations(samples, use),
        moved=_moved(samples, use),
    )


def logistic(level: Floats, pdr: Floats) -> tuple[float, float]:
    """Middle (dBm) and scale (dB) of the logistic curve of reception against RSSI, with a top of its own."""

    def off(parameters: Floats) -> Floats:
        middle, ln_scale, top = parameters
        return np.asarray(top / (1 + np.exp(-np.clip((level - middle) / np.exp(ln_scale), -50, 50))) - pdr)

    starts = [least_squares(off, [float(q), 0.0, 0.95]) for q in np.quantile(level, [0.05, 0.15, 0.3])]
    middle, ln_scale, _ = min(starts, key=lambda one: one.cost).x
    return float(middle), float(np.exp(ln_scale))


def lost_where(samples: Samples, above_dbm: float) -> tuple[float, float, float]:
    """Of the channels of links above an RSSI: the share of those that lose more than a tenth of their frames, the part
    of all losses that is theirs, and the share of those that lose less than a hundredth.
    """
    links = samples.links
    use = (links.heard & (np.nan_to_num(links.rssi_dbm) > above_dbm))[links.of_window]
    _, group = np.unique(links.of_window[use] * 1000 + samples.channel[use], return_inverse=True)
    lost = 1 - np.bincount(group, samples.pdr[use]) / np.bincount(group)
    return float(np.mean(lost > 0.1)), float(lost[lost > 0.1].sum() / lost.sum()), float(np.mean(lost < 0.01))


def _between(shares: Floats) -> float:
    return float(np.mean((shares > BETWEEN[0]) & (shares < BETWEEN[1])))


def _parts(samples: Samples, use: np.ndarray) -> dict[str, float]:
    """The variance of windows, by what makes it: nested analysis of variance with the mean of each group."""
    pdr, link, channel = samples.pdr[use], samples.links.of_window[use], samples.channel[use]
    total = float(np.var(pdr))
    by_link = _means(pdr, link)
    by_channel = _means(pdr, link * 1000 + channel)
    draws = float(np.mean(pdr * (1 - pdr)) / samples.frames)
    size = _sizes(link * 1000 + channel)
    within = float(np.sum((pdr - by_channel) ** 2) / np.sum(1 - 1 / size))
    between = max(float(np.var(by_channel - by_link)) - float(np.mean(within / size)), 0.0)
    of_links = float(np.var(by_link))
    whole = of_links + between + within
    assert whole > 0.5 * total
    return {
        "of_links": of_links / whole,
        "of_channels": between / whole,
        "of_time": max(within - draws, 0.0) / whole,
        "of_draws": min(draws, within) / whole,
    }


def _means(values: Floats, group: np.ndarray) -> Floats:
    _, inverse = np.unique(group, return_inverse=True)
    return np.asarray((np.bincount(inverse, values) / np.bincount(inverse))[inverse])


def _sizes(group: np.ndarray) -> Floats:
    _, inverse, counts = np.unique(group, return_inverse=True, return_counts=True)
    return np.asarray(counts[inverse].astype(float))


def _stays(samples: Samples, use: np.ndarray) -> dict[str, float]:
    """Mean times in minutes for which a link's windows are good, or not, one after another."""
    link, good, at_s = samples.links.of_window[use], samples.pdr[use] >= GOOD, samples.at_s[use]
    change = np.flatnonzero((np.diff(link) != 0) | (good[1:] != good[:-1])) + 1
    begins = np.concatenate([[0], change])
    lengths = np.diff(np.concatenate([begins, [len(good)]]))
    apart_min = float(np.median(np.diff(at_s)[np.diff(link) == 0])) / 60
    state = good[begins]
    return {"good_min": float(lengths[state].mean()) * apart_min, "bad_min": float(lengths[~state].mean()) * apart_min}


def _correlations(samples: Samples, use: np.ndarray) -> dict[str, float]:
    """Of the windows of links between 10 and 90 %, around the mean of the link."""
    keep = use & ((samples.links.pdr > BETWEEN[0]) & (samples.links.pdr < BETWEEN[1]))[samples.links.of_window]
    channels = len(np.unique(samples.channel))
    a_day = round(24 * HOUR_S / _round_s(samples, channels)) * channels
    return {
        "next_window": correlation(samples, keep, 1),
        "next_round": correlation(samples, keep, channels),
        "day_apart": correlation(samples, keep, a_day),
    }


def correlation(samples: Samples, keep: np.ndarray, lag: int) -> float:
    """The correlation of windows of a link, ``lag`` windows apart, around the link's mean; NaN if there are none."""
    link, pdr = samples.links.of_window[keep], samples.pdr[keep]
    off = pdr - _means(pdr, link)
    same = link[lag:] == link[:-lag]
    if not same.any():
        return float("nan")
    return float(np.mean((off[lag:] * off[:-lag])[same]) / np.mean(off**2))


def _round_s(samples: Samples, channels: int) -> float:
    link = samples.links.of_window
    return channels * float(np.median(np.diff(samples.at_s)[np.diff(link) == 0]))


def _moved(samples: Samples, use: np.ndarray) -> float:
    """Of links with windows in both halves of the recording."""
    link, pdr, late = samples.links.of_window[use], samples.pdr[use], samples.at_s[use] > samples.at_s.max() / 2
    count = [np.bincount(link, one, len(samples.links.src)) for one in (~late, late)]
    total = [np.bincount(link, pdr * one, len(samples.links.src)) for one in (~late, late)]
    both = (count[0] > 0) & (count[1] > 0)
    days = [total[i][both] / count[i][both] for i in (0, 1)]
    return float(np.mean(np.abs(days[0] - days[1]) > 0.1))
