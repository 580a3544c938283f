"""What a reader must know before he compares figures of runs, in sentences."""

from __future__ import annotations

from collections.abc import Iterator

from launcher.record.words import alarms
from launcher.study.comparison.runs import Compared


def remarks(compared: Compared) -> list[str]:
    """What makes a comparison of these runs doubtful, and what is compared all the same."""
    return [*_chance(compared), *_targets(compared), *_alarms(compared)]


def _chance(compared: Compared) -> Iterator[str]:
    """That one seed proves nothing; of the same scenario and seed there is no chance in what differs."""
    seeds = [metrics["seed"] for metrics in compared.metrics]
    if not compared.settings:
        yield (
            "All runs have the same scenario and seed: what differs is the driver or the machine. "
            "trackfield compare RUN RUN --exact 0 says whether they are the same."
        )
        return
    one = f"one seed ({seeds[0]})" if len(set(seeds)) == 1 else "one seed each"
    yield (
        f"This is {one}: a lower figure in a single run may be chance. "
        f"{_study(compared)} gives confidence intervals over many seeds."
    )


def _study(compared: Compared) -> str:
    """The command that tells chance from effect, as far as the runs say what was varied."""
    varied = {key: values for key, values in compared.settings.items() if key != "seed"}
    key, *more = varied or ["KEY"]
    values = varied.get(key, ())
    plain = not more and len(set(map(str, values))) == len(values) and all(isinstance(v, str | int | float) for v in values)
    vary = f"{key}={','.join(map(str, values))}" if plain and values else "KEY=A,B"
    return f"trackfield study SCENARIO --seeds 20{f' --vary {vary}' if varied else ''}"


def _targets(compared: Compared) -> Iterator[str]:
    if not compared.same_target:
        yield (
            "The targets of these runs take different paths: each error is measured against the truth of its own run, "
            "and no lowest error is marked. An error divided by the bound of its run can be compared."
        )
    if not compared.same_length:
        lengths = ", ".join(f"{name} {s:g} s" for name, s in zip(compared.names, compared.lengths_s, strict=True))
        yield (
            f"The runs are not equally long ({lengths}): each figure is over the steps of its own run, and sums over a "
            "run (bytes, energy) are not marked."
        )


def _alarms(compared: Compared) -> Iterator[str]:
    for name, metrics in zip(compared.names, compared.metrics, strict=True):
        yield from (f"{name}: {alarm}." for alarm in alarms(dict(metrics)))
