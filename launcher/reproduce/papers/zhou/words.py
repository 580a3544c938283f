"""The study of Zhou et al. (2011) in words: its parts in their order, and what the figures show."""

from __future__ import annotations

from typing import Final

from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.zhou.costs import costs
from launcher.reproduce.papers.zhou.setups import SETUPS
from launcher.reproduce.papers.zhou.tables import CLOSE, CONSISTENT, tables, used
from launcher.reproduce.tables import FACTOR, aligned, rows_table, with_interval

TITLES: Final = {
    "bounds": "The posterior bound, beside the prototype's",
    "errors": f"The filters on the three setups (band: at most {CLOSE:g} of the prototype's error; within a factor of "
    f"{FACTOR:g} for filters that are not sound)",
    "published": "Beside the paper's own figures (sec. III-B), on paperlike: the mean over the steps of RMSE(t)",
    "linear": "The same, on a target that moves uniformly and linearly while filters expect accelerations, as in walk",
    "consistency": f"Consistency: the NEES of a filter that knows its errors has a median of {CONSISTENT:.2f}",
    "used": "Particles that count, N_eff / N",
    "tails": "Large errors",
    "particles": "Numbers of particles (up to 100 runs)",
    "costs": "What the same error costs, on paperlike, many runs at once",
    "restarts": "Beginning anew when all particles miss the readings, and going on",
    "rss": "Received signal strength: levels as they are, and made into distances first",
    "outliers": "One reading in ten too large by up to 20 m",
    "smoothing": "A fixed-interval smoother over the UKF's estimates",
    "origin": "Eq. 11 as printed: distances from the origin",
}
"""Of the parts of the report, in their order."""

FIGURES: Final = (
    ("fig01", "RMSE(t) of x on paperlike, with the published means", "means: UPF 2, PF 7"),
    ("fig02", "RMSE(t) of y on paperlike, with the published means", "means: UPF 3, PF 18"),
    ("fig03", "RMSE(t) of vx on paperlike, with the published means", "means: UPF 4, PF 10"),
    ("fig04", "RMSE(t) of vy on paperlike, with the published means", "means: UPF 5, PF 15"),
    ("setups", "RMSE(t) of the position on each setup, and the bound", "nothing"),
    ("particles", "error over the number of particles", "nothing"),
    ("track", "one run of walk and of sharp: nodes, clusters, estimates", "nothing"),
    ("runs", "the share of runs below each error", "nothing"),
)
"""Name, what it shows, and what the paper has of it."""


def parts(found: Found) -> list[tuple[str, str]]:
    """All tables, with their headings."""
    texts = {name: rows_table(rows) for name, rows in tables(found).items()}
    texts |= {"used": _used(found), "costs": costs(found)}
    return [(title, texts[name]) for name, title in TITLES.items()]


def _used(found: Found) -> str:
    names = ("bootstrap-100", "bootstrap-1000", "upf-paper", "upf", "fa-upf", "gpf-ukf")
    rows = [[name, *(with_interval(used(found, case, name)) for case in SETUPS)] for name in names]
    return aligned(("tracker", *SETUPS), rows)
