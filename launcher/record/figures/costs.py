"""The figures of what a field spends, with types (``spending.py`` makes them)."""

from __future__ import annotations

from launcher.record.figures.frames import Count, Figures, Number


class Purposes(Figures):
    """Energy (J) by what it was spent on."""

    sync: Number | None
    reports: Number | None
    control: Number | None
    overhear: Number | None
    listen: Number | None
    sleep: Number | None
    sense: Number | None


class PeriodFigures(Figures):
    """A period of a run of ``s`` seconds: the bytes that were sent in it, and the energy (J) in all and by purpose."""

    s: Number | None
    bytes: Count | None
    total_j: Number | None
    by: Purposes


class Power(Figures):
    """The mean power (W) of all batteries together, with a target and without one."""

    present: Number | None
    idle: Number | None


class Life(Figures):
    """How long (s) batteries last."""

    first_death: Number | None
    half_dead: Number | None


class LedgerFigures(Figures):
    """What was spent in each period of a run, and how long batteries last with a target for ``share_present`` of the
    time; ``hottest`` is what the process that spent most spent with a target, divided by the mean.
    """

    setup: PeriodFigures
    present: PeriodFigures
    settling: PeriodFigures
    idle: PeriodFigures
    power_w: Power
    hottest: Number | None
    share_present: Number | None
    lifetime_s: Life
