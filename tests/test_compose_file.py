"""What compose.yaml says, without an engine: valid, closed, and with what each packaged scenario needs."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.command_line import Call, trackfield
from trackfield.scenario.packaged import names

__all__ = ["trackfield"]

ROOT = Path(__file__).parents[1]
FILE = ROOT / "compose.yaml"
COMPOSE: dict[str, Any] = yaml.safe_load(FILE.read_text())
SERVICES: dict[str, dict[str, Any]] = COMPOSE["services"]
SMALL = {"node", "slave", "forwarder", "camera", "video"}
"""Roles that need no numpy."""


def role(service: dict[str, Any]) -> str:
    """The role of a service's process, as the launcher calls it."""
    command = service["command"]
    assert command[:2] == ["python3", "-m"]
    return str(
        command[3] if not command[3].startswith("--") else {"camera": "camera-control"}.get(command[2], command[2])
    )


def schema(file: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", "vendor.compose-spec", str(file)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_it_follows_the_specification(tmp_path: Path) -> None:
    done = schema(FILE)
    assert done.returncode == 0, done.stdout
    broken = tmp_path / "compose.yaml"
    broken.write_text(FILE.read_text().replace("read_only: true\n", "read_only: [1]\n", 1))
    assert schema(broken).returncode != 0


@pytest.mark.parametrize("scenario", names())
def test_a_profile_has_what_its_scenario_needs(scenario: str, trackfield: Call) -> None:
    done = trackfield("validate", scenario, "--json", "--quiet")
    processes = json.loads(done.out)["processes"]
    started = {name: one for name, one in SERVICES.items() if scenario in one.get("profiles", ())}
    counts: Counter[str] = Counter()
    for name, one in started.items():
        if name != scenario:
            counts[role(one)] += one.get("scale", 1)
    assert counts == processes
    assert started[scenario]["entrypoint"].startswith("trackfield run ")
    assert started[scenario]["command"].split()[-1] == scenario


def test_there_is_a_part_for_each_role() -> None:
    parts = {name for name, one in SERVICES.items() if "parts" in one.get("profiles", ())} - {"launcher"}
    assert all(role(SERVICES[name]) == name for name in parts)
    assert {name for name in parts if not SERVICES[name]["image"].endswith(":full")} == SMALL


@pytest.mark.parametrize("name", SERVICES)
def test_each_container_is_closed(name: str) -> None:
    service = SERVICES[name]
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert "privileged" not in service and "cap_add" not in service
    assert service["user"] == "${TRACKFIELD_USER:-10001:10001}"
    assert service["mem_limit"]
    assert ("healthcheck" in service) != service.get("entrypoint", "").startswith("trackfield run")


def test_only_the_viewer_has_ports_and_these_on_this_machine() -> None:
    assert [name for name, one in SERVICES.items() if one.get("ports")] == ["viewer"]
    assert all(port.startswith("127.0.0.1:") for port in SERVICES["viewer"]["ports"])
    outward = {name for name, network in COMPOSE["networks"].items() if not (network or {}).get("internal")}
    assert {name for name, one in SERVICES.items() if outward & set(one["networks"])} == {"viewer"}


def test_a_container_has_only_the_certificates_that_it_needs() -> None:
    bound = {name: [one for one in service["volumes"] if type(one) is dict] for name, service in SERVICES.items()}
    assert all(one["read_only"] for some in bound.values() for one in some)
    folders = {name: [one["source"].rpartition("}")[2] for one in some] for name, some in bound.items()}
    assert folders.pop("router") == ["/router"]
    assert folders.pop("viewer") == []
    launchers = {name for name, one in SERVICES.items() if "entrypoint" in one}
    assert {name for name, found in folders.items() if found == [""]} == launchers
    assert all(found == ["/guest"] for name, found in folders.items() if name not in launchers)
    assert all(
        one["read_only"] for service in SERVICES.values() for one in service.get("volumes", ()) if type(one) is dict
    )
