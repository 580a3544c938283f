"""The secret that the containers of a field share, as ``containers/field`` gives it to Compose; needs no engine."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
COMPOSE = """#!/bin/sh
echo "${TRACKFIELD_TOKEN-unset} $*" >>"$SAID"
"""


DOCKER = """#!/bin/sh
while [ "$1" != image:full ]; do shift; done
shift
case "$*" in
*"trackfield certificates"*) echo "certificates $*" | tail -n 1 >>"$MADE" ;;
*) exec "$@" ;;
esac
"""
TRACKFIELD = """#!/bin/sh
echo '{"processes": {"node": 4, "camera-control": 1}}'
"""


def calls(folder: Path, token: str | None) -> list[tuple[str, str]]:
    """The token and the arguments of each call of Compose, while a field runs."""
    shutil.copytree(ROOT / "containers", folder / "containers")
    (folder / "containers" / "compose").write_text("#!/bin/sh\necho recorder\n")
    for name, script in (("recorder", COMPOSE), ("docker", DOCKER), ("trackfield", TRACKFIELD)):
        command = folder / name
        command.write_text(script)
        command.chmod(0o755)
    environment = {key: value for key, value in os.environ.items() if key != "TRACKFIELD_TOKEN"}
    environment |= {"PATH": f"{folder}:{os.environ['PATH']}", "SAID": str(folder / "said"), "TRACKFIELD_IMAGE": "image"}
    environment |= {"MADE": str(folder / "made")}
    environment |= {} if token is None else {"TRACKFIELD_TOKEN": token}
    done = subprocess.run(
        [folder / "containers" / "field", "spcpf", "--nodes", "4"],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    lines = (folder / "said").read_text().splitlines()
    return [(line.partition(" ")[0], line.partition(" ")[2]) for line in lines]


@pytest.mark.parametrize("token", [None, ""])
def test_a_field_has_a_secret_of_its_own(tmp_path: Path, token: str | None) -> None:
    made = []
    for name in ("one", "other"):
        called = calls(tmp_path / name, token)
        assert [arguments.split()[0] for _, arguments in called] == ["up", "run", "down"]
        [secret] = {secret for secret, _ in called}
        assert len(bytes.fromhex(secret)) == 16
        assert secret not in " ".join(arguments for _, arguments in called)
        made.append(secret)
    assert made[0] != made[1]


def test_a_given_secret_is_kept(tmp_path: Path) -> None:
    assert {secret for secret, _ in calls(tmp_path / "one", "ours-and-yours")} == {"ours-and-yours"}


def test_a_field_has_a_container_for_each_process(tmp_path: Path) -> None:
    [(_, up), (_, run), _] = calls(tmp_path / "one", None)
    assert up == "up --detach --scale node=4 --scale camera-control=1 router node camera-control"
    assert run.split()[-1] == "launcher"


def test_each_service_takes_it_from_the_environment() -> None:
    """Not as a value in the file, nor on a command line."""
    lines = [line for line in (ROOT / "compose.yaml").read_text().splitlines() if "TRACKFIELD_TOKEN" in line]
    assert [line.split("#")[0].strip() for line in lines] == ["environment: [TRACKFIELD_TOKEN]"]
