"""The examples of docs/extending.md, run as they are printed: alone, together, over processes, and installed."""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any, Final

import pytest

from launcher.study.compare import differences
from tests.command_line import Call, trackfield
from tests.running import SPEEDS, kept_up, until
from trackfield.drivers.ports import HOLD_NS, Port

__all__ = ["trackfield"]

ROOT: Final = Path(__file__).parents[1]
DOCS: Final = (ROOT / "docs" / "extending.md").read_text()
EXAMPLES: Final = dict(re.findall(r"`(\w+\.py)`:\n\n```python\n(.*?)```", DOCS, re.DOTALL))
PROMISED: Final = {name: ast.literal_eval(said) for name, said in re.findall(r"python (\w+\.py) +# (\{.*?\})", DOCS)}

PRINTED: Final = {"kalman.py", "sonar.py", "strength.py", "two_centres.py", "base_node.py", "console.py", "display.py"}

TOGETHER: Final = """
import sys
import trackfield as tf
from kalman import Kalman
from sonar import Sonar

tf.register_tracker("kalman", Kalman)
tf.register_sensor("sonar", Sonar)
settings = {"sensor.kind": "sonar", "fusion.trackers": ["kalman", "ekf"], "field.nodes": 16, "target.steps": 4}
scenario = tf.Scenario.load("spcpf", settings)
driver, speed, out = sys.argv[1:]
tf.run(scenario, driver=driver, speed=float(speed) if driver == "processes" else None, out=out)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A directory that holds the examples."""
    assert EXAMPLES.keys() == PROMISED.keys() == PRINTED
    for name, code in EXAMPLES.items():
        (tmp_path / name).write_text(code)
    return tmp_path


def python(folder: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    paths = os.pathsep.join(filter(None, (environment.pop("PYTHONPATH", ""), str(ROOT))))
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, **environment, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_gives_what_the_document_says(name: str, folder: Path) -> None:
    said = python(folder, name)
    assert said.returncode == 0, said.stderr
    assert ast.literal_eval(said.stdout) == pytest.approx(PROMISED[name], rel=1e-6)


def test_the_stated_hold_is_the_hold() -> None:
    (stated,) = re.findall(r"later than they are written, (\d+) ms by default", DOCS)
    assert int(stated) * 1_000_000 == HOLD_NS == Port().hold_ns


def test_both_together_are_the_same_over_processes(folder: Path) -> None:
    """A program elsewhere, with the examples on PYTHONPATH."""
    elsewhere = folder / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "together.py").write_text(TOGETHER)

    def run(driver: str, speed: float, out: str) -> dict[str, Any]:
        said = python(elsewhere, "together.py", driver, str(speed), out, PYTHONPATH=str(folder))
        assert said.returncode == 0, said.stderr
        return json.loads((elsewhere / out / "metrics.json").read_text())  # type: ignore[no-any-return]

    run("virtual", 1.0, "virtual")
    out, metrics = next((out, m) for s in SPEEDS if kept_up(m := run("processes", s, out := f"processes-{s}")))
    assert metrics["trackers"]["kalman"]["steps"] == 4
    assert metrics["frames"]["by_kind"]["measurement"]["sent"] > 4
    assert list(differences(elsewhere / "virtual", elsewhere / out, 0.0)) == []


def test_a_class_of_the_main_program_is_refused_before_anything_starts(folder: Path) -> None:
    (folder / "main.py").write_text(EXAMPLES["kalman.py"].replace("    from kalman import Kalman", "    #"))
    said = python(folder, "main.py", "processes")
    assert said.returncode == 1
    assert "ScenarioError: tracker 'kalman': is defined in the main program, where other processes " in said.stderr
    assert not (folder / "runs").exists()


def test_a_program_reads_the_tracks_that_go_to_a_device(folder: Path) -> None:
    """The display's emulated process would publish them: both trackers', of all steps."""
    (reader,) = re.findall(r"`reader.py` is the program at the other end:\n\n```python\n(.*?)```", DOCS, re.DOTALL)
    (folder / "reader.py").write_text(reader)
    short = '"architecture.kind": "with-display", "target.steps": 6, "field.nodes": 16'
    code = EXAMPLES["display.py"].replace('"architecture.kind": "with-display"', short)
    (folder / "display.py").write_text(code)
    paths = os.pathsep.join(filter(None, (os.environ.get("PYTHONPATH", ""), str(ROOT))))
    environment = {**os.environ, "PYTHONPATH": paths}
    command = [sys.executable, "display.py", "pty"]
    with subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True) as field:
        link = until(lambda: next(folder.glob("runs/*/display.tty"), None))
        said = python(folder, "reader.py", str(link), PYTHONPATH=paths)
        assert said.returncode == 0, said.stderr
        assert ast.literal_eval(field.communicate()[0]) == {"fusion": 6}
    shown = re.findall(r"^(\d)\.0 s: tracker ([01]), \d+ reports$", said.stdout, re.MULTILINE)
    assert len(shown) == said.stdout.count("\n")
    assert {("4", "0"), ("4", "1"), ("5", "0"), ("5", "1")} <= set(shown)  # it may come late


def test_installed_they_are_there_by_name(folder: Path) -> None:
    """The entry points of the document, as pip writes them down."""
    (snippet,) = (text for text in re.findall(r"```toml\n(.*?)```", DOCS, re.DOTALL) if "entry-points" in text)
    info = folder / "mine-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
    groups: dict[str, Any] = tomllib.loads(snippet)["project"]["entry-points"]
    lines = [
        f"[{group}]\n" + "".join(f"{n} = {place}\n" for n, place in some.items()) for group, some in groups.items()
    ]
    (info / "entry_points.txt").write_text("\n".join(lines))
    elsewhere = folder / "elsewhere"
    elsewhere.mkdir()
    listed = python(elsewhere, "-m", "launcher.cli", "list", PYTHONPATH=str(folder)).stdout
    assert re.search(r"^trackers .*(\n +.*)*\bkalman$", listed, re.MULTILINE)
    assert re.search(
        r"^architectures  centralised, clusters, location-central, elected, cpa, two-centres$", listed, re.MULTILINE
    )
    assert re.search(r"^sensors +doa, range, rss, energy, cpa, sonar$", listed, re.MULTILINE)
    described = python(elsewhere, "-m", "launcher.cli", "list", "trackers", PYTHONPATH=str(folder)).stdout
    assert re.search(r"^kalman  .* \(kalman:Kalman\)$", described, re.MULTILINE)
    (command,) = re.findall(r"^trackfield (run zhai-spcpf .* sensor.kind=sonar .*)$", DOCS, re.MULTILINE)
    options = ("--set", "target.steps=5", "--json", "--quiet")
    said = python(elsewhere, "-m", "launcher.cli", *command.split(), *options, PYTHONPATH=str(folder))
    assert said.returncode == 0, said.stderr
    assert json.loads(said.stdout)["trackers"].keys() == {"kalman", "ekf"}
    (command,) = re.findall(r"^trackfield (run zhai-spcpf .* architecture.kind=.*)$", DOCS, re.MULTILINE)
    said = python(elsewhere, "-m", "launcher.cli", *command.split(), *options, PYTHONPATH=str(folder))
    assert said.returncode == 0, said.stderr
    assert json.loads(said.stdout)["trackers"]["spcpf"]["sources"] == {"base": 5, "east": 5, "west": 5}


def test_the_variant_of_the_document_runs(trackfield: Call) -> None:
    (command,) = re.findall(r"^trackfield (run .*) --set \"(fusion.options.few=.*)\"$", DOCS, re.MULTILINE)
    said = trackfield(*command[0].split(), "--set", command[1], "--set", "target.steps=3", "--json", "--quiet")
    assert json.loads(said.out)["trackers"].keys() == {"spcpf", "few"}
