"""The energy of the policies and of the swept fields, by every account, beside a prototype's figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from launcher.reproduce.intervals import Interval
from launcher.reproduce.kernels.scores import mean
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.ozfidan import energy as account
from launcher.reproduce.papers.ozfidan.energy import (
    ACCOUNTS,
    CC2420,
    EVERY_1,
    EVERY_10,
    ON,
    RADIO,
    REPORTS,
    SLEEP,
    SLOTS,
    Ledger,
)
from launcher.reproduce.papers.ozfidan.experiments import FALLBACK, PAPER, RARELY, SOME, SWEPT
from launcher.reproduce.papers.ozfidan.field import Setup, T
from launcher.reproduce.papers.ozfidan.scheduling import POLICIES
from launcher.reproduce.papers.ozfidan.tables import bound, error, far, of, over, over_bound, two
from launcher.reproduce.tables import Row, aligned, beside, percent, plain, with_interval

ALL: Final = "all"
NAMES: Final = (*POLICIES, RARELY)
PROTOTYPE: Final[Mapping[str, float]] = {
    REPORTS: 53.0, SLEEP: 5.9, EVERY_10: 4.1, EVERY_1: 1.06, ON: 1.005, SLOTS: 5.8,
}  # fmt: skip
"""How many times less energy ``merge_until_3`` takes than no scheduling, by an independent prototype's own count."""
PROTOTYPE_STEP: Final[Mapping[str, tuple[float, float]]] = {
    "frames in a step": (640.0, 11.7), "bytes in a step": (12544.0, 222.0), f"mJ in a step, {REPORTS}": (43.5, 0.82),
}  # fmt: skip
"""Its figures of a step, of no scheduling and of ``merge_until_3``."""
NEAR_ONE: Final = 2.0
"""Ratios below are told with three digits after the point."""


def ledger(found: Found, name: str, setup: Setup = PAPER, *, scheduled: bool = True) -> Ledger:
    """The counts of an experiment, or of no scheduling in the same runs."""
    scheduled = scheduled and name != ALL
    prefix = "ukf " if scheduled else "ukf all "
    some = {key.removeprefix(prefix): value for key, value in found.figures[name].items() if key.startswith(prefix)}
    return Ledger(some, setup.slaves, setup.masters, scheduled)


def spent_mj(one: Ledger, radio: str, by: str, *, baseline: bool = False) -> np.ndarray:
    """mJ (R,) in a step."""
    return 1e3 * account.energy(one, RADIO[radio], ACCOUNTS[by], baseline=baseline)


def times_less(found: Found, name: str, radio: str, by: str, *, baseline: bool = False) -> Interval:
    """How many times as much no scheduling takes, in the same runs."""
    theirs, ours = (
        spent_mj(ledger(found, name, scheduled=scheduled), radio, by, baseline=baseline) for scheduled in (False, True)
    )
    return over(theirs, ours)


def tables(found: Found) -> dict[str, list[Row]]:
    """All accounts of all policies, and what is beside the prototype's."""
    return {"energy": list(_rows(found)), "energy, prototype": [*_steps(found), *_ratios(found)]}


def _rows(found: Found) -> Iterator[Row]:
    for name in NAMES:
        for radio in RADIO:
            for by in ACCOUNTS:
                for baseline in (False, True):
                    told = f"{by}{', with baseline' if baseline else ''}"
                    some = spent_mj(ledger(found, name), radio, by, baseline=baseline)
                    yield Row(name, radio, f"{told}, mJ", mean(some))
                    if name != ALL:
                        ratio = times_less(found, name, radio, by, baseline=baseline)
                        yield Row(name, radio, f"{told}, times less than no scheduling", ratio)


def _steps(found: Found) -> Iterator[Row]:
    for scheduled, name in ((False, "no scheduling"), (True, FALLBACK)):
        one, radio = ledger(found, FALLBACK, scheduled=scheduled), RADIO[CC2420]
        figures = {
            "frames in a step": account.frames(one),
            "bytes in a step": account.sent_bytes(one, radio),
            f"mJ in a step, {REPORTS}": spent_mj(one, CC2420, REPORTS),
        }
        for what, some in figures.items():
            ours, told = mean(some), PROTOTYPE_STEP[what][scheduled]
            ratio = ours.over(told)
            yield Row(name, CC2420, what, ours, published=told, ratio=ratio, verdict=beside(ratio))


def _ratios(found: Found) -> Iterator[Row]:
    for by, told in PROTOTYPE.items():
        ours = times_less(found, FALLBACK, CC2420, by)
        ratio = ours.over(told)
        yield Row(FALLBACK, CC2420, f"{by}: times less", ours, published=told, ratio=ratio, verdict=beside(ratio))


# --- in Markdown ------------------------------------------------------------------------------------------------------


def prototype(found: Found) -> str:
    """Ours beside an independent count's."""
    rows = []
    for row in tables(found)["energy, prototype"]:
        if row.ratio is not None and row.published is not None:
            ours = with_interval(row.ours, four)
            rows.append([row.case, row.quantity, ours, four(row.published), f"{row.ratio.value:.2f}", row.verdict])
    return aligned(("case", "figure", "ours", "prototype's", "ratio", "verdict"), rows)


def four(value: float) -> str:
    """A number with four digits at least."""
    return f"{value:.0f}" if value >= 1000.0 else f"{value:.4g}"


def step(found: Found) -> str:
    """Frames and bytes of a step, by policy."""
    rows = []
    for name in NAMES:
        one, radio = ledger(found, name), RADIO[CC2420]
        forwards, beacons = (one.counts[what].sum(axis=1) for what in ("forwards", "beacons"))
        figures = (one.counts["reports"], forwards, one.counts["handovers"], beacons)
        sums = (account.frames(one), account.sent_bytes(one, radio))
        rows.append([name, *(plain(float(some.mean())) for some in (*figures, *sums))])
    header = ("policy", "reports", "forwards", "hand-overs", "beacons", "frames", "bytes with IEEE 802.15.4")
    return aligned(header, rows)


def accounts(found: Found, radio: str, *, baseline: bool) -> str:
    """mJ in a step by every account, and how many times less than no scheduling."""
    air = radio != CC2420
    rows = []
    for name in NAMES:
        row = [name]
        for by in ACCOUNTS:
            told = plain(float(spent_mj(ledger(found, name), radio, by, baseline=baseline).mean()))
            ratio = times_less(found, name, radio, by, baseline=baseline).value
            times = f"{ratio:.3g}" if ratio > NEAR_ONE else f"{ratio:.3f}"
            row.append(told if name == ALL else f"{told} ({times}x)")
        if air:
            row.append(percent(float(account.on_air_s(ledger(found, name), RADIO[radio]).mean()) / T))
        rows.append(row)
    return aligned(("policy, mJ in a step", *ACCOUNTS, *(["channel in use"] if air else [])), rows)


def sweeps(found: Found) -> str:
    """A row for each field."""
    header = (
        *("field", "awake", "without master", "bound, m", "error, m", "error over bound", "over 100 m"),
        *(f"mJ, {SLEEP}", "times less"),
    )
    rows = []
    for name, setup in SWEPT.items():
        ours, theirs = (spent_mj(ledger(found, name, setup, scheduled=s), CC2420, SLEEP) for s in (True, False))
        rows.append(
            [
                name,
                *(plain(float(of(found, name, "ukf", what).mean())) for what in ("reports", "orphans")),
                plain(bound(found, name).value),
                with_interval(error(found, name, "ukf")),
                with_interval(over_bound(found, name, "ukf"), two),
                percent(far(found, name, "ukf").value),
                plain(float(ours.mean())),
                f"{over(theirs, ours).value:.2f}",
            ]
        )
    return aligned(header, rows) + f"\n\nUKF, merge_until_3, up to {SOME} runs of each."
