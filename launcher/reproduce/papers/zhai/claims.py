"""What Zhai et al. (2009) claim, and whether it holds here: each verdict is computed from figures by a stated rule."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from launcher.reproduce.papers.zhai.cases import NOMINALS, nominals
from launcher.reproduce.papers.zhai.tables import TABLE_1, time_ratio
from launcher.reproduce.scores import Results, Score
from launcher.reproduce.tables import Claim, verdict

PATHS: Final = ("s1", "s2", "s3")
CAUSES: Final = ("s1-narrow", "s2-agile", "s3-agile")
"""The three scenarios with a prior, or a model, that suits a bootstrap filter."""


def claims(results: Results[Score]) -> list[Claim]:
    """All of them."""
    return [judge(results) for judge in JUDGES]


def _tenth(results: Results[Score]) -> Claim:
    def beats(case: str) -> bool:
        ours, rival = _pair(results, case)
        return ours.position <= rival.position and ours.median_run <= rival.median_run

    as_set_up, elsewhere = all(map(beats, PATHS)), all(map(beats, CAUSES))
    own, more = results.scores["s1"]["spcpf"].position, results.scores["s1"]["spcpf-ns2000"].position
    return Claim(
        "A tenth of the particles suffices",
        "SP-CPF(200) errs no more than bootstrap(2000), pooled and in the median run, in s1 to s3; in part: but not "
        "where the bootstrap's prior (s1) or model (s2, s3) suits it",
        f"SP-CPF(200) / bootstrap(2000), pooled (median run), m: {_duels(results, PATHS)}; {_duels(results, CAUSES)}. "
        f"SP-CPF(2000) in s1: {more:.2f} m after {own:.2f} m",
        "does not hold" if not as_set_up else "holds" if elsewhere else "holds in part",
    )


def _pair(results: Results[Score], case: str) -> tuple[Score, Score]:
    return results.scores[case]["spcpf"], results.scores[case]["bootstrap"]


def _duels(results: Results[Score], cases: tuple[str, ...]) -> str:
    def one(score: Score) -> str:
        return f"{score.position:.2f} ({score.median_run:.2f})"

    return ", ".join(f"{case} {' / '.join(map(one, _pair(results, case)))}" for case in cases)


def _bank(results: Results[Score]) -> Claim:
    errors = {n: results.scores["s1"][nominals(n)].position for n in NOMINALS}
    enough = max(errors[n] for n in (10, 15, 20)) <= 1.05 * errors[max(NOMINALS)]
    return Claim(
        "10 ≤ N ≤ 20 is enough",
        "with N = 10, 15 and 20 the error in s1 is at most 5 % above that with N = 40",
        "N: m " + ", ".join(f"{n}: {error:.2f}" for n, error in errors.items()),
        verdict(enough),
    )


def _highest(results: Results[Score]) -> Claim:
    at = {share: results.fields[case] for share, case in ((75, "s1"), (78, "s1-78"), (79, "s1-79"))}
    return Claim(
        "78 % is the highest threshold with a sensor always active",
        "at 78 % at most 1 % of the steps of s1 are without a report, at 79 % more",
        "; ".join(
            f"{share} %: {field.active:.1f} active, one or two in {field.few:.0%} of the steps, none in "
            f"{field.silent:.1%}"
            for share, field in at.items()
        ),
        verdict(at[78].silent <= 0.01 < at[79].silent),
    )


def _similar(results: Results[Score]) -> Claim:
    ratios = {
        name: [results.scores[f"{path}-78"][name].position / results.scores[path]["spcpf"].position for path in PATHS]
        for name in ("spcpf", "spcpf-paper")
    }
    told = (
        f"{name} {', '.join(f'{path} {ratio:.1f}x' for path, ratio in zip(PATHS, some, strict=True))}"
        for name, some in ratios.items()
    )
    return Claim(
        "At 78 % the estimates are similar to those at 75 %",
        "with either weights for steps with a single sensor, SP-CPF errs at most 1.25 times as much in s1, s2 and s3",
        f"error over that at 75 %: {'; '.join(told)}",
        verdict(any(max(some) <= 1.25 for some in ratios.values())),
    )


def _variance(results: Results[Score]) -> Claim:
    ours, rival = _pair(results, "s1")
    return Claim(
        "The error varies less",
        "the variance of RMSE(t) is below the bootstrap's in x and in y, in s1",
        f"x {ours.var_x:.2f} / {rival.var_x:.0f} m², y {ours.var_y:.2f} / {rival.var_y:.0f} m²; published "
        f"{TABLE_1['spcpf']['var_x']:.2f} / {TABLE_1['bootstrap']['var_x']:.0f}, "
        f"{TABLE_1['spcpf']['var_y']:.2f} / {TABLE_1['bootstrap']['var_y']:.0f}",
        verdict(ours.var_x < rival.var_x and ours.var_y < rival.var_y),
    )


def _robust(results: Results[Score]) -> Claim:
    found = {path: results.scores[path]["spcpf"] for path in PATHS}
    kept = all(found[path].lost == 0 and found[path].position <= 2 * found["s1"].position for path in ("s2", "s3"))
    return Claim(
        "Robust to the wrong model",
        "no run of s2 and s3 is lost, and the error is at most twice that of s1",
        ", ".join(
            f"{path} {score.position:.2f} m, lost {score.lost:.1%}, at most {score.largest:.0f} m"
            for path, score in found.items()
        ),
        verdict(kept),
    )


def _loses(results: Results[Score]) -> Claim:
    lost = {path: results.scores[path]["bootstrap"].lost for path in ("s2", "s3")}
    return Claim(
        "The bootstrap loses manoeuvring targets",
        "bootstrap(2000) loses more than 80 % of the runs of s2 and of s3",
        ", ".join(f"{path} {share:.0%}" for path, share in lost.items())
        + "; with the acceleration that its model expects raised to 1.5 m/s²: "
        + ", ".join(f"{path} {results.scores[f'{path}-agile']['bootstrap'].lost:.0%}" for path in lost),
        verdict(min(lost.values()) > 0.8),
    )


def _cheaper(results: Results[Score]) -> Claim:
    ours = time_ratio(results.times)
    published = time_ratio({name: row["time"] for name, row in TABLE_1.items()})
    return Claim(
        "Cheaper than the bootstrap",
        "SP-CPF(200) takes less processor time than bootstrap(2000) on the same reports",
        f"{ours:.2f} of the bootstrap's; published {published:.2f}",
        verdict(ours < 1),
    )


def _radar(results: Results[Score]) -> Claim:
    found = results.scores["radar"]
    names = ("spcpf", "spcpf-paper", "ekf", "bootstrap", "predict-only")
    ours = min(found["spcpf"].position, found["spcpf-paper"].position)
    better = ours < min(found["ekf"].position, found["bootstrap"].position)
    return Claim(
        "With a single radar, closer than EKF and bootstrap",
        "with either weights for a single sensor, SP-CPF errs less than both",
        ", ".join(f"{name} {found[name].position:.0f} m" for name in names),
        verdict(better),
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
