"""The image that a field of containers stands on, and what is said where there is none; the engine is played."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
OFFICIAL, OWN = "python:3.11-slim", "trackfield/base:bookworm"
COMMANDS = ("sh", "dirname", "mktemp", "rm", "cat", "grep", "tail", "tar", "mkdir", "sleep", "make", "id", "find")
DOCKER = """
case "$1" in
info) [ "$ENGINE" = yes ] ;;
version) echo "permission denied" >&2; exit 1 ;;
image) grep -qx "$3" "$HERE/images" ;;
pull)
    echo "$2" >> "$HERE/asked"
    case "$PULL" in
    works) echo "Pulling from library/python" ;;
    hangs) exec sleep 60 ;;
    *) echo "no such host" >&2; exit 1 ;;
    esac ;;
import) cat >/dev/null; echo "$5" >> "$HERE/images" ;;
*) exit 1 ;;
esac
"""


class Machine:
    """A machine with those commands only that the scripts need, and what a test adds."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.commands = folder, folder / "commands"
        self.commands.mkdir()
        for command in COMMANDS:
            (self.commands / command).symlink_to(str(shutil.which(command)))
        self.has("docker", DOCKER)
        self.images()

    def has(self, command: str, script: str) -> None:
        path = self.commands / command
        path.unlink(missing_ok=True)
        path.write_text(f"#!/bin/sh\n{script}\n")
        path.chmod(0o755)

    def root_with_debootstrap(self) -> None:
        self.has("id", "echo 0")
        self.has("debootstrap", 'mkdir -p "$4/usr/share/doc"')

    def images(self, *names: str) -> None:
        (self.folder / "images").write_text("".join(f"{name}\n" for name in names))

    def asked(self) -> bool:
        """Whether a registry was asked."""
        return (self.folder / "asked").exists()

    def runs(self, *command: str, pull: str = "", engine: str = "yes") -> subprocess.CompletedProcess[str]:
        environment = {
            "PATH": str(self.commands),
            "HERE": str(self.folder),
            "PULL": pull,
            "ENGINE": engine,
            "TRACKFIELD_PULL_S": "1",
            "TMPDIR": str(self.folder),
        }
        return subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=30, check=False
        )


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


def test_the_official_image_is_taken_if_it_is_there(machine: Machine) -> None:
    machine.images(OFFICIAL, OWN)
    assert machine.runs("containers/base").stdout == f"{OFFICIAL}\n"
    assert not machine.asked()


def test_an_image_that_was_made_here_is_taken_without_asking_a_registry_again(machine: Machine) -> None:
    machine.images(OWN)
    assert machine.runs("containers/base", pull="works").stdout == f"{OWN}\n"
    assert not machine.asked()


def test_the_official_image_is_pulled(machine: Machine) -> None:
    machine.root_with_debootstrap()
    assert machine.runs("containers/base", pull="works").stdout == f"{OFFICIAL}\n"


@pytest.mark.parametrize("pull", ["fails", "hangs"])
def test_without_a_registry_one_is_made_from_debian_packages(machine: Machine, pull: str) -> None:
    machine.root_with_debootstrap()
    assert machine.runs("containers/base", pull=pull).stdout == f"{OWN}\n"
    assert machine.runs("containers/base", pull=pull).stdout == f"{OWN}\n"


def test_where_neither_can_be_had_make_says_why_and_what_helps(machine: Machine) -> None:
    python = machine.folder / "python"  # stands for that of the environment, so that none is made
    python.touch()
    done = machine.runs("make", "image", f"BIN={machine.folder}", pull="fails")
    assert done.returncode != 0
    assert f"no base image: {OFFICIAL} cannot be pulled (no such host)" in done.stderr
    assert "from Debian packages (needs root and debootstrap)" in done.stderr
    assert "apt install debootstrap" in done.stderr
    assert done.stderr.count("no base image") == 1


def test_a_debootstrap_that_fails_is_quoted(machine: Machine) -> None:
    machine.root_with_debootstrap()
    machine.has("debootstrap", "echo 'E: Failed getting release file'; exit 1")
    done = machine.runs("containers/base", pull="hangs")
    assert (done.returncode, done.stdout) == (1, "")
    assert "(no answer in 1 s)" in done.stderr
    assert "(E: Failed getting release file)" in done.stderr


@pytest.mark.parametrize("target", ["image", "field"])
def test_an_engine_that_may_not_be_used_is_said_so(machine: Machine, target: str) -> None:
    (machine.folder / "python").touch()
    done = machine.runs("make", target, f"BIN={machine.folder}", engine="no")
    assert done.returncode != 0
    assert "no container engine: permission denied" in done.stderr


def test_a_field_needs_compose(machine: Machine) -> None:
    done = machine.runs("make", "field")
    assert done.returncode != 0
    assert "no Compose" in done.stderr


def run_container_tests(machine: Machine, engine: str, strict: bool) -> subprocess.CompletedProcess[str]:
    machine.has("docker-compose", "exit 1")
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "tests/test_containers.py"]
    environment = os.environ | {"COLUMNS": "300", "TRACKFIELD_STRICT_SKIPS": str(int(strict))}
    environment |= {"PATH": str(machine.commands), "HERE": str(machine.folder), "PULL": "fails", "ENGINE": engine}
    return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize(
    ("engine", "reason"),
    [("yes", f"no base image: {OFFICIAL} cannot be pulled (no such host)"), ("no", "no container engine: permission")],
)
def test_tests_of_containers_are_skipped_for_that_reason(machine: Machine, engine: str, reason: str) -> None:
    done = run_container_tests(machine, engine, strict=False)
    assert done.returncode == 0, done.stdout
    assert "10 skipped" in done.stdout
    assert reason in done.stdout


def test_the_ci_does_not_do_without_tests_of_containers_where_an_engine_is(machine: Machine) -> None:
    done = run_container_tests(machine, "yes", strict=True)
    assert done.returncode == 1
    assert "unexpected skip: no base image" in done.stdout
