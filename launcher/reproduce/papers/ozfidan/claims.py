"""What Özfidan et al. (2018) claim, and what the fallback should reach: each verdict by a stated rule."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from launcher.reproduce.intervals import Interval, all_of, any_of, share_of_steps
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.ozfidan import roles
from launcher.reproduce.papers.ozfidan.energies import times_less
from launcher.reproduce.papers.ozfidan.energy import ACCOUNTS, CC2420
from launcher.reproduce.papers.ozfidan.experiments import (
    BOTH,
    FALLBACK,
    FAR_M,
    HOUSE,
    PAPERS_POLICY,
    RARELY,
    each_rms,
)
from launcher.reproduce.papers.ozfidan.tables import (
    CLOSE,
    EXCURSIONS,
    TO_BOUND,
    far,
    median_over_bound,
    of,
    over,
    over_bound,
)
from launcher.reproduce.tables import Claim, Verdict, percent, verdict, with_interval

FEW_FAR: Final = 0.05
"""The share of runs that may be far off where tracking is to be satisfactory."""
SAME: Final = 0.99
OFTEN_SAME: Final = 0.9
EXTREMELY: Final = 10.0
"""By how many times less energy must be spent to be "extremely" little."""
RUNS: Final = 100
"""So many runs without an excursion are asked for."""


def claims(found: Found) -> list[Claim]:
    """All of them."""
    return [*(judge(found) for judge in JUDGES), *roles.claims(found)]


def _two(figure: Interval) -> str:
    return with_interval(figure, lambda value: f"{value:.2f}")


def _share(figure: Interval) -> str:
    return with_interval(figure, percent)


def _told(figures: Mapping[str, Interval], tell: Callable[[Interval], str] = _two) -> str:
    return ", ".join(f"{name} {tell(figure)}" for name, figure in figures.items())


def _in_part(answers: list[bool | None]) -> Verdict:
    """Whether all are true, or at least one."""
    every, some = all_of(answers), any_of(answers)
    if every is None and None in answers:
        return verdict(None)
    return "holds" if every else "holds in part" if some else "does not hold"


def _satisfactory(found: Found) -> Claim:
    gone, ratio = far(found, PAPERS_POLICY, "pf"), median_over_bound(found, PAPERS_POLICY, "pf")
    most = TO_BOUND["pf"]
    return Claim(
        "Scheduling is quite satisfactory, although readings get worse with the distance",
        f"with the paper's policy and PF the median run's error is at most {most:g} of its bound, and at most "
        f"{FEW_FAR:.0%} of the runs are more than {FAR_M:g} m off at some time; in part: one of the two",
        f"error over bound, median run {_two(ratio)}; over {FAR_M:g} m {_share(gone)}",
        _in_part([ratio.at_most(most), gone.at_most(FEW_FAR)]),
    )


def _same(found: Found) -> Claim:
    ours = share_of_steps(found.figures[PAPERS_POLICY]["same set"])
    often = ours.above(OFTEN_SAME)
    every = ours.above(SAME)
    return Claim(
        "PF and UKF activate the same sensors (Fig. 4)",
        f"with the paper's policy in more than {SAME:.0%} of the steps, of the same targets and readings; in part: in "
        f"more than {OFTEN_SAME:.0%}",
        f"in {_share(ours)}; with {FALLBACK} in {_share(share_of_steps(found.figures[FALLBACK]['same set']))}",
        _in_part([often, every]),
    )


def _power(found: Found) -> Claim:
    plain = {by: times_less(found, PAPERS_POLICY, CC2420, by) for by in ACCOUNTS}
    based = {by: times_less(found, PAPERS_POLICY, CC2420, by, baseline=True) for by in ACCOUNTS}
    return Claim(
        "Over all power consumption is extremely low when compared to no scheduling",
        f"with the paper's policy and CC2420 no scheduling takes at least {EXTREMELY:g} times as much, by every "
        "account without the baseline; in part: by one",
        f"times: {_told(plain)}; with the baseline of nodes: {_told(based)}",
        _in_part([ratio.above(EXTREMELY) for ratio in plain.values()]),
    )


def _alike(found: Found) -> Claim:
    ratios = {
        axis: over(*(each_rms(of(found, FALLBACK, kind, "errors")[..., i]) for kind in ("pf", "ukf")))
        for i, axis in enumerate("xy")
    }
    return Claim(
        "(Figs. 5 and 6, without words) PF errs no more than UKF in x and in y",
        f"with {FALLBACK} the error of PF is at most {CLOSE:g} times that of UKF in both; in part: in one",
        f"ratio: {_told(ratios)}",
        _in_part([ratio.at_most(CLOSE) for ratio in ratios.values()]),
    )


def _near_bound(found: Found) -> Claim:
    ratios = {kind: over_bound(found, FALLBACK, kind) for kind in BOTH}
    return Claim(
        "(Not in the paper) With the fallback filters come near the bound",
        "error over bound at most " + ", ".join(f"{limit:g} ({kind})" for kind, limit in TO_BOUND.items()),
        _told(ratios),
        verdict(all_of(ratios[kind].at_most(limit) for kind, limit in TO_BOUND.items())),
    )


def _none_far(found: Found) -> Claim:
    gone, runs = far(found, FALLBACK, "ukf"), len(of(found, FALLBACK, "ukf", "errors"))
    return Claim(
        "(Not in the paper) With the fallback the UKF keeps the target",
        f"no run of at least {RUNS} is more than {FAR_M:g} m off at any time",
        f"{_share(gone)} of {runs} runs; PF {_share(far(found, FALLBACK, 'pf'))}",
        verdict(False if gone.value > 0.0 else True if runs >= RUNS else None),
    )


def _some_far(found: Found) -> Claim:
    shares = {kind: far(found, PAPERS_POLICY, kind) for kind in BOTH}
    return Claim(
        "(Not in the paper) Without it some runs lose the target for a while",
        f"the share of the runs that are more than {FAR_M:g} m off at some time is in {EXCURSIONS}",
        _told(shares, _share),
        verdict(all_of(EXCURSIONS.holds(one) for one in shares.values())),
    )


def _house(found: Found) -> Claim:
    ratio = over(*(each_rms(of(found, name, "ukf", "errors")) for name in (HOUSE, FALLBACK)))
    return Claim(
        "(Not in the paper) A filter that takes accelerations to be held over a step is as good",
        f"its error (fusion.sigma_v = sqrt(q/dt)) is at most {CLOSE:g} of that of a filter with eq. 6, with {FALLBACK}",
        f"ratio: {_two(ratio)}",
        verdict(ratio.at_most(CLOSE)),
    )


def _rarely(found: Found) -> Claim:
    ratio = over(*(each_rms(of(found, name, "ukf", "errors")) for name in (RARELY, FALLBACK)))
    return Claim(
        "(Not in the paper) It does to wake slaves at every 10th step only",
        f"the error of the UKF is at most {CLOSE:g} of that with wakes at every step, with {FALLBACK}",
        f"ratio: {_two(ratio)}; over {FAR_M:g} m {_share(far(found, RARELY, 'ukf'))}",
        verdict(ratio.at_most(CLOSE)),
    )


JUDGES: Final[tuple[Callable[[Found], Claim], ...]] = (
    _satisfactory, _same, _power, _alike, _near_bound, _none_far, _some_far, _house, _rarely,
)  # fmt: skip
