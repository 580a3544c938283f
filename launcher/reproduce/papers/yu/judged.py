"""What Yu et al. (2009) claim, judged by runs through roles and messages."""

from __future__ import annotations

from typing import Final

from launcher.reproduce.intervals import Interval, all_of
from launcher.reproduce.kernels.scores import rmse
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yu.claims import ALIKE, FEW_LOST, MOST_LOST
from launcher.reproduce.papers.yu.lifetimes import FIELDS, PRESENT, TREE, TREE_W, name_of
from launcher.reproduce.papers.yu.messages import done, errors_of, handovers, lost, ratio, saved
from launcher.reproduce.papers.yu.roles import BASE, NEAREST, NEVER_ANEW, R
from launcher.reproduce.papers.yu.tables import BANDS, PUBLISHED
from launcher.reproduce.tables import Claim, percent, verdict, with_interval

NAMES: Final = {"rbpf": f"{R}rbpf", "mrbpf": f"{R}mrbpf", "jm-rbpf": BASE}
ENOUGH: Final = 100
"""Runs of which none may be lost."""
FAR_LESS: Final = 10.0


def claims(found: Found) -> list[Claim]:
    """All of them; none of a study of bare filters alone."""
    return [judge(found) for judge in JUDGES] if done(found) else []


def _m(figure: Interval) -> str:
    return with_interval(figure, unit=" m")


def _table_2(found: Found) -> Claim:
    errors = {name: rmse(errors_of(found, NAMES[name])) for name in PUBLISHED}
    over = ratio(errors_of(found, NAMES["mrbpf"]), errors_of(found, NAMES["rbpf"]))
    bands = all_of((*(BANDS[name].holds(error) for name, error in errors.items()), over.at_most(1)))
    told = "; ".join(f"{name} {_m(error)}, published {PUBLISHED[name]:.1f}" for name, error in errors.items())
    return Claim(
        "Through roles: MRBPF is far better than RBPF (Table 2)",
        f"the error of rbpf lies in {BANDS['rbpf']} m, that of mrbpf in {BANDS['mrbpf']} m, and is less",
        f"{told}; ratio {with_interval(over)}",
        verdict(bands),
    )


def _straight(found: Found) -> Claim:
    other = errors_of(found, NAMES["mrbpf"], "before")
    each = [ratio(errors_of(found, name, "before"), other[: len(errors_of(found, name))])
            for name in (NAMES["rbpf"], NEVER_ANEW)]  # fmt: skip
    return Claim(
        "Through roles: on a straight path RBPF is better",
        "the error of rbpf before the first turn is less than that of mrbpf, with and without starting anew",
        f"ratio {with_interval(each[0])}; never anew {with_interval(each[1])}",
        verdict(all_of(one.at_most(1) for one in each)),
    )


def _turns(found: Found) -> Claim:
    shares = {name: lost(found, NAMES[name]) for name in ("rbpf", "mrbpf")}
    told = ", ".join(f"{name} {with_interval(figure, percent)}" for name, figure in shares.items())
    return Claim(
        "Through roles: RBPF cannot keep up with a turn, MRBPF can",
        f"rbpf loses more than {MOST_LOST:.0%} of the runs, mrbpf at most {FEW_LOST:.0%}",
        f"lost {told}",
        verdict(all_of((shares["rbpf"].above(MOST_LOST), shares["mrbpf"].at_most(FEW_LOST)))),
    )


def _jump(found: Found) -> Claim:
    errors, gone = errors_of(found, BASE), lost(found, BASE)
    none = False if gone.value > 0.0 else True if len(errors) >= ENOUGH else None
    return Claim(
        "(not in the paper) Through roles: with a mode in each particle the target is held",
        f"the error of jm-rbpf is at most {BANDS['jm-rbpf'].high:g} m, and none of at least {ENOUGH} runs is lost",
        f"{_m(rmse(errors))}, lost {with_interval(gone, percent)} of {len(errors)} runs",
        verdict(all_of((BANDS["jm-rbpf"].holds(rmse(errors)), none))),
    )


def _hand_over(found: Found) -> Claim:
    over = ratio(errors_of(found, f"{R}jm-rbpf, hands over: gaussian"), errors_of(found, BASE))
    return Claim(
        "(not in the paper) Through roles: one Gaussian may be handed over instead of one for each mode",
        "the error is at most 5 % higher",
        f"ratio {with_interval(over)}",
        verdict(over.at_most(ALIKE)),
    )


def _sticky(found: Found) -> Claim:
    each = [handovers(found, name) for name in (BASE, NEAREST)]
    pair = [found.figures[name]["handovers"] for name in (BASE, NEAREST)]
    fewer = ratio(pair[0][:, None, None] ** 1.0, pair[1][:, None, None] ** 1.0)
    return Claim(
        "(not in the paper) Through roles: a header that stays while it is chosen hands over less",
        "hand-overs are fewer than if always the nearest leads",
        f"in a step {', '.join(with_interval(one, lambda value: f'{value:.3f}') for one in each)}",
        verdict(fewer.at_most(1)),
    )


def _bytes(found: Found) -> Claim:
    times = saved(found)
    return Claim(
        "Energies can be sent at a much lower rate than the sound itself",
        f"all messages of a step take at most a {FAR_LESS:.0f}th of the bytes of the sound at four sensors",
        f"{with_interval(times)} times less",
        verdict(times.above(FAR_LESS)),
    )


def _energy(found: Found) -> Claim:
    watts = {field: found.figures[name_of(field, PRESENT)]["watts"].max(axis=1) for field in FIELDS}
    most = {field: float(some.mean()) for field, some in watts.items()}
    own, hop = most.values()
    less = own < hop, own < TREE_W
    told = ", ".join(f"{field} {1e3 * one:.1f} mW" for field, one in most.items())
    return Claim(
        "The location-central protocol saves energy and prolongs the lifetime of the network",
        "the sensor that draws most while there is a target draws less than where all that hear the target report to a "
        "centre, in one hop and over a tree; in part: in one of the two",
        f"{told} (one run of each), {TREE} more than {1e3 * TREE_W:.1f} mW (its receivers never sleep)",
        "holds" if all(less) else "holds in part" if any(less) else "does not hold",
    )


JUDGES: Final = (_table_2, _straight, _turns, _jump, _hand_over, _sticky, _bytes, _energy)
