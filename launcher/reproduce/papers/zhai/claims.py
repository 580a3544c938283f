"""What Zhai et al. (2009) claim, and whether it holds here: each verdict is computed from figures by a stated rule."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from launcher.reproduce.intervals import Interval, all_of, any_of
from launcher.reproduce.papers.zhai.cases import NOMINALS, nominals
from launcher.reproduce.papers.zhai.contrasts import (
    CAUSES,
    ENOUGH,
    PATHS,
    RADAR_RIVALS,
    TIME,
    WEIGHTS,
    closer,
    ratio,
    silent,
    variance,
)
from launcher.reproduce.papers.zhai.tables import FEW_LOST, TABLE_1, time_ratio
from launcher.reproduce.scores import Results, Score
from launcher.reproduce.tables import Claim, Verdict, percent, verdict, with_interval

ALIKE: Final = 1.05
SIMILAR: Final = 1.25
MOST_LOST: Final = 0.8
FEW_SILENT: Final = 0.01


def claims(results: Results[Score]) -> list[Claim]:
    """All of them."""
    return [judge(results) for judge in JUDGES]


def _times(figure: Interval) -> str:
    return with_interval(figure, lambda value: f"{value:.2f}")


def _share(figure: Interval) -> str:
    return with_interval(figure, lambda value: f"{value:.0%}")


def _told(figures: dict[str, Interval]) -> str:
    return ", ".join(f"{name} {_times(figure)}" for name, figure in figures.items())


def _tenth(results: Results[Score]) -> Claim:
    def beats(case: str) -> bool | None:
        error, share = results.contrasts[ratio(case, "spcpf", case, "bootstrap")], results.contrasts[closer(case)]
        return all_of((error.at_most(1), share.above(0.5)))

    def duel(case: str) -> str:
        error, share = results.contrasts[ratio(case, "spcpf", case, "bootstrap")], results.contrasts[closer(case)]
        return f"{case} {_times(error)}, {_share(share)}"

    as_set_up, elsewhere = all_of(map(beats, PATHS)), all_of(map(beats, CAUSES))
    more = results.scores["s1"]["spcpf-ns2000"].interval("position")
    part: Verdict = "holds" if elsewhere else "holds in part"
    open_yet = as_set_up is None or (as_set_up and elsewhere is None)
    return Claim(
        "A tenth of the particles suffices",
        "the error of SP-CPF(200) is at most that of bootstrap(2000), over all runs and in most of them, in s1 to s3; "
        "in part: but not where the bootstrap's prior (s1) or model (s2, s3) suits it",
        f"error of SP-CPF(200) over that of bootstrap(2000), share of the runs in which it is at most 1: "
        f"{'; '.join(map(duel, (*PATHS, *CAUSES)))}. SP-CPF(2000) in s1: {_times(more)} m",
        verdict(None) if open_yet else part if as_set_up else "does not hold",
    )


def _bank(results: Results[Score]) -> Claim:
    largest = nominals(max(NOMINALS))
    found = {f"N = {n}": results.contrasts[ratio("s1", nominals(n), "s1", largest)] for n in ENOUGH}
    errors = ", ".join(f"{n}: {results.scores['s1'][nominals(n)].position:.2f}" for n in NOMINALS)
    return Claim(
        "10 ≤ N ≤ 20 is enough",
        "with N = 10, 15 and 20 the error in s1 is at most 5 % above that with N = 40",
        f"error over that with N = {max(NOMINALS)}: {_told(found)}; N: m {errors}",
        verdict(all_of(figure.at_most(ALIKE) for figure in found.values())),
    )


def _highest(results: Results[Score]) -> Claim:
    at = {share: results.fields[case] for share, case in ((75, "s1"), (78, "s1-78"), (79, "s1-79"))}
    none = {share: results.contrasts[silent(f"s1-{share}")] for share in (78, 79)}
    return Claim(
        "78 % is the highest threshold with a sensor always active",
        "at 78 % at most 1 % of the steps of s1 are without a report, at 79 % more",
        "; ".join(
            f"{share} %: {field.active:.1f} active, one or two in {field.few:.0%} of the steps, none in "
            + (with_interval(none[share], percent) if share in none else percent(field.silent))
            for share, field in at.items()
        ),
        verdict(all_of((none[78].at_most(FEW_SILENT), none[79].above(FEW_SILENT)))),
    )


def _similar(results: Results[Score]) -> Claim:
    found = {
        name: {path: results.contrasts[ratio(f"{path}-78", name, path, "spcpf")] for path in PATHS} for name in WEIGHTS
    }
    return Claim(
        "At 78 % the estimates are similar to those at 75 %",
        "with either weights for steps with a single sensor, the error of SP-CPF is at most 1.25 times as large in s1, "
        "s2 and s3",
        f"error over that at 75 %: {'; '.join(f'{name} {_told(some)}' for name, some in found.items())}",
        verdict(any_of(all_of(one.at_most(SIMILAR) for one in some.values()) for some in found.values())),
    )


def _variance(results: Results[Score]) -> Claim:
    ours, rival = results.scores["s1"]["spcpf"], results.scores["s1"]["bootstrap"]
    ratios = {axis: results.contrasts[variance(axis)] for axis in "xy"}
    return Claim(
        "The error varies less",
        "the variance of RMSE(t) is below the bootstrap's in x and in y, in s1",
        f"x {ours.var_x:.2f} / {rival.var_x:.0f} m², y {ours.var_y:.2f} / {rival.var_y:.0f} m², the ratio "
        f"{', '.join(f'{axis} {with_interval(one)}' for axis, one in ratios.items())}; published "
        f"{TABLE_1['spcpf']['var_x']:.2f} / {TABLE_1['bootstrap']['var_x']:.0f}, "
        f"{TABLE_1['spcpf']['var_y']:.2f} / {TABLE_1['bootstrap']['var_y']:.0f}",
        verdict(all_of(one.at_most(1) for one in ratios.values())),
    )


def _robust(results: Results[Score]) -> Claim:
    paths = PATHS[1:]
    ratios = {path: results.contrasts[ratio(path, "spcpf", "s1", "spcpf")] for path in paths}
    lost = {path: results.scores[path]["spcpf"].interval("lost") for path in paths}
    kept = (figure.at_most(FEW_LOST) for figure in lost.values())
    return Claim(
        "Robust to the wrong model",
        f"at most {FEW_LOST:.0%} of the runs of s2 and s3 are lost, and the error is at most twice that of s1",
        f"error over that in s1: {_told(ratios)}; "
        + "; ".join(
            f"{path} lost {with_interval(lost[path], percent)}, at most {results.scores[path]['spcpf'].largest:.0f} m"
            for path in paths
        ),
        verdict(all_of((*kept, *(figure.at_most(2) for figure in ratios.values())))),
    )


def _loses(results: Results[Score]) -> Claim:
    lost = {path: results.scores[path]["bootstrap"].interval("lost") for path in PATHS[1:]}
    agile = {path: results.scores[f"{path}-agile"]["bootstrap"].interval("lost") for path in lost}
    return Claim(
        "The bootstrap loses manoeuvring targets",
        f"bootstrap(2000) loses more than {MOST_LOST:.0%} of the runs of s2 and of s3",
        ", ".join(f"{path} {_share(figure)}" for path, figure in lost.items())
        + "; with the acceleration that its model expects raised to 1.5 m/s²: "
        + ", ".join(f"{path} {_share(figure)}" for path, figure in agile.items()),
        verdict(all_of(figure.above(MOST_LOST) for figure in lost.values())),
    )


def _cheaper(results: Results[Score]) -> Claim:
    ours = results.contrasts[TIME]
    published = time_ratio({name: row["time"] for name, row in TABLE_1.items()})
    return Claim(
        "Cheaper than the bootstrap",
        "SP-CPF(200) takes less processor time than bootstrap(2000) on the same reports",
        f"{_times(ours)} of the bootstrap's, over repeated measurements; published {published:.2f}",
        verdict(ours.at_most(1)),
    )


def _radar(results: Results[Score]) -> Claim:
    found = {
        name: {f"/ {rival}": results.contrasts[ratio("radar", name, "radar", rival)] for rival in RADAR_RIVALS}
        for name in WEIGHTS
    }
    errors = {name: results.scores["radar"][name].position for name in (*WEIGHTS, *RADAR_RIVALS, "predict-only")}
    return Claim(
        "With a single radar, closer than EKF and bootstrap",
        "with either weights for a single sensor, the error of SP-CPF is less than that of both",
        f"ratio of errors: {'; '.join(f'{name} {_told(some)}' for name, some in found.items())}; "
        + ", ".join(f"{name} {error:.0f} m" for name, error in errors.items()),
        verdict(any_of(all_of(one.at_most(1) for one in some.values()) for some in found.values())),
    )


JUDGES: Final[tuple[Callable[[Results[Score]], Claim], ...]] = (
    _tenth,
    _bank,
    _highest,
    _similar,
    _variance,
    _robust,
    _loses,
    _cheaper,
    _radar,
)
