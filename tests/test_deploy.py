"""The files of deploy/: manifests against their schemas and the command line, and the script of an array job, run."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import kubernetes_validate
import pytest
import yaml

from launcher.slices.asking import Share
from tests.running import PATIENCE_S, Run
from tests.sliced import free_endpoint

ROOT = Path(__file__).parents[1]
DEPLOY = ROOT / "deploy"
OLDEST = "1.31"
"""The first Kubernetes in which the policy of failed pods is as it will stay."""


# --- Kubernetes -------------------------------------------------------------------------------------------------------


@pytest.fixture
def manifest() -> dict[str, Any]:
    """The objects of the manifest by kind and name."""
    found = list(yaml.safe_load_all((DEPLOY / "kubernetes.yaml").read_text()))
    return {f"{one['kind']}/{one['metadata']['name']}": one for one in found}


def check(manifest: Mapping[str, Any]) -> None:
    """Raises ``kubernetes_validate.ValidationError`` for what Kubernetes would not take."""
    for one in manifest.values():
        for version in (OLDEST, kubernetes_validate.latest_version()):
            kubernetes_validate.validate(one, version, strict=True)


def pod(job: Mapping[str, Any]) -> Any:
    return job["spec"]["template"]["spec"]


def test_kubernetes_takes_the_manifest(manifest: dict[str, Any]) -> None:
    assert set(manifest) == {
        "PersistentVolumeClaim/trackfield-runs",
        "Service/trackfield-launcher",
        "Job/trackfield-launcher",
        "Job/trackfield-field",
    }
    check(manifest)


def _misspelt(job: Any) -> None:
    job["completionmode"] = job.pop("completionMode")


def _typed(job: Any) -> None:
    job["completions"] = "eight"


def _policy(job: Any) -> None:
    del job["podFailurePolicy"]["rules"][0]["onExitCodes"]["operator"]


def _condition(job: Any) -> None:
    del job["podFailurePolicy"]["rules"][1]["onPodConditions"][0]["status"]


def _container(job: Any) -> None:
    del job["template"]["spec"]["containers"][0]["name"]


@pytest.mark.parametrize("broken", [_misspelt, _typed, _policy, _condition, _container])
def test_kubernetes_would_not_take_a_broken_one(manifest: dict[str, Any], broken: Callable[[Any], None]) -> None:
    broken(manifest["Job/trackfield-field"]["spec"])
    with pytest.raises(kubernetes_validate.ValidationError):
        check(manifest)


def test_the_parts_of_the_manifest_find_each_other(manifest: dict[str, Any]) -> None:
    """What no schema says."""
    launcher, field, service = (
        manifest[name] for name in ("Job/trackfield-launcher", "Job/trackfield-field", "Service/trackfield-launcher")
    )
    assert service["spec"]["selector"].items() <= launcher["spec"]["template"]["metadata"]["labels"].items()
    (port,) = service["spec"]["ports"]
    (container,) = pod(launcher)["containers"]
    assert {"containerPort": port["port"]} in container["ports"]
    assert pod(field)["restartPolicy"] == "Never"  # or there is no policy of failed pods
    (slice_,) = pod(field)["containers"]
    assert field["spec"]["podFailurePolicy"]["rules"][0]["onExitCodes"]["containerName"] == slice_["name"]
    assert field["spec"]["completionMode"] == "Indexed"
    for job in (launcher, field):
        (one,) = pod(job)["containers"]
        volumes = {volume["name"] for volume in pod(job)["volumes"]}
        assert {mount["name"] for mount in one["volumeMounts"]} == volumes
    assert f"tls/{service['metadata']['name']}:{port['port']}" in slice_["command"]


def test_the_indexes_of_the_job_are_the_slices(manifest: dict[str, Any]) -> None:
    field = manifest["Job/trackfield-field"]["spec"]
    (slice_,) = field["template"]["spec"]["containers"]
    (which,) = (part for part in slice_["command"] if "$(JOB_COMPLETION_INDEX)" in part)
    count = field["completions"]
    assert field["parallelism"] == count
    shares = [Share.parse(which.replace("$(JOB_COMPLETION_INDEX)", str(index))) for index in range(count)]
    assert {share.of for share in shares} == {str(count)}
    assert {int(share.which) % count for share in shares} == set(range(count))


def commands() -> Iterator[tuple[str, list[str]]]:
    for one in yaml.safe_load_all((DEPLOY / "kubernetes.yaml").read_text()):
        if one["kind"] == "Job":
            (container,) = pod(one)["containers"]
            yield one["metadata"]["name"], [*container["command"], *container["args"]]


@pytest.mark.parametrize(("name", "command"), list(commands()), ids=lambda one: one if isinstance(one, str) else "")
def test_the_command_line_has_the_options_of_the_manifest(name: str, command: list[str]) -> None:
    from typer.main import get_command

    from launcher.cli import app

    program, which, *arguments = command
    assert program == "trackfield"
    group = get_command(app)
    found = group.commands[which]  # type: ignore[attr-defined]
    found.make_context(which, [one.replace("$(JOB_COMPLETION_INDEX)", "0") for one in arguments])


# --- SLURM ------------------------------------------------------------------------------------------------------------

SRUN = """#!/bin/sh
# As SLURM's, as far as the script uses it.
while [ "${1#--}" != "$1" ]; do shift; done
exec "$@"
"""


def test_shellcheck_finds_nothing() -> None:
    shellcheck = Path(sys.executable).with_name("shellcheck")
    done = subprocess.run([shellcheck, DEPLOY / "slurm.sh"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_the_directives_are_those_of_one_task_each() -> None:
    lines = [line for line in (DEPLOY / "slurm.sh").read_text().splitlines() if line.startswith("#SBATCH ")]
    assert "#SBATCH --ntasks=1" in lines
    assert not any("--array" in line for line in lines)  # so many slices as the user says


def tasks(home: Path, ids: list[int], step: int, *arguments: str) -> list[subprocess.Popen[bytes]]:
    """The tasks of an array job, as SLURM would start them on this machine."""
    tools = home / "bin"
    tools.mkdir()
    (tools / "srun").write_text(SRUN)
    (tools / "trackfield").write_text(f'#!/bin/sh\nexec {sys.executable} -m launcher "$@"\n')
    for tool in tools.iterdir():
        tool.chmod(tool.stat().st_mode | stat.S_IXUSR)
    given = {"SLURM_ARRAY_TASK_COUNT": len(ids), "SLURM_ARRAY_TASK_MIN": min(ids), "SLURM_ARRAY_TASK_STEP": step}
    environment = {
        **os.environ,
        **{key: str(value) for key, value in given.items()},
        "PATH": f"{tools}:{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
    }
    return [
        subprocess.Popen(
            ["sh", DEPLOY / "slurm.sh", *arguments], cwd=home, env={**environment, "SLURM_ARRAY_TASK_ID": str(number)}
        )
        for number in ids
    ]


@pytest.mark.parametrize(("ids", "step"), [([0, 1, 2], 1), ([10, 20, 30], 10)])
def test_an_array_job_is_the_field_of_a_run(tmp_path: Path, ids: list[int], step: int) -> None:
    endpoint, certificates = free_endpoint().replace("tcp/", "tls/"), tmp_path / "certificates"
    arguments = ("spcpf", "--nodes", "9", "--set", "sensor.threshold=0.5", "--set", "target.steps=5")
    made = ["certificates", *arguments, "--out", str(certificates), "--slices", str(len(ids))]
    subprocess.run([sys.executable, "-m", "launcher", *made], check=True, timeout=PATIENCE_S)
    outside = ("--field", "external", "--listen", endpoint, "--secure", "--certificates", str(certificates))
    run = Run(tmp_path / "run", *arguments, *outside)
    started = tasks(tmp_path, ids, step, endpoint, str(certificates / "guest"))
    code, said = run.finish()
    try:
        assert [one.wait(PATIENCE_S) for one in started] == [0, 0, 0]
    finally:
        for one in started:
            one.kill()
    assert code == 0, said
    assert run.metrics()["trackers"]["imm-ukf"]["verdict"] == "tracked"
    assert sorted(folder.name for folder in tmp_path.glob("slice-*-of-3")) == [f"slice-{i}-of-3" for i in range(3)]


def test_without_an_array_it_says_what_it_needs(tmp_path: Path) -> None:
    environment = {key: value for key, value in os.environ.items() if not key.startswith("SLURM_")}
    command = ["sh", DEPLOY / "slurm.sh", "tcp/127.0.0.1:7447"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "SLURM_ARRAY_TASK_ID: is not set; expected an array job: sbatch --array=1-8" in done.stderr
