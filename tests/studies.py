"""What clocks, thresholds, faults and energy accounts do to the packaged scenarios: the tables of docs/studies.md.

    python -m tests.studies [clocks] [thresholds] [faults] [energy] [--runs 20]

Each row is so many runs in virtual time, with seeds from 1 on: another seed is another radio, other noise, and for the
path s1 and for a share of the field another path and another share. All of it is about the default tracker.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from math import hypot, inf
from statistics import fmean
from typing import Any, Final, NamedTuple

import numpy as np

from launcher.plan.prepare import load, planned
from launcher.record.figures.verdict import LOST, TRACKED, WITH_GAPS
from launcher.record.ledger import Ledger
from launcher.record.metrics import Metrics, run_metrics
from tests.simulated import simulated
from trackfield.role import Corrected
from trackfield.tracking.threshold import position_sd

DAY_S: Final = 86_400.0


# --- runs -------------------------------------------------------------------------------------------------------------


class Way(NamedTuple):
    """A packaged scenario with some of its keys set."""

    scenario: str
    settings: tuple[str, ...] = ()


class Outcome(NamedTuple):
    """A run of a way: position errors (m) and their sd along the worst axis (m), step by step where there is a track.

    ``blank`` counts the steps without one; ``clock_ms`` has the error of the sender's clock for each report,
    ``set_ms`` of those whose sender had set its clock before.
    """

    way: Way
    errors: tuple[float, ...]
    sds: tuple[float, ...]
    blank: int
    clock_ms: tuple[float, ...]
    set_ms: tuple[float, ...]
    metrics: Metrics

    def of(self, *keys: str) -> Any:
        """A figure of metrics.json."""
        found: Any = self.metrics
        for key in keys:
            found = found[key]
        return found


def outcome(way: Way, seed: int) -> Outcome:
    """Run it."""
    plan = planned(load(way.scenario, seed=seed, settings=way.settings, trackers=["imm-ukf"]))
    ledger, tracks = simulated(plan)
    known = [(row.point, row.truth) for row in tracks if row.point.mean and row.truth]
    clocks = {key: abs(error) / 1e6 for key, error in ledger.clock_errors.items()}
    first = first_set(ledger)
    return Outcome(
        way,
        tuple(hypot(point.mean[0] - truth[0], point.mean[1] - truth[1]) for point, truth in known),
        tuple(position_sd(point) for point, _ in known),
        plan.run.end_ns // plan.step_ns - 1 - len(known),
        tuple(clocks.values()),
        tuple(error for (sent_ns, src), error in clocks.items() if sent_ns > first.get(src, inf)),
        run_metrics(plan, ledger, tracks),
    )


def first_set(ledger: Ledger) -> dict[str, int]:
    """When (ns) each node that has learnt the time learnt it first."""
    told = ((d.spec.id, o.key[0]) for d in ledger.diaries.values() for o in d.told if isinstance(o.effect, Corrected))
    return dict(sorted(told, reverse=True))


# --- figures of a row -------------------------------------------------------------------------------------------------

Figure = Callable[[Sequence[Outcome]], str]


def rms(values: Sequence[float]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def joined(outcomes: Sequence[Outcome], field: str) -> list[float]:
    """This field of all runs, one after the other."""
    return [value for one in outcomes for value in getattr(one, field)]


def rmse(outcomes: Sequence[Outcome]) -> str:
    return f"{rms(joined(outcomes, 'errors')):.2f}"


def largest(outcomes: Sequence[Outcome]) -> str:
    return f"{max(joined(outcomes, 'errors')):.0f}"


def verdicts(outcomes: Sequence[Outcome]) -> str:
    """How many runs were tracked, tracked with gaps, and lost."""
    found = Counter(one.of("trackers", "imm-ukf", "verdict") for one in outcomes)
    return " / ".join(str(found[verdict]) for verdict in (TRACKED, WITH_GAPS, LOST))


def blank(outcomes: Sequence[Outcome]) -> str:
    return f"{fmean(one.blank for one in outcomes):.1f}"


def mean(*keys: str, scale: float = 1.0, digits: int = 0) -> Figure:
    """The mean over the runs of a figure of metrics.json; - where there is none."""

    def figure(outcomes: Sequence[Outcome]) -> str:
        values = [one.of(*keys) for one in outcomes]
        return "-" if None in values else f"{scale * fmean(values):.{digits}f}"

    return figure


def clock(field: str, summary: Callable[[list[float]], float]) -> Figure:
    """Of the clocks' errors in all runs; - where there are none."""
    return lambda outcomes: f"{summary(found):.1f}" if (found := joined(outcomes, field)) else "-"


def set_before(outcomes: Sequence[Outcome]) -> str:
    """Of all reports, those whose sender had set its clock."""
    reports = joined(outcomes, "clock_ms")
    return f"{100 * len(joined(outcomes, 'set_ms')) / len(reports):.0f}" if reports else "-"


def sent(*kinds: str) -> Figure:
    """Transmissions of these kinds in a run."""

    def figure(outcomes: Sequence[Outcome]) -> str:
        counts = [one.of("frames", "by_kind") for one in outcomes]
        return f"{fmean(sum(count[kind]['sent'] for kind in kinds if kind in count) for count in counts):.0f}"

    return figure


def spent(*causes: str, scale: float = 1.0, digits: int = 2) -> Figure:
    """What the sensor nodes spent for these in a run."""

    def figure(outcomes: Sequence[Outcome]) -> str:
        return (
            f"{scale * fmean(sum(one.of('energy_j', 'by', cause) for cause in causes) for one in outcomes):.{digits}f}"
        )

    return figure


def active(outcomes: Sequence[Outcome]) -> str:
    """Reports in a step."""
    steps = sum(len(one.errors) + one.blank for one in outcomes)
    return f"{sum(one.of('frames', 'by_kind', 'doa', 'sent') for one in outcomes) / steps:.1f}"


def on_path(target: str) -> Figure:
    """The error of the runs on one path."""
    return lambda outcomes: rmse([one for one in outcomes if f"target.path={target}" in one.way.settings])


def worst_sd(quantile: float) -> Figure:
    return lambda outcomes: f"{float(np.quantile(joined(outcomes, 'sds'), quantile)):.2f}"


# --- studies ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Study:
    """Rows, each of one or more ways, under names for its first columns; and tables of figures about them."""

    names: tuple[str, ...]
    rows: Mapping[tuple[str, ...], tuple[Way, ...]]
    tables: tuple[Mapping[str, Figure], ...]


def spcpf(target: str, *settings: str) -> Way:
    return Way("zhai-spcpf", (f"target.path={target}", *settings))


def _clocks() -> Study:
    fields = {"zhai-spcpf s1": spcpf("s1"), "zhai-spcpf s2": spcpf("s2"), "bus": Way("bus")}
    clocks = {("right", "-"): ("clock.offset_ms=0", "clock.drift_ppm=0")} | {
        (f"{offset} ms", sync): (f"clock.offset_ms={offset}", "clock.drift_ppm=20", f"clock.sync={value}")
        for offset in (20, 100, 300)
        for sync, value in (("on", "true"), ("off", "false"))
    }
    rows = {
        (field, *name): (Way(way.scenario, way.settings + settings),)
        for field, way in fields.items()
        for name, settings in clocks.items()
    }
    figures = {
        "RMSE, m": rmse,
        "largest, m": largest,
        "tracked / with gaps / lost": verdicts,
        "clock rms, ms": clock("clock_ms", rms),
        "max": clock("clock_ms", max),
        "set before, %": set_before,
        "then rms, ms": clock("set_ms", rms),
        "then max": clock("set_ms", max),
        "late reports": mean("frames", "late"),
        "sync frames": sent("sync-request", "sync-reply"),
        "radio, J": spent("send", "receive", "listen"),
    }
    return Study(("scenario", "clocks", "sync"), rows, (figures,))


def _thresholds() -> Study:
    ways: dict[str, tuple[str, ...]] = {f"{share:.2f}": (f"sensor.threshold={share}",) for share in (0.72, 0.75, 0.78)}
    for sd_m in (1.5, 3.0):
        ways[f"adaptive, {sd_m:g} m"] = ("sensor.threshold=adaptive", f"fusion.target_sd_m={sd_m}")
    rows = {(t, name): (spcpf(t, *way),) for t in ("s1", "s2", "s3") for name, way in ways.items()}
    figures = {
        "RMSE, m": rmse,
        "sd median, m": worst_sd(0.5),
        "sd 95 %": worst_sd(0.95),
        "tracked / with gaps / lost": verdicts,
        "reports in a step": active,
        "frames": mean("frames", "sent"),
        "bytes on air": mean("bytes", "on_air"),
        "metered, J": mean("energy_j", "by_accounting", "metered", digits=2),
        "without listening, J": mean("energy_j", "by_accounting", "without_listening", digits=2),
        "send, mJ": spent("send", scale=1e3, digits=0),
        "first order, mJ": mean("energy_j", "by_accounting", "first_order", scale=1e3, digits=1),
    }
    return Study(("path", "threshold"), rows, (figures,))


FAULTS: Final = {
    "none": "",
    "stuck n060": "kind='stuck', nodes=['n060'], at_s=0",
    "bias n060, 20 degrees": "kind='bias', nodes=['n060'], at_s=0, bias_deg=20",
    "deaf n060": "kind='deaf', nodes=['n060'], at_s=0",
    "babble n060": "kind='babble', nodes=['n060'], at_s=0",
    "clock_jump n060, 1 s": "kind='clock_jump', nodes=['n060'], at_s=0, jump_ms=1000",
    "kill 10 %, at 20 s": "kind='kill', share=0.1, at_s=20",
    "freeze 10 %, 20-40 s": "kind='freeze', share=0.1, at_s=20, until_s=40",
    "partition 20 %, 20-40 s": "kind='partition', share=0.2, at_s=20, until_s=40",
    "restart fusion, 20-25 s": "kind='restart', nodes=['fusion'], at_s=20, until_s=25",
}


def _faults() -> Study:
    paths = ("s1", "s2", "s3")
    rows = {
        (name,): tuple(
            spcpf(path, "link.model=ideal", "fusion.prior=none", f"faults=[{f'{{{fault}}}' if fault else ''}]")
            for path in paths
        )
        for name, fault in FAULTS.items()
    }
    figures = {f"RMSE {path}, m": on_path(path) for path in paths}
    figures |= {"largest, m": largest, "tracked / with gaps / lost": verdicts, "steps without track": blank}
    return Study(("fault",), rows, (figures,))


def _energy() -> Study:
    off = ("energy.battery_j=20000", "clock.offset_ms=50", "clock.drift_ppm=20")
    ways = {
        f"sync {sync}{name}": (*off, f"clock.sync={value}", f"sensor.threshold={threshold}")
        for name, threshold in (("", "0.75"), (", adaptive", "adaptive"))
        for sync, value in (("off", "false"), ("on", "true"))
    }
    rows = {(s, name): (Way(s, way),) for s in ("zhai-spcpf", "bus") for name, way in ways.items()}
    by_cause = {f"{cause}, J": spent(cause, digits=3) for cause in ("send", "receive", "listen", "sleep", "sense")}
    days = {
        f"{name.replace('_', ' ')}, days": mean("lifetime_s", name, scale=1 / DAY_S, digits=1)
        for name in ("first_death", "half_dead", "coverage_lost")
    }
    accountings = ("metered", "without_listening", "with_overhearing")
    devices = ("cc2420", "cc2420-20dbm", "sx1276", "wifi11b")
    totals = {
        f"{name.replace('_', ' ')}, J": mean("energy_j", "by_accounting", name, digits=2)
        for name in (*accountings, *devices)
    }
    totals["first order, J"] = mean("energy_j", "by_accounting", "first_order", digits=3)
    return Study(("scenario", "nodes"), rows, (by_cause | days, totals))


STUDIES: Final = {"clocks": _clocks(), "thresholds": _thresholds(), "faults": _faults(), "energy": _energy()}


def measured(ways: Sequence[Way], seeds: Sequence[int]) -> dict[Way, list[Outcome]]:
    """The runs of all ways, over all processors."""
    jobs = [(way, seed) for way in ways for seed in seeds]
    found: dict[Way, list[Outcome]] = {way: [] for way in ways}
    with ProcessPoolExecutor() as pool:
        for one in pool.map(outcome, *zip(*jobs, strict=True)):
            found[one.way].append(one)
    return found


def lines(study: Study, found: Mapping[Way, Sequence[Outcome]]) -> Iterator[str]:
    """Its tables, in Markdown."""
    for number, figures in enumerate(study.tables):
        if number:
            yield ""
        header = (*study.names, *figures)
        yield _line(header)
        yield _line(["---"] * len(header))
        for name, ways in study.rows.items():
            outcomes = [one for way in ways for one in found[way]]
            yield _line([*name, *(figure(outcomes) for figure in figures.values())])


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("studies", nargs="*", metavar="NAME", help=f"of {', '.join(STUDIES)}; all, if none is named")
    parser.add_argument("--runs", type=int, default=20, help="for each way")
    asked = parser.parse_args()
    if unknown := set(asked.studies) - STUDIES.keys():
        parser.error(f"there is no study {', '.join(sorted(unknown))}; there are {', '.join(STUDIES)}")
    for name in asked.studies or STUDIES:
        study = STUDIES[name]
        found = measured([way for ways in study.rows.values() for way in ways], range(1, asked.runs + 1))
        print(f"## {name}", "", *lines(study, found), "", sep="\n", flush=True)


if __name__ == "__main__":
    main()
