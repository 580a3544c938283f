"""The report of a run: its figures are those of metrics.json, and its page needs nothing but itself."""

from __future__ import annotations

import json
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from launcher import report
from launcher.plan.prepare import load, planned
from launcher.record.words import joules
from launcher.report.cells import number, percent
from launcher.report.figures import FIGURES
from launcher.report.folder import read_run
from launcher.report.parts.latency import latencies
from launcher.report.parts.messages import fates
from launcher.run import run_virtual
from launcher.show import conclude
from tests.reporting import changed, copied, read, run, troubled, with_tracks

pytestmark = pytest.mark.rendered

__all__ = ["copied", "troubled"]

MOST_BYTES = 1_500_000
DRAWN = FIGURES.keys() - {"distribution", "leaders", "clusters", "heads", "passes", "heard", "pointing"}
"""Of a short run with one centre."""

# --- the page ---------------------------------------------------------------------------------------------------------


def test_a_run_leaves_its_figures_and_one_page_that_holds_them_all(troubled: Path) -> None:
    assert {file.name for file in (troubled / "plots").iterdir()} == {f"{name}.png" for name in DRAWN}
    assert (troubled / report.PAGE).stat().st_size < MOST_BYTES
    pictures = [attributes for tag, attributes in read(troubled).tags if tag == "img"]
    assert len(pictures) == len(DRAWN)
    assert all((one["src"] or "").startswith("data:image/png;base64,") and one["alt"] for one in pictures)


def test_the_page_refers_to_nothing_but_itself_and_files_of_its_folder(troubled: Path) -> None:
    ids = {attributes["id"] for _, attributes in read(troubled).tags if "id" in attributes}
    for tag, attributes in read(troubled).tags:
        for name in ("src", "href", "srcset", "action", "data"):
            target = attributes.get(name)
            if target is not None and not target.startswith("data:"):
                assert tag == "a", (tag, target)
                assert target.removeprefix("#") in ids if target.startswith("#") else (troubled / target).exists()
    text = (troubled / report.PAGE).read_text()
    assert not any(word in text for word in ("http://", "https://", "url(", "@import", "<script", '<link rel="style'))


def test_a_page_is_well_formed(troubled: Path) -> None:
    void, open_ = {"meta", "link", "img", "br"}, list[str]()

    class Balance(HTMLParser):
        def handle_starttag(self, tag: str, attrs: object) -> None:
            if tag not in void:
                open_.append(tag)

        def handle_endtag(self, tag: str) -> None:
            assert open_.pop() == tag

    Balance().feed((troubled / report.PAGE).read_text())
    assert not open_


def test_what_is_said_is_what_was_measured(troubled: Path) -> None:
    metrics, text = json.loads((troubled / "metrics.json").read_text()), read(troubled).text
    for name, m in metrics["trackers"].items():
        assert name in text
        assert f"RMSE {number(m['rmse']['position'], 'm')}" in text
    frames = metrics["frames"]
    assert f"{frames['lost']['radio']:,} ({percent(frames['lost']['radio'] / frames['expected'])})" in text
    assert f"used {joules(metrics['energy_j']['total'])} in all" in text
    for words in ("freeze until 3 s n001, n002 planned", "kill n036 planned", "battery empty", "partition"):
        assert words in text


def test_what_a_user_typed_is_text_and_nothing_else(copied: Path) -> None:
    manifest = json.loads((copied / "manifest.json").read_text())
    manifest["command"] = ["trackfield", "run", "<script>alert(1)</script>", "it's $HOME", "it's"]
    (copied / "manifest.json").write_text(json.dumps(manifest))
    report.write_report(copied)
    assert not any(tag == "script" for tag, _ in read(copied).tags)
    assert """trackfield run '<script>alert(1)</script>' 'it'"'"'s $HOME' "it's\"""" in read(copied).text


def test_a_report_made_anew_is_the_same_and_leaves_no_old_figure(troubled: Path, copied: Path) -> None:
    (copied / "plots" / "nees.png").write_bytes(b"old")
    report.write_report(copied)
    name = f" {troubled.name}"
    assert (copied / report.PAGE).read_text().replace(" copy", name) == (troubled / report.PAGE).read_text()
    with_tracks(copied, lambda table: table.slice(0, 0))
    report.write_report(copied)
    assert not (copied / "plots" / "nees.png").exists()


# --- figures against metrics.json -------------------------------------------------------------------------------------


def test_errors_and_nees_over_time_come_to_those_of_the_run(troubled: Path) -> None:
    read = read_run(troubled)
    for track in read.tracks:
        m = read.metrics["trackers"][track.tracker]
        assert np.sqrt(np.nanmean(np.square(track.error_m))) == pytest.approx(m["rmse"]["position"], rel=1e-12)
        assert np.nanmean(track.nees) == pytest.approx(m["nees"], rel=1e-12)
        assert np.isfinite(track.error_m).sum() == m["steps"]


def test_latencies_come_to_those_of_the_run(troubled: Path) -> None:
    read = read_run(troubled)
    names = {"on the link": "link", "sending to fusion": "to_filter", "step to track": "to_track"}
    for name, values in latencies(read).items():
        for share, key in ((0.5, "p50"), (0.95, "p95"), (1.0, "max")):
            expected = read.metrics["latency_ms"][names[name]][key]
            assert np.quantile(1e3 * values, share) == pytest.approx(expected, abs=1e-6)


def test_every_frame_has_its_bar(troubled: Path) -> None:
    read = read_run(troubled)
    assert sum(bar.share for bar in fates(read)) == pytest.approx(1.0)
    assert {bar.label for bar in fates(read)} >= {"delivered", "radio", "partition"}
    assert sum(n for n, *_ in read.frames.by_kind().values()) == read.metrics["frames"]["expected"]
    assert sum(n for _, n, _ in read.frames.by_kind().values()) == read.metrics["frames"]["delivered"]


# --- runs that are out of the ordinary --------------------------------------------------------------------------------


def test_a_run_in_which_nothing_was_heard(tmp_path: Path) -> None:
    folder = run(tmp_path / "deaf", "faults=[{kind='deaf', share=1, at_s=0}]", 'fusion.prior="none"')
    text = read(folder).text
    assert "No frame was sent" in text
    assert text.count("No track of the target at any of the 12 steps: no sensor sent a report.") == 2
    assert "No tracker had a track at a step with a known truth" in text
    assert not (folder / "plots" / "losses.png").exists()


def test_a_link_that_lets_nothing_through(tmp_path: Path) -> None:
    folder = run(tmp_path / "cut", "link.model=fixed", "link.loss=1")
    assert " lost on the link): no tracker had any report, only its prior." in read(folder).text


def test_a_run_that_has_no_tracks_has_a_report(copied: Path) -> None:
    with_tracks(copied, lambda table: table.slice(0, 0))
    report.write_report(copied)
    text = read(copied).text
    assert "ended early" not in text
    assert "No tracker had a track at a step with a known truth" in text


def test_a_run_that_ended_early_says_so(copied: Path) -> None:
    changed(copied, lambda metrics: metrics.update(ended_s=9.5))
    with_tracks(copied, lambda table: table.filter(pa.compute.less(table["step"], 10)))
    report.write_report(copied)
    text = read(copied).text
    assert "The run ended early, 9.5 s after its first step: 9 of 12 steps." in text
    assert "the same run from its folder" not in text
    assert "--exact 0" not in text
    assert "bit for bit" not in text
    assert "A run of the same scenario goes on to its planned end, 13 s after the first step." in text


def test_several_targets_each_have_their_lines(copied: Path) -> None:
    def twice(table: pa.Table) -> pa.Table:
        other = table.set_column(table.column_names.index("target"), "target", pa.array(["other"] * table.num_rows))
        return pa.concat_tables([table, other])

    with_tracks(copied, twice)
    read = read_run(copied)
    assert [(track.tracker, track.target) for track in read.tracks] == [
        (tracker, target) for tracker in ("imm-ukf", "spcpf") for target in ("target", "other")
    ]
    figure = FIGURES["error"](read)
    assert figure is not None
    labels = figure.axes[0].get_legend_handles_labels()[1]
    assert {"imm-ukf, target", "imm-ukf, other", "spcpf, target", "spcpf, other"} <= set(labels)


def test_a_tracker_that_diverged_to_no_number_has_a_report(copied: Path) -> None:
    def diverged(table: pa.Table) -> pa.Table:
        x = table["x"].to_numpy().copy()
        x[len(x) // 2 :] = np.inf
        return table.set_column(table.column_names.index("x"), "x", pa.array(x))

    with_tracks(copied, diverged)
    report.write_report(copied)


def test_only_what_is_much_larger_gets_a_map_aside(troubled: Path, tmp_path: Path) -> None:
    small = run(tmp_path / "small", "field.nodes=9")
    for folder, parts in ((small, 0), (troubled, 1)):
        figure = FIGURES["field"](read_run(folder))
        assert figure is not None
        assert sum(axes.get_title("left").startswith("whole field") for axes in figure.axes) == parts


def test_a_failure_to_draw_fails_no_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(folder: Path) -> Path:
        raise RuntimeError(f"no ink for {folder.name}")

    monkeypatch.setattr(report, "write_report", broken)
    outcome = run_virtual(planned(load("spcpf", settings=["target.steps=3"])), tmp_path)
    assert outcome.exit_code == 0
    assert outcome.unreported == f"RuntimeError: no ink for {tmp_path.name}"
    assert (tmp_path / "tracks.parquet").exists()
    conclude(replace(outcome, folder=Path("runs/x")))
    assert f"no report: RuntimeError: no ink for {tmp_path.name}" in capsys.readouterr().err
