"""All pictures of a study: drawn, and written into ``plots/``."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from launcher.study.axes import TRACKER, Axis
from launcher.study.pictures.effects import axis_picture
from launcher.study.pictures.look import styled
from launcher.study.pictures.pareto import default_pair, front_of, pareto_picture
from launcher.study.summary import Summary
from trackfield.errors import ScenarioError

PLOTS: Final = "plots"
PARETO: Final = "pareto"


def draw(summary: Summary, folder: Path, pareto: tuple[str, str] | None = None) -> dict[str, Path]:
    """Write ``plots/<key>.png`` for each axis and ``plots/pareto.png``, in place of earlier ones; the files by name.

    There is no front if its figures do not differ; without axes, the trackers are the axis.
    """
    (folder / PLOTS).mkdir(exist_ok=True)
    for old in (folder / PLOTS).glob("*.png"):
        old.unlink()
    drawn = {}
    front = front_of(summary, *(pareto or default_pair(summary)))
    figures = {axis.key: axis_picture(summary, axis) for axis in pictured(summary)}
    if pareto or front.worth_it:
        figures[PARETO] = pareto_picture(front)
    for name, figure in figures.items():
        drawn[name] = folder / PLOTS / f"{name}.png"
        with styled():
            figure.savefig(drawn[name])
    return drawn


def pictured(summary: Summary) -> tuple[Axis, ...]:
    """The axes that have a picture each: the varied keys, or else the trackers."""
    return summary.axes or (Axis(TRACKER, summary.trackers),)


def axis_of(summary: Summary, key: str | None) -> Axis:
    """The pictured axis of this key, or the first. Raises ``ScenarioError`` if there is no such axis."""
    axes = {axis.key: axis for axis in pictured(summary)}
    if key is not None and key not in axes:
        raise ScenarioError(f"{key!r} is not varied", key="axis", expected=f"one of {', '.join(axes)}")
    return axes[key] if key is not None else next(iter(axes.values()))
