"""How many particles, and how much processor time, a bootstrap filter needs for the error of another filter."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from launcher.reproduce.intervals import Interval
from launcher.reproduce.kernels.scores import mean_rmse
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.zhou.experiments import SWEEPS
from launcher.reproduce.papers.zhou.setups import SETUPS
from launcher.reproduce.tables import aligned, plain

RIVALS: Final = ("upf-paper", "upf", "fa-upf", "gpf-ukf")
BOOTSTRAP: Final = "bootstrap"


def needed(found: Found, case: str, kind: str, n: int) -> int | None:
    """The fewest particles of those tried with which a bootstrap filter errs no more than ``kind`` of ``n``.

    None if it takes more than all that were tried.
    """
    limit = swept_error(found, case, kind, n).value
    return next((m for m in SWEEPS[BOOTSTRAP][1] if swept_error(found, case, BOOTSTRAP, m).value <= limit), None)


def particles_over(n: int | None, limit: int) -> bool:
    """Whether at least ``limit`` particles are needed; None are more than all."""
    return n is None or n >= limit


def swept_error(found: Found, case: str, kind: str, n: int) -> Interval:
    """The mean over the steps of the position's RMSE (m), of ``n`` particles."""
    return mean_rmse(found.figures[f"{case}, particles"][f"errors {kind}-{n}"])


def time_us(found: Found, name: str) -> float:
    """Processor time (us) of a step of one run among those of a batch."""
    return 1e6 * min(found.times[name])


def costs(found: Found) -> str:
    """For each setup and filter of 100 particles, what the bootstrap needs for its error; in Markdown."""
    header = (
        "setup", "filter, N = 100", "position, m", "step, us", "bootstrap as good, N", "its step, us", "ratio",
    )  # fmt: skip
    return aligned(header, list(_costs(found)))


def _costs(found: Found) -> Iterator[list[str]]:
    for case in SETUPS:
        for kind in RIVALS:
            own = time_us(found, f"{kind}-100")
            n = needed(found, case, kind, 100)
            row = [case, kind, plain(swept_error(found, case, kind, 100).value), f"{own:.0f}"]
            if n is None:
                yield [*row, f"more than {SWEEPS[BOOTSTRAP][1][-1]}", "-", "-"]
            else:
                other = time_us(found, f"{BOOTSTRAP}-{n}")
                yield [*row, str(n), f"{other:.0f}", f"{other / own:.1f}"]
