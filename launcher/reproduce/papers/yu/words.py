"""The study of Yu et al. (2009) in words: the parts of its report in their order, and what the figures show."""

from __future__ import annotations

from typing import Final

from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yu import dimension, messages
from launcher.reproduce.papers.yu.experiments import CASES, RULE, WINDOW_S
from launcher.reproduce.papers.yu.tables import consistency, crossings, filters, headers, published, ratios, sound

DRAWS: Final = {
    "multinomial draw of modes": ("mrbpf, multinomial", "mrbpf"),
    "multinomial draw, weight mass": ("mrbpf-weightmass, multinomial", "mrbpf-weightmass"),
    "multinomial draw, a mode in each particle": ("jm-rbpf, multinomial", "jm-rbpf"),
    "one draw and the mass of weights, instead of Table 1": ("mrbpf-weightmass", "mrbpf"),
    "a mode in each particle, instead of a common probability": ("jm-rbpf", "mrbpf-weightmass"),
    "velocities in particles": ("bootstrap, modes", "jm-rbpf"),
    "unknown rates of turns": ("jm-rbpf, unknown rate", "jm-rbpf"),
    "six sensors instead of four": ("jm-rbpf, 6 sensors", "jm-rbpf"),
    "eight sensors instead of four": ("jm-rbpf, 8 sensors", "jm-rbpf"),
    "handing Gaussians over": ("jm-rbpf, hands over", "jm-rbpf"),
}
SOUND: Final = ("jm-rbpf", *(name for name in CASES if name.split(", ")[-1] in ("ignored", "compensated")))

FIGURES: Final = (
    ("fig02", "RMSE(t) of all runs, with the bound", "RBPF below MRBPF until the turn, then far above"),
    ("fig03", "a typical run", "RBPF astray after the turn, MRBPF on the path"),
    ("fig02-roles", "the same through roles and messages", "as fig02"),
    ("fig03-roles", "a typical run of them", "as fig03"),
    ("crossing", "two targets that cross, a typical run", "no figure"),
)
"""Name, what it shows, and what the paper has of it."""


def parts(found: Found) -> list[tuple[str, str]]:
    """All tables, with their headings."""
    return [
        ("Table 2", published(found)),
        (
            f"All filters (lost: {RULE.beyond_m:g} m off for {RULE.steps} steps in a row)",
            filters(found),
        ),
        ("What it costs or saves, run by run", ratios(found, DRAWS)),
        (f"The delay of sound, and a window of {WINDOW_S:g} s", sound(found, SOUND)),
        ("Two targets that cross", crossings(found)),
        ("Hand-overs", headers(found)),
        ("Velocities outside of the particles", dimension.table(found)),
        ("Are errors as large as covariances say? (2 if they are)", consistency(found)),
        *messages.parts(found),
    ]
