"""Tables of the runs through roles and messages: errors, hand-overs, what is sent, what it costs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from launcher.reproduce.intervals import Interval, positive, share
from launcher.reproduce.kernels.scores import mean, rmse
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yu import tables as bare
from launcher.reproduce.papers.yu.experiments import CASES, LAG, RULE, SENSORS
from launcher.reproduce.papers.yu.lifetimes import BATTERY_J, DAY_S, FIELDS, IDLE, PRESENT, TREE, TREE_W, name_of
from launcher.reproduce.papers.yu.roles import (
    AS_IT_IS,
    BASE,
    KINDS,
    NEAREST,
    NEVER_ANEW,
    RUNS,
    SOUND,
    R,
)
from launcher.reproduce.papers.yu.tables import BANDS, PERIODS, PUBLISHED
from launcher.reproduce.papers.yu.truth import STEPS, T
from launcher.reproduce.scores import pooled
from launcher.reproduce.tables import Row, aligned, inside, percent, plain, rows_table, with_interval
from trackfield.filters.types import Array

TABLE_2: Final = (BASE, f"{R}mrbpf", f"{R}rbpf", NEVER_ANEW, AS_IT_IS)
BESIDE: Final[Mapping[str, float]] = {
    "hand-overs in a step": 0.079, "always the nearest: hand-overs in a step": 0.144, "poll": 20.0, "energy": 12.0,
    "result": 24.0, "hand-over": 252.0,
}  # fmt: skip
"""Of an independent design of the same protocol: hand-overs, and bytes of messages."""
AUDIO_BYTES_S: Final = 8000.0
"""Of a sensor that sends the sound itself: 4000 samples a second of 16 bits."""
PARTICLES_BYTES: Final = 12500.0
"""Of 500 particles of five numbers with their weights, as float32."""
FRAME_BYTES: Final = 116.0
"""Payload of the largest frame of IEEE 802.15.4 that these links send."""
BYTE_S: Final = 32e-6
DUTIES: Final = (1.0, 0.1, 0.01)
"""Shares of the time in which there is a target."""
EACH: Final = 4.0
"""Sensors that measure in a step."""


def done(found: Found) -> bool:
    """Whether these runs are part of a study."""
    return BASE in found.figures


def errors_of(found: Found, name: str, period: str | None = None) -> Array:
    """The errors (R, T', 2) of the live track, of all steps or those of a period; NaN where there is none."""
    return bare.errors_of(found, name, period)


def ratio(errors: Array, others: Array) -> Interval:
    """The first's ``rmse`` over the second's, in the same runs."""
    one, other = pooled(errors), pooled(others)
    return positive(lambda weights: one(weights) / other(weights), len(errors))


def followed(errors: Array) -> float:
    """The share of steps with a track."""
    return float(np.isfinite(errors[..., 0]).mean())


def lost(found: Found, name: str) -> Interval:
    """The share of the runs that are lost; a step without a track counts as one with a large error."""
    errors = np.nan_to_num(errors_of(found, name), nan=1e9)
    hits = RULE.holds(errors)
    return share(int(hits.sum()), len(hits))


def bound(found: Found, name: str = BASE) -> float:
    """m, over all runs and steps, of four sensors."""
    return float(np.sqrt(np.square(found.figures[name]["bound"]).mean()))


def handovers(found: Found, name: str) -> Interval:
    """In a step."""
    return mean(found.figures[name]["handovers"] / STEPS)


def short(name: str) -> str:
    """The name without what all have in common."""
    return name.removeprefix(R)


def tables(found: Found) -> dict[str, list[Row]]:
    """The errors over all steps with the bands, and the figures beside those of another implementation."""
    if not done(found):
        return {}
    return {"roles": [_row(found, name) for name in RUNS], "roles, beside": _beside(found)}


def _row(found: Found, name: str) -> Row:
    error, tracker = rmse(errors_of(found, name)), short(name).split(",", maxsplit=1)[0]
    published, band = PUBLISHED.get(short(name)), BANDS.get(short(name))
    return Row(
        short(name),
        tracker,
        "error, m",
        error,
        published=published,
        ratio=error.over(published) if published else None,
        lost=lost(found, name),
        bound=bound(found, name),
        to_bound=error.value / bound(found, name),
        band=str(band or ""),
        verdict=inside([error], [band]) if band else "",
    )


def _beside(found: Found) -> list[Row]:
    rates = {"hand-overs in a step": BASE, "always the nearest: hand-overs in a step": NEAREST}
    figures = {what: handovers(found, name) for what, name in rates.items()}
    sizes = {kind: _each(found, BASE, "payload", kind) for kind in BESIDE if kind in KINDS}
    figures |= {kind: mean(some) for kind, some in sizes.items() if len(some)}
    return [
        Row(short(BASE), "jm-rbpf", what if what in rates else f"bytes of {what}", one, published=BESIDE[what],
            ratio=one.over(BESIDE[what]))
        for what, one in figures.items()
    ]  # fmt: skip


def _of(found: Found, name: str, what: str, kind: str) -> Array:
    """(R,) of a kind of message: so much in the whole run."""
    return found.figures[name][what][:, KINDS.index(kind)]


def _each(found: Found, name: str, what: str, kind: str) -> Array:
    """(R',) of one message, in the runs in which there was any."""
    frames = _of(found, name, "frames", kind)
    return _of(found, name, what, kind)[frames > 0] / frames[frames > 0]


# --- in Markdown ------------------------------------------------------------------------------------------------------


def errors(found: Found) -> str:
    """A row for each tracker that leads a field, and the bare filter's error in as many runs of other fields."""
    rows = []
    for name in TABLE_2:
        row = _row(found, name)
        own = rmse(bare.errors_of(found, short(name))) if short(name) in CASES else None
        rows.append(
            [
                short(name),
                f"{len(errors_of(found, name))}",
                with_interval(row.ours),
                *(plain(rmse(errors_of(found, name, period)).value) for period in PERIODS),
                with_interval(lost(found, name), percent),
                percent(followed(errors_of(found, name))),
                f"{row.to_bound:.2f}",
                "-" if row.published is None else plain(row.published),
                row.band,
                row.verdict,
                "" if own is None else with_interval(own),
            ]
        )
    header = ("tracker", "runs", "error, m", *PERIODS, "lost", "steps with a track", "over bound", "published", "band")
    return aligned((*header, "verdict", "bare filter, m"), rows) + (
        f"\n\nThe bound of these fields is {plain(bound(found))} m."
    )


def sensors(found: Found) -> str:
    """Sensors in a step, who leads, and looking back."""
    names = [BASE, *(f"{R}jm-rbpf, {n} sensors" for n in SENSORS[1:]), NEAREST]
    rows = []
    for name in names:
        live, back = errors_of(found, name), found.figures[name]["smoothed"]
        there = np.isfinite(back)
        same = np.where(there, live, np.nan)
        looked = [with_interval(rmse(one)) if there.any() else "-" for one in (back, same)]
        rows.append(
            [
                *(short(name), with_interval(rmse(live)), with_interval(ratio(live, errors_of(found, BASE)))),
                *looked,
                percent(followed(back)) if there.any() else "-",
                with_interval(handovers(found, name), lambda value: f"{value:.3f}"),
                plain(float(found.figures[name]["take_overs"].mean())),
                f"{float(found.figures[name]['reports_used'].mean()):.2f}",
            ]
        )
    header = (
        *("field", "error, m", "over that with four"),
        *(f"{LAG} s later, m", "live in these steps, m", "steps so"),
        *("hand-overs in a step", "take-overs in a run", "reports in a step"),
    )
    return aligned(header, rows)


def forms(found: Found) -> str:
    """What is handed over: errors, and what one hand-over costs."""
    against = {
        "jm-rbpf: modes": (BASE, BASE),
        "jm-rbpf: gaussian": (f"{R}jm-rbpf, hands over: gaussian", BASE),
        **{
            f"bootstrap: {form}": (f"{R}bootstrap, hands over: {form}", f"{R}bootstrap, hands over: gaussian")
            for form in ("gaussian", "particles")
        },
    }
    rows = []
    for what, (name, other) in against.items():
        error, other_errors = errors_of(found, name), errors_of(found, other)
        size, air, spent = (
            _each(found, name, amount, "hand-over") for amount in ("payload", "bytes on air", "air, ms")
        )
        rows.append(
            [
                what,
                with_interval(rmse(error)),
                "1" if name == other else with_interval(ratio(error, other_errors)),
                *(plain(float(some.mean())) if len(some) else "-" for some in (size, air, spent)),
                f"{np.ceil(size.mean() / FRAME_BYTES):.0f}" if len(size) else "-",
                f"{float(_of(found, name, 'frames', 'hand-over').sum()):.0f}",
                f"{float(_of(found, name, 'frames', 'hand-over-ack').sum()):.0f}",
            ]
        )
    header = (
        *("tracker: form", "error, m", "ratio", "bytes", "bytes on air", "ms on air", "fragments at least"),
        *("hand-overs sent", "acknowledged"),
    )
    bare_frames = np.ceil(PARTICLES_BYTES / FRAME_BYTES)
    return aligned(header, rows) + (
        f"\n\n500 particles of five numbers would take {PARTICLES_BYTES:.0f} bytes in {bare_frames:.0f} fragments, "
        f"{1e3 * PARTICLES_BYTES * BYTE_S:.0f} ms on air for the payload alone."
    )


def traffic(found: Found) -> str:
    """What is sent in a second by kind, beside the sound itself."""
    rows, sums = [], np.zeros(4)
    for kind in KINDS:
        frames, payload, air, ms = (float(_of(found, BASE, what, kind).mean()) / STEPS / T for what in _AMOUNTS)
        sums += (frames, payload, air, ms)
        size = payload / frames if frames else np.nan
        told = BESIDE.get(kind)
        rows.append([kind, _some(frames), _some(size), "" if told is None else f"{told:.0f}",
                     *(_some(one) for one in (payload, air, ms))])  # fmt: skip
    rows.append(["all", _some(sums[0]), "", "", *(_some(one) for one in sums[1:])])
    audio = EACH * AUDIO_BYTES_S
    ms = 1e3 * audio * BYTE_S
    rows.append([f"sound of {EACH:.0f} sensors", _some(audio / FRAME_BYTES), "", "", _some(audio), "", _some(ms)])
    header = ("message", "in a second", "bytes each", "design", "bytes a second", "on air, bytes a second")
    return aligned((*header, "on air, ms a second"), rows)


_AMOUNTS: Final = ("frames", "payload", "bytes on air", "air, ms")


def _some(value: float) -> str:
    return "-" if not np.isfinite(value) else plain(value)


def saved(found: Found) -> Interval:
    """How many times as many bytes the sound itself takes as all messages do."""
    sent = found.figures[BASE]["payload"].sum(axis=1) / STEPS / T
    return mean(EACH * AUDIO_BYTES_S / sent)


def sound(found: Found) -> str:
    """What the delay of sound and a window cost, m, and how far tracks are ahead of the target on the mean."""
    rows = []
    for name in (BASE, *SOUND):
        errors, truth = errors_of(found, name), found.figures[name]["truth"]
        way = np.diff(truth, axis=1)
        ahead = np.nanmean(np.vecdot(errors[:, 1:], way / np.linalg.norm(way, axis=-1, keepdims=True)))
        more = rmse(errors).value - rmse(errors_of(found, BASE)[: len(errors)]).value
        other = errors_of(found, BASE)[: len(errors)]
        rows.append(
            [
                short(name),
                with_interval(rmse(errors)),
                f"{more:+.2f}",
                with_interval(ratio(errors, other)),
                f"{ahead:.2f}",
            ]
        )
    return aligned(("field", "error, m", "more, m", "ratio", "ahead, m"), rows)


def lifetimes(found: Found) -> str:
    """What sensors draw, and when the first battery is empty, by extrapolation."""
    rows = []
    for field in FIELDS:
        here, idle = (found.figures[name_of(field, what)] for what in (PRESENT, IDLE))
        shown = [here["watts"].mean(), here["watts"].max(axis=1).mean(), idle["watts"].mean()]
        rows.append(
            [
                *(field, f"{len(here['watts'])}", *(f"{1e3 * one:.2f}" for one in shown)),
                *(plain(float(one["frames"].mean())) for one in (here, idle)),
                *(f"{BATTERY_J / (duty * shown[1] + (1.0 - duty) * shown[2]) / DAY_S:.1f}" for duty in DUTIES),
            ]
        )
    least, days = f"> {1e3 * TREE_W:.1f}", f"< {BATTERY_J / TREE_W / DAY_S:.1f}"
    rows.append([TREE, "0", *(least,) * 3, "-", "-", *(days for _ in DUTIES)])
    header = (
        *("field", "runs", "mean, mW", "busiest sensor, mW", "without a target, mW"),
        *("frames a step", "without a target"),
        *(f"days, target for {duty:.0%}" for duty in DUTIES),
    )
    return aligned(header, rows)


def beside(found: Found) -> str:
    """Hand-overs and sizes beside those of an independent design."""
    return rows_table(_beside(found))


PARTS: Final = (
    ("Table 2, through roles and messages", errors),
    ("Beside an independent design of the protocol, through roles", beside),
    ("Sensors, who leads, and looking back, through roles", sensors),
    ("What is handed over, through roles", forms),
    ("What is sent, through roles", traffic),
    ("The delay of sound, and a window, through roles", sound),
    ("What sensors draw, through roles", lifetimes),
)


def parts(found: Found) -> list[tuple[str, str]]:
    """All tables, with their headings; none of a study of bare filters alone."""
    return [(heading, table(found)) for heading, table in PARTS] if done(found) else []
