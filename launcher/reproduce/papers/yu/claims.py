"""What Yu et al. (2009) claim, and what the filters put right reach; each verdict is computed by a stated rule."""

from __future__ import annotations

from typing import Final

from launcher.reproduce.intervals import Interval, all_of, share
from launcher.reproduce.kernels import scores
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yu.experiments import CROSSING_PARTICLES, crossing
from launcher.reproduce.papers.yu.tables import BANDS, PUBLISHED, errors_of, lost
from launcher.reproduce.tables import Claim, percent, verdict, with_interval

MOST_LOST: Final = 0.5
FEW_LOST: Final = 0.05
HELD: Final = 0.95
ALIKE: Final = 1.05


def claims(found: Found) -> list[Claim]:
    """All of them."""
    return [judge(found) for judge in (_table_2, _straight, _turns, _jump, _rates, _hand_over, _crossing)]


def _m(figure: Interval) -> str:
    return with_interval(figure, unit=" m")


def _table_2(found: Found) -> Claim:
    errors = {name: scores.rmse(errors_of(found, name)) for name in PUBLISHED}
    ratio = scores.ratio(errors_of(found, "mrbpf"), errors_of(found, "rbpf"))
    bands = all_of((*(BANDS[name].holds(error) for name, error in errors.items()), ratio.at_most(1)))
    told = "; ".join(f"{name} {_m(error)}, published {PUBLISHED[name]:.1f}" for name, error in errors.items())
    return Claim(
        "MRBPF is far better than RBPF (Table 2)",
        f"the error of rbpf lies in {BANDS['rbpf']} m, that of mrbpf in {BANDS['mrbpf']} m, and is less",
        f"{told}; ratio {with_interval(ratio)}",
        verdict(bands),
    )


def _straight(found: Found) -> Claim:
    ratio = scores.ratio(errors_of(found, "rbpf", "before"), errors_of(found, "mrbpf", "before"))
    return Claim(
        "On a straight path RBPF is better",
        "the error of rbpf before the first turn is less than that of mrbpf",
        f"ratio {with_interval(ratio)}",
        verdict(ratio.at_most(1)),
    )


def _turns(found: Found) -> Claim:
    shares = {name: lost(found, name) for name in ("rbpf", "mrbpf")}
    told = ", ".join(f"{name} {with_interval(figure, percent)}" for name, figure in shares.items())
    return Claim(
        "RBPF cannot keep up with a turn, MRBPF can",
        f"rbpf loses more than {MOST_LOST:.0%} of the runs, mrbpf at most {FEW_LOST:.0%}",
        f"lost {told}",
        verdict(all_of((shares["rbpf"].above(MOST_LOST), shares["mrbpf"].at_most(FEW_LOST)))),
    )


def _jump(found: Found) -> Claim:
    error, gone = scores.rmse(errors_of(found, "jm-rbpf")), lost(found, "jm-rbpf")
    return Claim(
        "(not in the paper) With a mode in each particle the target is held",
        f"the error of jm-rbpf is at most {BANDS['jm-rbpf'].high:g} m, and no run is lost",
        f"{_m(error)}, lost {with_interval(gone, percent)}",
        verdict(all_of((BANDS["jm-rbpf"].holds(error), gone.value == 0.0))),
    )


def _rates(found: Found) -> Claim:
    ratio = scores.ratio(errors_of(found, "jm-rbpf, unknown rate"), errors_of(found, "jm-rbpf"))
    return Claim(
        "(not in the paper) The rates of turns need not be known",
        "the error with rates drawn from up to 70 degrees a second is at most 5 % above that with the true ones",
        f"ratio {with_interval(ratio)}",
        verdict(ratio.at_most(ALIKE)),
    )


def _hand_over(found: Found) -> Claim:
    ratio = scores.ratio(errors_of(found, "jm-rbpf, hands over"), errors_of(found, "jm-rbpf"))
    return Claim(
        "(not in the paper) A header need not hand its particles over",
        "the error with a Gaussian for each mode (252 bytes) instead is at most 5 % higher",
        f"ratio {with_interval(ratio)}",
        verdict(ratio.at_most(ALIKE)),
    )


def _crossing(found: Found) -> Claim:
    figures = {n: found.figures[crossing(n)] for n in CROSSING_PARTICLES}
    held = {n: share(int((1.0 - one["lost"]).sum()), len(one["lost"])) for n, one in figures.items()}
    swaps = ", ".join(f"{n}: {percent(float(one['swapped'].mean()))}" for n, one in figures.items())
    most = max(CROSSING_PARTICLES)
    return Claim(
        "Energies of several targets add up (1): two that cross are held",
        f"with {most} particles both targets are held in at least {HELD:.0%} of the runs",
        f"held {', '.join(f'{n}: {with_interval(one, percent)}' for n, one in held.items())}; swapped {swaps}",
        verdict(held[most].value >= HELD),
    )
