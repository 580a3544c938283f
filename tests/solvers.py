"""What the solvers of passes reach: tables of trials of a noise model, as docs/solvers.md has them.

    python -m tests.solvers [--trials 500]

Errors are the means of location m / speed m/s / heading degrees over the fixes. "Location" compares the points of the
true and the estimated path that are nearest to the sensors' centroid.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from typing import Any, Final

import numpy as np

from tests.passes import PENTAGON, Trials, arcs, trials
from trackfield.filters.passes.bounds import Errors, bound_errors, line_errors
from trackfield.filters.passes.geometry import across, line_of
from trackfield.filters.passes.hermite import hermite
from trackfield.filters.passes.solve import solve, solve_cpa, solve_ecpa
from trackfield.filters.passes.types import REASONS, Passes, Solved
from trackfield.filters.types import Array

SOLVED: Final[dict[str, Callable[[Passes], Solved]]] = {
    "ecpa, eq. 35": solve_ecpa,
    "ecpa, all strengths": lambda passes: solve_ecpa(passes, location="all"),
    "plane": lambda passes: solve("plane", passes),
    "ml": lambda passes: solve("ml", passes),
}
SWEEPS: Final[dict[str, dict[str, Any]]] = {
    "13.4 m/s": {},
    "fast: 30 m/s": {"speed": 30.0, "speed_power": 3.3},
    "slow: 12 m/s": {"speed": 12.0, "speed_power": 3.3},
    "places off by up to 5 m": {"place_error_m": 5.0},
    "largest area: R = 35 m": {"radius_m": 35.0, "distance_power": 1.0},
    "four sensors": {"places": PENTAGON[:4]},
}
NOISES: Final[tuple[tuple[float, float], ...]] = ((0.0, 0.0), (0.01, 0.0), (0.03, 0.0), (0.1, 0.0), (0.1, 5.0))


def errors(field: Trials, answer: Solved) -> Errors:
    return line_errors(answer.mean, field.truth, field.passes.places.mean(axis=1))


def sides(field: Trials) -> Array:
    """(N, K): 1 right of the true path, -1 left."""
    centre = field.true_places.mean(axis=1)
    line = line_of(np.concatenate((field.truth[:, :2] - centre, field.truth[:, 2:]), axis=-1))
    return np.sign(across(line, field.true_places - centre[:, None]))


def success(number: int) -> Iterator[str]:
    """How often CPA and ECPA are right, and why CPA fails; if CPA is told the sides, and if not."""
    yield (
        "| time sd s, places off m | cpa accepts % | cpa right % | why not | sides not told: cpa fixes %, right % "
        "| ecpa right % | ml fixes % | ml right % |"
    )
    yield "|---|---|---|---|---|---|---|---|"
    for time_sd, off in NOISES:
        field = trials(number, time_sd=time_sd, place_error_m=off, strength_sd=0.1 if time_sd else 0.0)
        told = solve_cpa(field.passes, sides=sides(field))
        counts = np.bincount(told.reason, minlength=len(REASONS))
        why = "; ".join(f"{REASONS[k]}: {n}" for k, n in enumerate(counts) if k and n)
        by = [told, *(solve(name, field.passes) for name in ("cpa", "ecpa", "ml"))]
        cells = [(f"{100.0 * np.mean(one.reason == 0):.0f}", f"{100.0 * _right(field, one):.0f}") for one in by]
        (accepts, right), untold, (_, ecpa), (fixes, good) = cells
        shares = f"{', '.join(untold)} | {ecpa} | {fixes} | {good}"
        yield f"| {time_sd:g}, {off:g} | {accepts} | {right} | {why} | {shares} |"


def _right(field: Trials, answer: Solved) -> float:
    off = errors(field, answer)
    return float(np.mean((off.location_m < 5.0) & (off.heading_rad < np.radians(15.0))))


def sweeps(number: int) -> Iterator[str]:
    """The mean errors of each solver."""
    yield f"| | {' | '.join(SOLVED)} |"
    yield f"|---{'|---' * len(SOLVED)}|"
    for name, options in SWEEPS.items():
        field = trials(number, **options)
        cells = []
        for solver in SOLVED.values():
            location, speed, heading = errors(field, solver(field.passes))
            cells.append(f"{np.nanmean(location):.2f}/{np.nanmean(speed):.2f}/{np.degrees(np.nanmean(heading)):.2f}")
        yield f"| {name} | {' | '.join(cells)} |"


def bounds(number: int) -> Iterator[str]:
    """The root mean squares of ml beside the bound, and whether its covariance is right."""
    yield "| | bound, rms | ml, rms | ml / bound | NEES (4) | fixes % |"
    yield "|---|---|---|---|---|---|"
    for name, options in SWEEPS.items():
        field = trials(number, **options)
        answer = solve("ml", field.passes)
        fixed = answer.reason == 0
        least, off = bound_errors(field.truth, field.passes), errors(field, answer)
        rms = [[float(np.sqrt(np.mean(np.square(part[fixed])))) for part in one] for one in (least, off)]
        ratio = "/".join(f"{b / a:.2f}" for a, b in zip(*rms, strict=True))
        for one in rms:
            one[2] = float(np.degrees(one[2]))
        text = ["/".join(f"{part:.2f}" for part in one) for one in rms]
        ahead = field.truth[:, 2:] * (answer.time_s - field.time_s)[:, None]
        away = (answer.mean - field.truth - np.pad(ahead, ((0, 0), (0, 2))))[fixed]
        nees = np.einsum("ni,ni->n", away, np.linalg.solve(answer.covariance[fixed], away[..., None])[..., 0])
        yield f"| {name} | {text[0]} | {text[1]} | {ratio} | {nees.mean():.2f} | {100.0 * fixed.mean():.0f} |"


def bad(number: int) -> Iterator[str]:
    """Late, false and missing reports, and sets that are no pass."""
    field, rng = trials(number), np.random.default_rng(7)
    times = field.passes.times_s
    late, silent, off = (times.copy() for _ in range(3))
    late[:, 2] += 2.0
    silent[:, 3] = np.nan
    off[:, 3] += 0.1
    noisy = times + rng.normal(0.0, 0.1, times.shape)
    random = {f"at random times within {window} s": rng.uniform(0.0, window, times.shape) for window in (3, 5, 10)}
    cases = {
        "all": times,
        "one 2 s late": late,
        "one silent": silent,
        "one clock off by 100 ms": off,
        "all clocks off by 100 ms (sd)": noisy,
    }
    yield "| reports | fixes % | of these with one report left out % | errors |"
    yield "|---|---|---|---|"
    for name, given in (cases | random).items():
        passes = field.passes._replace(times_s=given)
        if name in random:
            passes = passes._replace(strengths=np.exp(rng.normal(0.0, 0.7, times.shape)))
        answer = solve("ml", passes)
        fixed = answer.reason == 0
        location, speed, heading = (np.nanmean(part) for part in errors(field, answer))
        out = 100.0 * np.mean((~answer.used & np.isfinite(given))[fixed].any(axis=1))
        found = "" if name in random else f"{location:.2f}/{speed:.2f}/{np.degrees(heading):.2f}"
        yield f"| {name} | {100.0 * fixed.mean():.0f} | {out:.0f} | {found} |"


def curved(number: int) -> Iterator[str]:
    """How far paths along an arc of R = 100 m are off it, of the arcs on which all events have a fix."""
    field = arcs(number)
    fixes = solve("ml", field.passes)
    all_of = (fixes.reason == 0).all(axis=1)
    every = np.mean(fixes.reason == 0)
    passes = Passes(*(part[all_of] for part in field.passes[:-1]), 0.0)
    fixes = Solved(*(part[all_of] for part in fixes))
    path = hermite(passes, fixes)
    share = np.linspace(0.0, 1.0, 60)
    first, last = (end(passes.times_s, axis=(1, 2))[:, None] for end in (np.min, np.max))
    at = first + (last - first) * share
    near = np.abs(at[..., None] - fixes.time_s[:, None]).argmin(axis=-1)
    mean = np.take_along_axis(fixes.mean, near[..., None], axis=1)
    straight = mean[..., :2] + mean[..., 2:] * (at - np.take_along_axis(fixes.time_s, near, axis=1))[..., None]
    angle = field.speed * at / field.radius_m
    true = field.radius_m * np.stack((np.cos(angle), np.sin(angle)), axis=-1)
    yield f"{100.0 * every:.0f} % of the events have a fix.\n"
    yield f"| path, of {100.0 * all_of.mean():.0f} % of the arcs | off the arc m | off the target m |"
    yield "|---|---|---|"
    for name, places in (("straight fixes", straight), ("Hermite spline", path.at(at)[..., :2])):
        away = np.linalg.norm(places - true, axis=-1)
        yield f"| {name} | {np.nanmean(field.off(places)):.2f} | {np.nanmean(away):.2f} |"


TABLES: Final = (success, sweeps, bounds, bad, curved)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=500)
    number = parser.parse_args().trials
    for table in TABLES:
        assert table.__doc__ is not None
        print(f"\n{table.__doc__}\n", *table(number), sep="\n")


if __name__ == "__main__":
    main()
