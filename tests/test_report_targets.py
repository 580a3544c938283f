"""A report of several targets, of a centre by another name, of several who track: whose tracks, and which time."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import same_color
from matplotlib.patches import Rectangle

from launcher.plan.architectures import Process
from launcher.records import TRACKS, View
from launcher.report import style, tracks
from launcher.report.figures import FIGURES
from launcher.report.folder import Run, read_run
from launcher.report.outages import broken_at
from launcher.report.parts import errors, verdicts
from launcher.report.parts.latency import latencies
from launcher.report.parts.messages import fates
from tests.reporting import read, run, with_tracks
from trackfield.errors import ScenarioError

SETUP_S = 5.0


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two targets after a time of setup, in which clocks that are off are set right."""
    settings = (
        "target.id=car", "targets=[{id='van', path='s3'}]", f"run.setup_s={SETUP_S:g}",
        "clock.offset_ms=20", "faults=[{kind='kill', nodes=['n036'], at_s=4}]",
    )  # fmt: skip
    return run(tmp_path_factory.mktemp("pair"), *settings)


@pytest.fixture(scope="module")
def paired(pair: Path) -> Run:
    return read_run(pair)


def drawn(name: str, run: Run) -> Axes:
    """The first plot of a figure."""
    figure = FIGURES[name](run)
    assert figure is not None
    return figure.axes[0]


def boxes(axes: Axes) -> list[Rectangle]:
    return [patch for patch in axes.patches if isinstance(patch, Rectangle)]


def labels(axes: Axes) -> list[str]:
    return list(axes.get_legend_handles_labels()[1])


# --- several targets --------------------------------------------------------------------------------------------------


def test_each_step_is_scored_against_the_nearest_target(pair: Path, paired: Run) -> None:
    metrics, text = json.loads((pair / "metrics.json").read_text()), read(pair).text
    assert text.count(verdicts.NEAREST) == len(metrics["trackers"]) == 2
    for track in paired.tracks:
        m = metrics["trackers"][track.tracker]
        assert np.sqrt(np.nanmean(np.square(track.error_m))) == pytest.approx(m["rmse"]["position"], rel=1e-12)
    rows = errors.targets(paired).rows
    assert [row[:2] for row in rows] == [[name, id] for name in metrics["trackers"] for id in ("car", "van")]
    assert sum(int(row[3]) for row in rows) == sum(m["steps"] for m in metrics["trackers"].values())
    assert "target car" in text
    assert "target van" in text


def test_one_target_has_no_table_of_its_own(pair: Path, paired: Run) -> None:
    alone = {name: m | {"association": None, "targets": {}} for name, m in paired.metrics["trackers"].items()}
    one = replace(paired, metrics=paired.metrics | {"trackers": alone})
    assert errors.targets(one).rows == []
    assert not any(verdicts.NEAREST in verdict.text for verdict in verdicts.verdicts(one))


def test_all_true_paths_are_on_the_map_from_end_to_end(paired: Run) -> None:
    axes = drawn("field", paired)
    ways = [line for line in axes.lines if same_color(line.get_color(), style.TRUTH)]
    for line, path in zip(ways, paired.site.paths.values(), strict=True):
        ends = np.array(line.get_xydata())[[0, -1]]
        assert ends.tolist() == [list((path.at(t) or ())[:2]) for t in (path.start_s, path.end_s)]
    assert [text.get_text() for text in axes.texts if text.get_text() not in paired.sensors] == ["car", "van"]
    assert (labels(axes).count("true path"), labels(axes).count("start")) == (1, 1)


# --- the first step is at 0 -------------------------------------------------------------------------------------------


def test_times_count_from_the_first_step(pair: Path, paired: Run) -> None:
    assert all(track.t_s.tolist() == list(range(1, 13)) for track in paired.tracks)
    assert (paired.end_s, paired.last_step) == (13.0, 12)
    assert -SETUP_S <= paired.frames.sent_s.min() < 0.0
    assert paired.frames.sent_s.max() < paired.end_s
    assert broken_at(paired) == [4.0]
    text = read(pair).text
    for words in ("12 of 1 s each, after 5 s of setup", "4 s kill n036 planned"):
        assert words in text
    assert "ended early" not in text


def test_gaps_in_the_data_are_where_they_were(paired: Run) -> None:
    paths = {id: replace(path, gaps=((SETUP_S + 2.0, SETUP_S + 4.5),)) for id, path in paired.site.paths.items()}
    axes = drawn("error", replace(paired, field=replace(paired.field, site=replace(paired.site, paths=paths))))
    assert [(gap.get_x(), gap.get_width()) for gap in boxes(axes)] == [(2.0, 2.5)] * 2
    assert labels(axes).count("truth interpolated") == 1


def test_frames_before_the_first_step_have_their_bars(paired: Run) -> None:
    axes = drawn("losses", paired)
    assert sum(bar.get_height() for bar in boxes(axes)) == len(paired.frames)
    assert min(bar.get_x() for bar in boxes(axes)) == axes.get_xlim()[0] < 0.0
    assert sum(bar.share for bar in fates(paired)) == pytest.approx(1.0)


def test_latencies_come_to_those_of_a_run_with_setup(paired: Run) -> None:
    for values, name in zip(latencies(paired).values(), ("link", "to_filter", "to_track"), strict=True):
        assert np.quantile(1e3 * values, 0.95) == pytest.approx(paired.metrics["latency_ms"][name]["p95"], abs=1e-6)


# --- who tracks -------------------------------------------------------------------------------------------------------


def test_a_centre_may_have_any_name(tmp_path: Path) -> None:
    folder = run(tmp_path, "architecture.centre=hq", "faults=[{kind='freeze', nodes=['hq'], at_s=6, until_s=8}]")
    found = read_run(folder)
    assert [len(track.t_s) for track in found.tracks] == [12, 12]
    assert "fusion centre" in labels(drawn("field", found))
    assert "6 s freeze until 8 s hq planned" in read(folder).text


def test_whoever_tracks_is_on_the_map_by_role(paired: Run) -> None:
    masters = tuple(Process(f"m{i}", "master", 100.0 * i, 0.0, tags={TRACKS}) for i in (1, 2))
    field = replace(paired.field, processes=(*paired.field.processes, *masters))
    axes = drawn("field", replace(paired, field=field))
    assert labels(axes)[-2:] == ["fusion centre", "master"]
    assert np.array(axes.lines[-1].get_xydata()).tolist() == [[100.0, 0.0], [200.0, 0.0]]


def told(points: pa.Table, source: str, term: int, later_ns: int, by_m: float) -> pa.Table:
    """The same points as another source told them, in a term, later, and further east."""
    changed = {
        "source": pa.array([source] * points.num_rows),
        "term": pa.array([term] * points.num_rows, points["term"].type),
        "told_ns": pa.compute.add(points["told_ns"], later_ns),
        "x": pa.compute.add(points["x"], by_m),
    }
    for name, column in changed.items():
        points = points.set_column(points.column_names.index(name), name, column)
    return points


def test_a_view_holds_the_highest_term_then_what_was_told_first(paired: Run) -> None:
    points = paired.points
    first = points.filter(pa.compute.less_equal(points["step"], 4))
    others = told(first, "b", 1, 9, 10.0), told(points, "c", 0, -9, 20.0), told(points, "outside", 7, -99, 30.0)
    table = pa.concat_tables([points, *others])
    view = View("base", ("fusion", "b", "c"))
    for before, track in zip(paired.tracks, tracks.read(table, view, paired.trackers), strict=True):
        off = track.mean[:, 0] - before.mean[:, 0]
        assert off[:4] == pytest.approx([10.0] * 4)
        assert off[4:] == pytest.approx([20.0] * 8)
        assert track.t_s.tolist() == before.t_s.tolist()


def test_tracks_of_an_older_version_are_named(pair: Path, tmp_path: Path) -> None:
    for name in ("metrics.json", "manifest.json", "messages.parquet", "tracks.parquet"):
        (tmp_path / name).write_bytes((pair / name).read_bytes())
    with_tracks(tmp_path, lambda table: table.drop_columns(["source"]))
    with pytest.raises(ScenarioError) as failure:
        read_run(tmp_path)
    assert (failure.value.file, failure.value.what) == (
        str(tmp_path / "tracks.parquet"),
        "was written by an older version",
    )


def test_a_view_without_sources_has_no_tracks(paired: Run) -> None:
    """As that of whole smoothed tracks in a field in which nobody smooths."""
    assert paired.points.num_rows
    assert tracks.read(paired.points, View("nobody", ()), paired.trackers) == ()
    assert not paired.frames.where("outcome").any()
