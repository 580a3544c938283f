"""Which tracks a replay can make again."""

from __future__ import annotations

from pathlib import Path

from launcher.files import TRACKS_TABLE
from launcher.record.reading.files import read_table, refuse
from launcher.records import Plan


def check_repeatable(run: Path, plan: Plan) -> None:
    """Raise ``ScenarioError`` for tracks that neither came by radio nor are of a process that fuses reports alone.

    Those who take turns go on with what they were handed, which a replay does not repeat.
    """
    for row in read_table(run, TRACKS_TABLE, ("source", "step", "origin", "sensors", "term")).to_pylist():
        if not row["origin"] and row["source"] in row["sensors"]:
            what = f"{row['source']} used readings of its own sensor, which no message holds"
            refuse(run / TRACKS_TABLE, "sensors", what, "processes that fuse the reports of others")
        if not row["origin"] and (row["source"] not in plan.banks or row["step"] is None):
            what = f"{row['source']} made tracks in a way of its own, which a replay cannot repeat"
            expected = "processes that fuse the reports of steps (fuses), or hand on the tracks of others (origin)"
            refuse(run / TRACKS_TABLE, "source", what, expected)
        if not row["origin"] and row["term"]:
            what = f"{row['source']} took turns with others at tracking, which a replay cannot repeat"
            refuse(run / TRACKS_TABLE, "term", what, "0: tracks that are not handed from one process to another")
