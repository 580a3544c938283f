"""What a reader must know before comparing figures of runs, in sentences."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from typing import Any

from launcher.record.words import alarms
from launcher.study.comparison.rows import setting
from launcher.study.comparison.runs import Compared


def remarks(compared: Compared) -> list[str]:
    """What makes a comparison of these runs doubtful."""
    return [*_chance(compared), *_targets(compared), *_alarms(compared)]


def _chance(compared: Compared) -> Iterator[str]:
    """A single seed shows nothing certain; with the same scenario and seed, differences are not due to chance."""
    if not compared.settings:
        yield (
            "All runs have the same scenario and seed: what differs is the driver or the machine. "
            "`trackfield compare RUN RUN --exact 0` checks whether they are the same."
        )
        return
    seeds = list(dict.fromkeys(metrics["seed"] for metrics in compared.metrics))
    drawn = f"seed {seeds[0]}" if len(seeds) == 1 else f"seeds {', '.join(map(str, seeds))}"
    yield (
        f"Each run is one draw of the random numbers ({drawn}): a lower figure may be chance. "
        f"`{_study(compared)}` gives confidence intervals over many seeds."
    )


def _study(compared: Compared) -> str:
    """The command that separates an effect from chance, ready to run if a single key was varied."""
    varied = {key: values for key, values in compared.settings.items() if key != "seed"}
    scenario = f"{shlex.quote(str(compared.folders[0]))}/scenario.toml"
    if not varied:
        return f"trackfield study {scenario} --seeds 20"
    key, values = next(iter(varied.items()))
    known = [value for value in dict.fromkeys(map(setting, values)) if len(varied) == 1 and _short(values)]
    vary = f"{key}={','.join(known)}" if known else "KEY=A,B"
    return f"trackfield study {scenario} --seeds 20 --vary {shlex.quote(vary)}"


def _short(values: Sequence[Any]) -> bool:
    """Whether all can stand on a command line, separated by commas."""
    return all(isinstance(value, str | int | float) and "," not in str(value) for value in values)


def _targets(compared: Compared) -> Iterator[str]:
    for name in compared.without_truth:
        yield f"{name}: its recording does not say where the target was, so there are no errors."
    if not compared.same_target:
        yield (
            "The targets of these runs take different paths: each error is measured against the truth of its own run, "
            "and no lowest error is marked. An error divided by the bound of its run can be compared."
        )
    if not compared.same_length:
        lengths = ", ".join(f"{name} {s:g} s" for name, s in zip(compared.names, compared.lengths_s, strict=True))
        yield (
            f"The runs differ in length ({lengths}): each figure is over the steps of its own run, and sums over a "
            "run (bytes, energy) are not marked."
        )


def _alarms(compared: Compared) -> Iterator[str]:
    for name, metrics in zip(compared.names, compared.metrics, strict=True):
        if not metrics["complete"]:
            why, ended_s = metrics["end_reason"], metrics["ended_s"]
            yield f"{name}: the run ended early, {ended_s:.1f} s after its first step ({why})."
        yield from (f"{name}: {alarm}." for alarm in alarms(dict(metrics)))
