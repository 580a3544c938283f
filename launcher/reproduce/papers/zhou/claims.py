"""What Zhou et al. (2011) claim, and what a sound form of their filter should reach: each verdict by a stated rule."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from launcher.reproduce.intervals import Interval, all_of, any_of, median
from launcher.reproduce.kernels.scores import mean_rmse, share_lost
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.zhou.costs import needed, particles_over
from launcher.reproduce.papers.zhou.setups import SETUPS, WITHIN
from launcher.reproduce.papers.zhou.tables import CONSISTENT, beside, bound, errors, used_over
from launcher.reproduce.tables import Claim, Verdict, verdict, with_interval

FAR_LESS: Final = 0.5
"""Of the particle filter's error: "far less". The paper's own ratios are 2 / 7 and 3 / 18 (sec. III-B)."""
MORE: Final = 1.1
"""By how many times N_eff has to be larger."""
FEWER: Final = 5
"""By how many times the number of particles is "greatly" reduced."""
TO_BOUND: Final[Mapping[str, float]] = {"walk": 1.2, "sharp": 1.45, "paperlike": 1.55}
"""What ``gpf-ukf`` should reach of the posterior bound."""
FIVE_TIMES: Final = 0.2
FEW_LOST: Final = 0.05
"""The limit where no run should be lost: a hundred runs without a loss show this much."""
SURE: Final = 1.2
"""A median NEES above so many times that of a consistent filter is one of too much confidence."""


def claims(found: Found) -> list[Claim]:
    """All of them."""
    return [judge(found) for judge in JUDGES]


def _two(figure: Interval) -> str:
    return with_interval(figure, lambda value: f"{value:.2f}")


def _share(figure: Interval) -> str:
    return with_interval(figure, lambda value: f"{value:.1%}")


def _told(figures: Mapping[str, Interval], tell: Callable[[Interval], str] = _two) -> str:
    return ", ".join(f"{name} {tell(figure)}" for name, figure in figures.items())


def _in_part(answers: list[bool | None]) -> Verdict:
    """Whether all are true, or at least one."""
    every, some = all_of(answers), any_of(answers)
    if every is None and None in answers:
        return verdict(None)
    return "holds" if every else "holds in part" if some else "does not hold"


def _far_less(found: Found) -> Claim:
    cases = {name: beside(found, name, "upf-paper", "bootstrap-100") for name in (*SETUPS, "linear")}
    return Claim(
        "The errors of UPF are far less than those of PF",
        f"its UPF's error is at most {FAR_LESS:g} of that of a particle filter of as many particles, in each setup; in "
        "part: in some",
        f"ratio: {_told(cases)}; published 0.29 (x), 0.17 (y)",
        _in_part([ratio.at_most(FAR_LESS) for ratio in cases.values()]),
    )


def _utilised(found: Found) -> Claim:
    names = ("upf-paper", "upf")
    ratios = {f"{name} {case}": used_over(found, case, name, "bootstrap-100") for name in names for case in SETUPS}
    return Claim(
        "UPF uses its particles better",
        f"N_eff is more than {MORE:g} times that of a particle filter of as many particles in each setup, with the "
        "paper's UPF and with a sound one; in part: in some",
        f"ratio: {_told(ratios)}",
        _in_part([ratio.above(MORE) for ratio in ratios.values()]),
    )


def _fewer(found: Found) -> Claim:
    cases = {name: needed(found, name, "upf-paper", 100) for name in SETUPS}
    told = {name: "more than all tried" if n is None else str(n) for name, n in cases.items()}
    return Claim(
        "UPF greatly reduces the number of particles",
        f"a particle filter needs at least {FEWER} times as many particles for the error of the paper's UPF of 100, in "
        "each setup; in part: in some",
        "particles needed: " + ", ".join(f"{name} {n}" for name, n in told.items()),
        _in_part([particles_over(n, FEWER * 100) for n in cases.values()]),
    )


def _stable(found: Found) -> Claim:
    cases = {name: share_lost(errors(found, name, "upf-paper"), SETUPS[name].sense_m, WITHIN) for name in SETUPS}
    return Claim(
        "UPF tracks stably",
        f"the paper's UPF loses at most {FEW_LOST:.0%} of the runs of each setup",
        f"lost: {_told(cases, _share)}",
        verdict(all_of(share.at_most(FEW_LOST) for share in cases.values())),
    )


def _twice(found: Found) -> Claim:
    def nees(name: str) -> Interval:
        return median(np.median(found.figures["walk"][f"nees {name}"], axis=1))

    paper, sound = nees("upf-paper"), nees("gpf-ukf")
    return Claim(
        "(Not in the paper) Eq. 6 counts readings twice",
        f"the median NEES of upf-paper on walk is above {SURE:g} times that of a consistent filter, of gpf-ukf not",
        f"upf-paper {_two(paper)}, gpf-ukf {_two(sound)}; consistent {CONSISTENT:.2f}",
        verdict(all_of((paper.above(SURE * CONSISTENT), sound.at_most(SURE * CONSISTENT)))),
    )


def _near_bound(found: Found) -> Claim:
    cases = {
        name: mean_rmse(errors(found, name, "gpf-ukf")).over(bound(found, name, SETUPS[name])) for name in TO_BOUND
    }
    return Claim(
        "(Not in the paper) gpf-ukf comes near the bound",
        "its error is at most "
        + ", ".join(f"{limit:g} ({name})" for name, limit in TO_BOUND.items())
        + " of the bound",
        f"over the bound: {_told(cases)}",
        verdict(all_of(cases[name].at_most(limit) for name, limit in TO_BOUND.items())),
    )


def _sound(found: Found) -> Claim:
    cases = {name: beside(found, name, "upf", "bootstrap-100") for name in ("sharp", "paperlike")}
    return Claim(
        "(Not in the paper) A sound UPF is better than PF by five times where readings are sharp",
        f"the error of upf is at most {FIVE_TIMES:g} of that of bootstrap-100, on sharp and paperlike",
        f"ratio: {_told(cases)}",
        verdict(all_of(ratio.at_most(FIVE_TIMES) for ratio in cases.values())),
    )


def _kept(found: Found) -> Claim:
    cases = {name: share_lost(errors(found, name, "gpf-ukf"), SETUPS[name].sense_m, WITHIN) for name in SETUPS}
    return Claim(
        "(Not in the paper) gpf-ukf loses no run",
        f"at most {FEW_LOST:.0%} of the runs of each setup",
        f"lost: {_told(cases, _share)}",
        verdict(all_of(share.at_most(FEW_LOST) for share in cases.values())),
    )


JUDGES: Final[tuple[Callable[[Found], Claim], ...]] = (
    _far_less, _utilised, _fewer, _stable, _twice, _near_bound, _sound, _kept,
)  # fmt: skip
