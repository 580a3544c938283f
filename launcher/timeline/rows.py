"""Rows of one kind as the columns that Rerun takes for an entity, many rows at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import rerun as rr

from launcher.records import MessageRow
from launcher.timeline import look
from launcher.timeline.scene import Points
from trackfield.role import NS

Columns = rr.ComponentColumnList
Dots = tuple[Points, list[int]]
"""Positions (n, 2) and colours of n points."""
Nodes = tuple[list[str], list[int]]
"""Ids and colours of the nodes of a network."""

BAR_AT: Final = (1.8, 0.8)
"""How far left of the middle of a close-up its scale bar begins, and how far below."""
TIMES: Final = ("frame (from → to, kind)", "local clock", "received at", "sent at [s]")
"""Columns of the table of messages; the viewer shows them in the order of the alphabet, as wide as their names."""


def scalars(values: list[tuple[float, ...]]) -> Columns:
    """Values of one time each, (n, lines)."""
    return rr.Scalars.columns(scalars=np.array(values))


def states(values: list[str]) -> Columns:
    """Names of states; an empty one ends the state before it."""
    return rr.StateChange.columns(state=values)


def texts(values: list[tuple[str, str, int]]) -> Columns:
    """Text, level and colour of lines of a log."""
    text, level, colour = zip(*values, strict=True)
    return rr.TextLog.columns(text=text, level=level, color=np.array(colour, np.uint32))


def points(values: list[Points]) -> Columns:
    """Positions (n, 2) of each picture."""
    return rr.Points2D.columns(positions=np.concatenate(values)).partition(_lengths(values))


def dots(values: list[Dots]) -> Columns:
    """Positions and colours of each picture."""
    at, colours = zip(*values, strict=True)
    return rr.Points2D.columns(positions=np.concatenate(at), colors=_colours(colours)).partition(_lengths(at))


def named_dots(values: list[tuple[Points, list[int], list[str]]]) -> Columns:
    """Positions, colours and names of each picture; an empty name is not shown."""
    at, colours, names = zip(*values, strict=True)
    labels = [name for some in names for name in some]
    columns = rr.Points2D.columns(positions=np.concatenate(at), colors=_colours(colours), labels=labels)
    return columns.partition(_lengths(at))


def discs(values: list[Points]) -> Columns:
    """Positions and radii (n, 3) m of each picture."""
    every = np.concatenate(values)
    return rr.Points2D.columns(positions=every[:, :2], radii=every[:, 2]).partition(_lengths(values))


def strips(values: list[Points]) -> Columns:
    """Lines (n, corners, 2) of each picture."""
    return rr.LineStrips2D.columns(strips=np.concatenate(values)).partition(_lengths(values))


def sounds(values: list[bytes]) -> Columns:
    """WAV files, each played from its time on."""
    return rr.AssetAudio.columns(
        blob=[np.frombuffer(value, np.uint8) for value in values], media_type=["audio/wav"] * len(values)
    )


def images(values: list[bytes]) -> Columns:
    """JPEG files."""
    return rr.EncodedImage.columns(
        blob=[np.frombuffer(value, np.uint8) for value in values], media_type=["image/jpeg"] * len(values)
    )


def boxes(values: list[list[tuple[tuple[float, float, float, float], int, str]]]) -> Columns:
    """Rectangles (left, top, right, bottom), colours and labels of each picture."""
    every = [one for some in values for one in some]
    edges = np.reshape([at for at, _, _ in every], (-1, 4))
    columns = rr.Boxes2D.columns(
        half_sizes=(edges[:, 2:] - edges[:, :2]) / 2,
        centers=(edges[:, 2:] + edges[:, :2]) / 2,
        colors=np.array([colour for _, colour, _ in every], np.uint32),
        labels=[label for _, _, label in every],
    )
    return columns.partition(_lengths(values))


def moves(values: list[tuple[float, float]]) -> Columns:
    """Where a frame is in the one around it, (x, y)."""
    return rr.Transform3D.columns(translation=[(x, y, 0.0) for x, y in values])


def scales(values: list[float]) -> Columns:
    """How large one unit of a frame is in the one around it."""
    return rr.Transform3D.columns(scale=[(value, value, value) for value in values])


def bars(values: list[tuple[float, str]]) -> Columns:
    """Lengths of a scale bar in the lower left of a close-up, and their labels."""
    strips = [[(-BAR_AT[0], BAR_AT[1]), (-BAR_AT[0] + length, BAR_AT[1])] for length, _ in values]
    return rr.LineStrips2D.columns(strips=strips, labels=[text for _, text in values])


def node_colours(values: list[list[int]]) -> Columns:
    """Colours of the nodes of a network that are drawn once and for all."""
    return rr.GraphNodes.columns(colors=_colours(values)).partition(_lengths(values))


def nodes(values: list[Nodes]) -> Columns:
    """The nodes of each picture of a network of which only a part is drawn."""
    ids, colours = zip(*values, strict=True)
    names = [name for some in ids for name in some]
    columns = rr.GraphNodes.columns(node_ids=names, labels=names, colors=_colours(colours))
    return columns.partition(_lengths(ids))


def edges(values: list[npt.NDArray[np.str_]]) -> Columns:
    """Pairs of ids (n, 2) of each picture."""
    return rr.GraphEdges.columns(edges=np.concatenate(values)).partition(_lengths(values))


def times(values: list[tuple[MessageRow, int]]) -> Columns:
    """When messages were sent, by true time and by their senders' clocks, and when they were received, if at all.

    In s since the first step; each message comes with that of its run (ns).
    """
    found: list[list[float | str | None]] = [
        [f"{row.src} → {row.dst} {row.kind}" for row, _ in values],
        [_seconds(row.local_ns, since) for row, since in values],
        [_seconds(row.due_ns, since) if row.delivered else None for row, since in values],
        [_seconds(row.sent_ns, since) for row, since in values],
    ]
    columns: list[Any] = []
    for name, column in zip(TIMES, found, strict=True):
        known = [value for value in column if value is not None]
        if not known:
            continue  # Rerun knows no type for it
        # The first argument is not a column: it says that empty cells stay empty.
        values_of = rr.AnyValues.columns(False, **{name: np.array(known)})
        columns += values_of.partition([value is not None for value in column])
    return rr.ComponentColumnList(columns)


def apart(t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Times in increasing order, each at least 1 ns after the one before: a table has one row per instant."""
    rank = np.arange(len(t_ns))
    return np.maximum.accumulate(t_ns - rank) + rank


def instant(row: MessageRow) -> int:
    """The time at which a message is shown: when it arrived, or if it was lost, when it was sent."""
    return row.due_ns if row.delivered and row.due_ns is not None else row.sent_ns


def sentence(row: MessageRow) -> tuple[str, str, int]:
    """A message as a line of the log: text, level, colour."""
    text = f"{row.src} → {row.dst}  {row.text or row.kind}  ({row.bytes} B)"
    if not row.delivered:
        return f"{text}  LOST: {row.outcome}", "ERROR", look.LOST
    if row.due_ns is not None:
        text += f"  {(row.due_ns - row.sent_ns) / 1e6:.1f} ms"
    if row.outcome != "delivered":
        return f"{text}  {row.outcome.upper()}", "WARN", look.LATE
    return text, "INFO", look.INFO


def _seconds(t_ns: int | None, since_ns: int) -> float | None:
    return None if t_ns is None else round((t_ns - since_ns) / NS, 4)


def _colours(values: Sequence[list[int]]) -> npt.NDArray[np.uint32]:
    return np.array([colour for some in values for colour in some], np.uint32)


def _lengths(values: Sequence[Any]) -> list[int]:
    return [len(value) for value in values]
