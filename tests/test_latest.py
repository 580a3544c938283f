"""``latest`` as a run: on the command line and from Python."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

import trackfield as tf
from launcher.record.latest import run_folder
from tests.command_line import Call, trackfield

__all__ = ["trackfield"]

SHORT = ("run", "zhai-spcpf", "--virtual", "--quiet", "--set", "target.steps=5")


def folders(home: Path, **started: str | None) -> None:
    """Run folders below runs/ that were started then; None: not finished yet."""
    for name, when in started.items():
        folder = home / "runs" / name
        folder.mkdir(parents=True)
        (folder / "manifest.json").write_text(json.dumps({"started": when or "2030-01-01T00:00:00+00:00"}))
        if when is not None:
            (folder / "metrics.json").write_text("{}")


def test_the_newest_is_that_which_was_started_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    day = "2026-05-0{}T10:00:00+00:00"
    folders(tmp_path, zoo=day.format(1), ant=day.format(3), bee=day.format(2), unfinished=None)
    (tmp_path / "runs" / "broken").mkdir()
    for name in ("manifest.json", "metrics.json"):
        (tmp_path / "runs" / "broken" / name).write_text("no JSON")
    assert [run_folder(f"latest{back}").name for back in ("", "~0", "~1", "~2")] == ["ant", "ant", "bee", "zoo"]
    assert run_folder("./latest") == run_folder(Path("latest")) == Path("latest")
    assert run_folder("latest-field") == Path("latest-field")
    with pytest.raises(
        tf.ScenarioError, match="latest~3: there are 3 finished runs below runs/; expected latest to la"
    ):
        run_folder("latest~3")


def test_a_run_that_is_removed_meanwhile_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    folders(tmp_path, ant="2026-05-03T10:00:00+00:00", bee="2026-05-02T10:00:00+00:00")
    read = Path.read_bytes

    def removed(file: Path) -> bytes:
        content = read(file)
        if file.parent.name == "ant":
            shutil.rmtree(file.parent)
        return content

    monkeypatch.setattr(Path, "read_bytes", removed)
    assert run_folder("latest").name == "bee"


@pytest.mark.parametrize("command", [("view",), ("report",), ("replay",), ("compare", "latest~1")])
def test_where_there_is_none_that_is_told(trackfield: Call, tmp_path: Path, command: tuple[str, ...]) -> None:
    folders(tmp_path, unfinished=None)
    said = trackfield(*command, "latest")
    assert (said.code, said.out) == (2, "")
    assert "there is no finished run below runs/; expected the folder of a run" in said.err


def test_every_command_that_takes_a_run_takes_the_latest(
    trackfield: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for seed in (1, 2):
        assert trackfield(*SHORT, "--seed", seed).code == 0
    first, second = sorted((tmp_path / "runs").iterdir())
    assert trackfield("report", "latest").out == f"runs/{second.name}/report.html\n"
    monkeypatch.setenv("COLUMNS", "200")
    beside = trackfield("compare", "latest~1", "latest")
    assert beside.code == 0
    assert beside.out.index(first.name) < beside.out.index(second.name)
    seen: list[Path] = []
    monkeypatch.setattr("launcher.timeline.view.open_viewer", lambda run, *_: seen.append(run))
    assert trackfield("view", "latest~1").code == 0
    assert seen == [Path("runs") / first.name]
    assert tf.open("latest").path == Path("runs") / second.name
    replayed = tf.replay("latest~1", ["ukf"])
    assert list(replayed.metrics.trackers) == ["ukf"]
    assert tf.open("latest").path == replayed.path
