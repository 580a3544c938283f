"""The study of Özfidan et al. (2018) in words: its parts in their order, and what the figures show."""

from __future__ import annotations

from typing import Final

from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.ozfidan import energies, roles, tables
from launcher.reproduce.papers.ozfidan.assumptions import assumed
from launcher.reproduce.papers.ozfidan.energy import CC2420, RADIO
from launcher.reproduce.papers.ozfidan.experiments import DETECTION, FAR_M, FEW, HOUSE, LINGERING, PAPER, RARELY, SCALED
from launcher.reproduce.papers.ozfidan.tables import CLOSE
from launcher.reproduce.tables import FACTOR, rows_table

BATCHED: Final = "batched kernel"
ROLES: Final = "roles"
"""Where a table comes from; others come from roles and their messages."""

FIGURES: Final = (
    ("fig02", "the true path and that of PF, in a run of the paper's policy", "the same of its own run"),
    ("fig03", "the true path and that of UKF, in the same run", "the same of its own run"),
    ("fig04", "the sensors that were awake in that run, with PF and with UKF", "those of its own run"),
    ("fig05", "rms errors in x and y of PF over the steps, by two policies", "the same, perhaps of one run"),
    ("fig06", "rms errors in x and y of UKF over the steps, by two policies", "the same, perhaps of one run"),
    ("energy", "the error of each policy over the energy that it takes, by two accounts", "nothing"),
    ("sweeps", "the error over the number of masters, of slaves, and the capacity", "nothing"),
)
"""Name, what it shows, and what the paper has of it."""


def parts(found: Found) -> list[tuple[str, str]]:
    """All tables, with their headings."""
    batched = [(f"{title} ({BATCHED})", text) for title, text in (*_errors(found), *_energies(found))]
    if not roles.done(found):
        return batched
    return [*batched, (f"Masters and slaves over LoRa ({ROLES})", f"{_ROLES}\n\n{roles.table(found)}")]


def _errors(found: Found) -> list[tuple[str, str]]:
    beside = rows_table(tables.tables(found)["prototype"])
    return [
        ("The policies", f"{_POLICIES}\n\n{tables.policies(found)}"),
        (
            f"Beside an independent prototype's figures (errors: at most {CLOSE:g} of its; what field and policy alone "
            f"decide: within a factor of {CLOSE:g}), and what is asked for",
            f"{_PROTOTYPE}\n\n{beside}",
        ),
        ("Errors in x and in y, the mean over runs and the median run", tables.axes(found)),
        ("What both filters choose, of the same targets and readings", tables.same(found)),
        (
            "The UKF under other conditions, with merge_until_3 but where it says closest",
            f"{_OTHERS}\n\n{tables.others(found)}",
        ),
    ]


def _energies(found: Found) -> list[tuple[str, str]]:
    return [
        ("What energy is counted from", assumed(found)),
        ("Frames in a step", energies.step(found)),
        (
            f"Beside the prototype's count (the same: within a factor of {FACTOR:g})",
            energies.prototype(found),
        ),
        *(
            (
                f"Energy of a step, {radio}, {'with' if baseline else 'without'} the baseline of nodes",
                energies.accounts(found, radio, baseline=baseline),
            )
            for radio in (CC2420, *(name for name in RADIO if name != CC2420))
            for baseline in (False, True)
        ),
        ("Other fields", energies.sweeps(found)),
    ]


_POLICIES: Final = (
    f"{PAPER.masters} masters, {PAPER.slaves} slaves, at most {PAPER.capacity} for each master, {PAPER.steps} steps of "
    "2 s. A run's error is its RMSE of the position over the steps; *error* is the mean of these over the runs, "
    "*bound* that of the root mean square of the information recursion at the true states, for the slaves that were "
    f"awake. *over {FAR_M:g} m*: the share of the runs with such an error at some time; with *closest* these make up "
    "the mean. *pooled* is the RMSE over all runs and steps. *hand-overs* are changes of the lead in a run. "
    f"*all* has up to {FEW} runs, as its particle filter is slow."
)
_PROTOTYPE: Final = (
    "Of *closest* the median run, of the others the mean over runs. The prototype draws other fields and targets and "
    "has 400 runs; it does not say over what its errors are averaged."
)
_OTHERS: Final = (
    f"*{SCALED}*: with the paper's sigma points (alpha 0.05, beta 2; the weight of the central one is -399), in place "
    "of those of trackfield.filters.ukf, whose weights are all positive; with *closest* beside the UKF's row above. "
    f"*{HOUSE}*: the filter expects accelerations that are held over a step, of sd sqrt(q/dt), as fusion.sigma_v "
    f"says, in place of the density q. *{LINGERING}*: slaves stay awake for 10 steps after they were last chosen. "
    f"*{RARELY}*: so they do, and those that sleep hear a beacon at every 10th step only. "
    f"*{DETECTION}*: a slave farther from the target than that reports that there is none."
)

_ROLES: Final = (
    f"Whole runs of the packaged scenario in virtual time, of {roles.STEPS} steps, with their radio, clocks and "
    "batteries: means over runs. The bound is that of delivered reports. *age* is that of what the base knew. *reports "
    "used* are those of a step that the leader had, *asked for* those that it wanted; *orphans* are slaves without a "
    "master at the first step; *frames overheard* are answers to others while slaves look for masters; *frames a step* "
    "and *energy* include the set-up."
)
