"""Growth of the cost: of a run with its nodes, of a step with its particles. Draws docs/growth.png.

    OPENBLAS_NUM_THREADS=1 python -m bench.growth [--out docs/growth.png]

Runs are those of ``bench.virtual``: 600 emulated seconds over an ideal link. Particle filters get four bearings a step.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from bench.data import track
from bench.kernels import measured, tracked
from bench.scale import Figures, table
from bench.scale import measured as run_of
from trackfield.filters.bootstrap import Bootstrap
from trackfield.filters.spcpf import SpCpf

NODES: Final = (100, 300, 1_000, 3_000, 10_000, 30_000, 100_000)
PARTICLES: Final = (100, 300, 1_000, 3_000, 10_000, 30_000, 100_000)
ROUNDS: Final = 3


def of_nodes() -> list[Figures]:
    """Processor seconds of a run as the field grows, all stages, and of its driver alone."""
    runs = [run_of("bench.virtual", nodes=n, link="ideal", seconds=600) for n in NODES]
    return [
        {"nodes": r["nodes"], "all": sum(cpu for _, cpu in r["laps"].values()), "run": r["laps"]["run"][1]}
        for r in runs
    ]


def of_particles() -> list[Figures]:
    """Microseconds of a step of both particle filters."""
    data, rows = track(), []
    for n in PARTICLES:
        both = {"bootstrap": tracked(data, Bootstrap(n)), "spcpf": tracked(data, SpCpf(n, 15))}
        rows.append({"particles": n} | {row.who: row.us for row in measured(data, both, ROUNDS)})
    return rows


def draw(nodes: Sequence[Figures], particles: Sequence[Figures], out: Path) -> None:
    """Both on logarithmic scales, each beside a line of cost in proportion to the number."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    for axes, rows, over, lines, title, unit in (
        (left, nodes, "nodes", {"all": "all stages", "run": "run alone"}, "A run of 600 s", "processor time, s"),
        (right, particles, "particles", {"bootstrap": "bootstrap", "spcpf": "SP-CPF"}, "A step", "time, us"),
    ):
        x = [row[over] for row in rows]
        for key, label in lines.items():
            axes.loglog(x, [row[key] for row in rows], "o-", label=label)
        last = rows[-1][next(iter(lines))]
        axes.loglog(x, [last * n / x[-1] for n in x], ":", color="gray", label=f"in proportion to {over}")
        axes.set(xlabel=over, ylabel=unit, title=title)
        axes.grid(visible=True, which="major", alpha=0.3)
        axes.legend(frameon=False)
    figure.savefig(out, dpi=110)


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("docs/growth.png"))
    out = parser.parse_args().out
    particles, nodes = of_particles(), of_nodes()
    columns = (
        ("nodes", lambda f: f"{f['nodes']:,}"),
        ("all s (CPU)", lambda f: f"{f['all']:.1f}"),
        ("run s (CPU)", lambda f: f"{f['run']:.1f}"),
    )
    print(table(columns, nodes), end="\n\n")
    columns = (
        ("particles", lambda f: f"{f['particles']:,}"),
        ("bootstrap us", lambda f: f"{f['bootstrap']:,.0f}"),
        ("SP-CPF us", lambda f: f"{f['spcpf']:,.0f}"),
    )
    print(table(columns, particles))
    draw(nodes, particles, out)


if __name__ == "__main__":
    main()
