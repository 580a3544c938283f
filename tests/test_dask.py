"""Studies and papers on a Dask cluster: a scheduler and two workers, as processes of this machine."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import joblib
import pyarrow.parquet as pq
import pytest

import trackfield as tf
from launcher.study import cluster
from launcher.study.parallel import computed, unordered
from tests.command_line import Call, trackfield
from tests.running import PATIENCE_S, killed_on_failure, until
from trackfield.errors import RunFailed, ScenarioError

__all__ = ["trackfield"]

ROOT = Path(__file__).parents[1]
FIELD = ("zhai-spcpf", "--set", "target.steps=6", "--set", "link.loss=0.2")
LONG = ("zhai-spcpf", "--set", "target.steps=40", "--seeds", "2000", "--out", "s")
HERE = re.escape(cluster.here())
IMPATIENT = "from launcher.study import cluster; cluster.NOBODY_S = 3; from launcher.cli import main; main()"
TRACK = "time_s,x,y\n" + "".join(f"{t},{-100 + 10 * t},0\n" for t in range(21))


class Dask:
    """A scheduler and its workers, of one thread each, in ``home``."""

    def __init__(self, home: Path, workers: int = 2, path: Path = ROOT) -> None:
        self.home, self.path = home, path
        self.said = (home / "dask.log").open("w")
        self.file = home / "scheduler.json"
        self.scheduler = self._started("scheduler", "--port", "0", "--host", "127.0.0.1")
        until(self.file.exists)
        self.workers = [self.worker() for _ in range(workers)]

    @property
    def address(self) -> str:
        return str(json.loads(self.file.read_text())["address"])

    def worker(self, path: Path | None = None) -> subprocess.Popen[bytes]:
        return self._started("worker", "--nthreads", "1", "--no-nanny", path=path)

    def end(self) -> None:
        for one in (*self.workers, self.scheduler):
            one.kill()
            one.wait()
        self.said.close()

    def _started(self, *arguments: str, path: Path | None = None) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "dask", *arguments, "--scheduler-file", str(self.file), "--no-dashboard"]
        environment = {**os.environ, "PYTHONPATH": str(path or self.path)}
        return subprocess.Popen(command, cwd=self.home, env=environment, stdout=self.said, stderr=self.said)


@contextmanager
def dask(home: Path, workers: int = 2, path: Path = ROOT) -> Iterator[Dask]:
    home.mkdir()
    found = Dask(home, workers, path)
    try:
        yield found
    finally:
        found.end()


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Dask]:
    with dask(tmp_path_factory.mktemp("cluster") / "dask") as found:
        yield found


# --- the same figures -------------------------------------------------------------------------------------------------


def test_a_study_on_a_cluster_is_the_same(shared: Dask, trackfield: Call) -> None:
    asked = ("study", *FIELD, "--seeds", 3, "--vary", "link.model=ideal,fixed")
    said = trackfield(*asked, "--dask", shared.address, "--out", "there")
    assert said.code == 0, said.err
    assert f"computed by 2 workers with 2 threads at {shared.address}" in said.err
    assert trackfield(*asked, "--jobs", 1, "--out", "here").code == 0
    for name in ("study.csv", "summary.csv"):
        assert Path("there", name).read_bytes() == Path("here", name).read_bytes()
    assert pq.read_table("there/tracks.parquet") == pq.read_table("here/tracks.parquet")


def test_the_runs_are_computed_there(shared: Dask) -> None:
    with cluster.cluster(shared.address):
        pids = set(joblib.Parallel(n_jobs=-1)(joblib.delayed(os.getpid)() for _ in range(20)))
    assert pids <= {one.pid for one in shared.workers}
    assert pids


def test_a_study_goes_on_where_it_was(shared: Dask, trackfield: Call) -> None:
    assert trackfield("study", *FIELD, "--seeds", 3, "--jobs", 1, "--out", "s").code == 0
    before = {file: file.stat().st_mtime_ns for file in Path("s/results").rglob("0*.parquet")}
    said = trackfield("study", *FIELD, "--seeds", 5, "--dask", shared.address, "--out", "s")
    assert said.code == 0, said.err
    assert "3 of 5 runs exist already" in said.err
    assert len(before) == 3
    assert {file: file.stat().st_mtime_ns for file in before} == before
    assert len(list(Path("s/results").rglob("0*.parquet"))) == 5


@pytest.mark.parametrize("paper", [("zhai",), ("zhou", "--kernels")])
def test_a_paper_on_a_cluster_is_the_same(shared: Dask, trackfield: Call, paper: tuple[str, ...]) -> None:
    for out, more in (("there", ("--dask", shared.address)), ("here", ())):
        assert trackfield("reproduce", *paper, "--runs", 2, "--out", out, *more).code == 0
    there, here = (json.loads(Path(out, "results.json").read_text()) for out in ("there", "here"))
    assert timeless(there) == timeless(here)
    assert timeless(here)


def timeless(results: Mapping[str, Any]) -> list[Any]:
    """The rows of a paper's tables, but for processor times."""
    return [row for rows in results["tables"].values() for row in rows if "time" not in row["quantity"]]


def test_a_scenario_with_files_of_trackfield_finds_them_at_the_worker(tmp_path: Path, trackfield: Call) -> None:
    """Workers have Trackfield in another folder."""
    copied = copy(tmp_path / "elsewhere")
    with dask(tmp_path / "dask", workers=1, path=copied) as found:
        asked = ("study", "bus", "--to", "15:30:20", "--seeds", 2)
        said = trackfield(*asked, "--dask", found.address, "--out", "there")
    assert said.code == 0, said.err
    assert trackfield(*asked, "--jobs", 1, "--out", "here").code == 0
    assert Path("there/study.csv").read_bytes() == Path("here/study.csv").read_bytes()


def copy(folder: Path) -> Path:
    """The same source, in a folder of its own."""
    for name in ("trackfield", "node", "fusion", "head", "gateway", "camera", "launcher"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "tests").symlink_to(ROOT / "tests")  # what other tests registered goes along
    return folder


# --- what goes wrong --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("address", "code", "expected"),
    [
        ("foo", 2, "--dask: is 'foo' (missing port number in address 'foo')"),
        ("http://127.0.0.1:80", 2, "--dask: is 'http://127.0.0.1:80'; expected that of a Dask scheduler"),
        ("tls://127.0.0.1:8786", 2, "--dask: has TLS, and the configuration of Dask names no certificates"),
        ("tcp://127.0.0.1:1", 1, "no Dask scheduler answers at tcp://127.0.0.1:1"),
    ],
)
def test_a_wrong_address_is_said(
    trackfield: Call, monkeypatch: pytest.MonkeyPatch, address: str, code: int, expected: str
) -> None:
    monkeypatch.setattr(cluster, "CONNECT_S", 0.5)
    said = trackfield("study", *FIELD, "--dask", address, "--out", "s")
    assert (said.code, said.out) == (code, "")
    (line,) = said.err.splitlines()
    assert line.startswith(f"trackfield: {expected}")
    assert not Path("s").exists()


def test_dask_and_jobs_exclude_each_other(trackfield: Call) -> None:
    said = trackfield("study", *FIELD, "--dask", "tcp://127.0.0.1:1", "--jobs", 2)
    assert said.code == 2
    assert said.err == "trackfield: --jobs: has no effect beside --dask; expected one of the two\n"


def test_without_dask_it_is_said_what_brings_it(tmp_path: Path) -> None:
    blocked = "import sys; sys.modules['distributed'] = None; from launcher.cli import main; main()"
    asked = [sys.executable, "-c", blocked, "study", *FIELD, "--dask", "tcp://127.0.0.1:1"]
    done = subprocess.run(asked, cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert done.returncode == 1
    said = "trackfield: --dask needs the package distributed, which is not installed; pip install 'trackfield[dask]'"
    assert done.stderr == f"{said} brings it\n"


def test_a_scheduler_without_workers_is_said(tmp_path: Path, trackfield: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "WORKERS_S", 0.5)
    with dask(tmp_path / "dask", workers=0) as found:
        said = trackfield("study", *FIELD, "--dask", found.address)
        address = found.address
    assert said.code == 1
    assert said.err == (
        f"trackfield: the Dask scheduler at {address} has no worker; dask worker {address} starts one\n"
    )


def test_a_worker_with_another_trackfield_is_refused(tmp_path: Path, trackfield: Call) -> None:
    other = copy(tmp_path / "other")
    with (other / "trackfield" / "link" / "__init__.py").open("a") as stream:
        stream.write("\n# another version\n")
    with dask(tmp_path / "dask", workers=1, path=other) as found:
        said = trackfield("study", *FIELD, "--seeds", 3, "--dask", found.address)
    assert said.code == 1
    (line,) = said.err.splitlines()
    assert re.fullmatch(rf"trackfield: the scheduler has Trackfield 0.1.0 \(.*\); expected {HERE}, as here", line)


def test_a_worker_without_trackfield_is_refused(tmp_path: Path, trackfield: Call) -> None:
    other = tmp_path / "other"
    (other / "launcher").mkdir(parents=True)
    (other / "launcher" / "__init__.py").write_text("""raise ModuleNotFoundError("No module named 'launcher'")""")
    with dask(tmp_path / "dask", workers=0) as found:
        found.workers.append(found.worker(other))
        said = trackfield("study", *FIELD, "--seeds", 3, "--dask", found.address)
    assert said.code == 1
    (line,) = said.err.splitlines()
    assert re.fullmatch(
        r"trackfield: the worker at tcp://127.0.0.1:\d+ has no Trackfield, or an older one "
        rf"\(No module named 'launcher'\); expected {HERE}, as here",
        line,
    )


def test_a_worker_with_another_trackfield_that_comes_later_is_refused() -> None:
    with pytest.raises(RunFailed, match=r"^a worker that came later, on .*; expected 0\.0\.9 \(abc\)$"):
        cluster._computed("0.0.9 (abc)", cluster._packed((len, ([],), {})))


def test_files_that_the_worker_does_not_have_are_said(shared: Dask, tmp_path: Path, trackfield: Call) -> None:
    file = tmp_path / "track.csv"
    file.write_text(TRACK)
    whole = tf.Scenario.load("zhai-spcpf", {"target.path": "file", "target.file": str(file)})
    call = cluster._packed((len, ([whole],), {}))
    file.write_text(TRACK.replace(",0\n", ",1\n"))
    with pytest.raises(RunFailed, match="have other contents, for the worker on"):
        cluster._computed(cluster.here(), call)
    file.unlink()
    with pytest.raises(RunFailed, match="are not there, or have other contents, for the worker on"):
        cluster._computed(cluster.here(), call)


# --- what is lost -----------------------------------------------------------------------------------------------------


def started(home: Path, address: str) -> subprocess.Popen[str]:
    """A long study on a cluster, of which some runs are done."""
    asked = [sys.executable, "-c", IMPATIENT, "study", *LONG, "--dask", address]
    running = subprocess.Popen(asked, cwd=home, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    with killed_on_failure(running):
        until(lambda: done(home) >= 3)
    return running


def done(home: Path) -> int:
    return len(list(home.rglob("0*.parquet")))


def ended(running: subprocess.Popen[str]) -> tuple[int, str]:
    with killed_on_failure(running):
        _, err = running.communicate(timeout=PATIENCE_S)
    assert "Traceback" not in err
    return running.returncode, err.splitlines()[-1]


def test_the_others_do_the_work_of_a_worker_that_dies(tmp_path: Path) -> None:
    with dask(tmp_path / "dask") as found:
        running = started(tmp_path, found.address)
        found.workers[0].kill()
        before = done(tmp_path)
        with killed_on_failure(running):
            until(lambda: done(tmp_path) >= before + 10)
        assert running.poll() is None
        running.send_signal(signal.SIGINT)
        code, last = ended(running)
    assert code == 130
    assert (
        last == f"interrupted: {done(tmp_path)} of 2000 runs are done and kept in s; the same command runs the others"
    )


def test_a_study_ends_if_all_workers_are_gone(tmp_path: Path) -> None:
    with dask(tmp_path / "dask") as found:
        running = started(tmp_path, found.address)
        for worker in found.workers:
            worker.kill()
        code, last = ended(running)
        assert (code, last) == (1, f"trackfield: all workers of the Dask scheduler at {found.address} are gone")


def test_a_study_ends_if_the_scheduler_is_gone(tmp_path: Path) -> None:
    with dask(tmp_path / "dask") as found:
        running = started(tmp_path, found.address)
        address = found.address
        found.scheduler.kill()
        code, last = ended(running)
    assert (code, last) == (1, f"trackfield: the connection to the Dask scheduler at {address} was lost")


def test_a_job_that_ends_its_workers_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "0")
    with (
        dask(tmp_path / "dask") as found,
        pytest.raises(RunFailed, match="1 workers died one after the other while they did a job"),
        computed(found.address),
    ):
        list(unordered(_ends, [False, True, False]))


def _ends(job: bool) -> None:
    if job:
        os._exit(1)


def test_what_a_job_raises_is_raised_here(shared: Dask) -> None:
    with computed(shared.address), pytest.raises(ScenarioError, match=r"^--key: is wrong; expected right$"):
        list(unordered(_raises, [False, True]))


def _raises(job: bool) -> None:
    if job:
        raise ScenarioError("is wrong", key="--key", expected="right")
