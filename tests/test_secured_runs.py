"""Secured runs over real processes: the same as any other, for those who have certificates."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
import zenoh

from launcher.plan.prepare import load, planned
from launcher.processes.endpoint import Way
from launcher.run import Outcome, run_processes
from launcher.security.security import Security, Wanted, made
from launcher.show import Quiet
from launcher.study.compare import differences
from tests.authorities import root_in
from tests.command_line import Call, trackfield
from tests.outside import process
from tests.running import Run, on_time, until
from tests.secured import free_endpoint, router_by_itself
from trackfield.drivers.session import open_client
from trackfield.errors import RunFailed

__all__ = ["trackfield"]

FIELD = ("spcpf", "--nodes", "4", "--set", "target.steps=12", "--set", "sensor.threshold=0.5")
NAMES = ("fusion", "n000", "n001", "n002", "n003")


@pytest.fixture(scope="module")
def virtual(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run in virtual time."""
    folder = tmp_path_factory.mktemp("virtual") / "run"
    code, said = Run(folder, *FIELD, "--virtual").finish()
    assert code == 0, said
    return folder


def nobody(run: Run) -> bool:
    """Whether nobody interfered with a run, and nothing was taken for interference."""
    return not any(count for count in run.metrics()["interference"].values())


@contextmanager
def field_by_hand(endpoint: str, folders: dict[str, Path], home: Path, *, named: bool) -> Iterator[None]:
    """All processes of the field as if started on other hosts; they have nothing to complain of."""
    with ExitStack() as stack:
        logs = []
        for name in NAMES:
            logs.append(home / f"{name}.said")
            place = ("--id", name) if named else ()
            shown = ("--connect", endpoint, "--secure", str(folders[name]), "--wait", *place)
            stack.enter_context(process("fusion" if name == "fusion" else "node", *shown, said=logs[-1]))
        yield
        assert [log.read_text() for log in logs] == [""] * len(logs)


def test_a_secured_run_is_that_of_virtual_time_and_lets_nobody_in(virtual: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    code, said = on_time(folder, *FIELD, "--secure")
    assert code == 0, said
    assert differences(folder, virtual, 0.0) == []
    assert not any(b"PRIVATE KEY" in file.read_bytes() for file in folder.rglob("*") if file.is_file())


def test_a_stranger_at_the_port_of_a_secured_run_comes_to_nothing(tmp_path: Path) -> None:
    run = Run(tmp_path / "run", *FIELD, "--secure")
    run.started()
    endpoint = run.manifest()["endpoint"]
    assert endpoint.startswith("tls/127.0.0.1:")
    for place in (endpoint, endpoint.replace("tls/", "tcp/")):
        with pytest.raises(zenoh.ZError):
            open_client(place, run.manifest()["run"], 2.0)
    code, said = run.finish()
    assert run.metrics()["processes"]["died"] == []
    assert "died" not in said
    assert code in (0, 1)  # such attempts are counted


@pytest.mark.parametrize(("named", "protocol"), [(False, "tls"), (True, "quic")], ids=["guests", "named"])
def test_processes_that_start_elsewhere_show_certificates_or_get_them(
    named: bool, protocol: str, trackfield: Call, tmp_path: Path, virtual: Path
) -> None:
    """As guests with the same certificate, or each with its own; by a router by itself, under an authority of ours."""
    root_in(tmp_path / "ca")
    made = tmp_path / "certificates"
    assert trackfield("certificates", *FIELD, "--out", made, "--ca", tmp_path / "ca").code == 0
    endpoint = free_endpoint(protocol)
    folders = dict.fromkeys(NAMES, made if named else made / "guest")
    with (
        router_by_itself(made, endpoint, tmp_path / "router"),
        field_by_hand(endpoint, folders, tmp_path, named=named),
    ):
        secure = ("--secure", "--certificates", str(made), "--external", "--connect", endpoint)
        run = Run(tmp_path / "run", *FIELD, *secure)
        code, said = run.finish()
        assert code == 0, said
    assert nobody(run)
    assert run.metrics()["processes"]["died"] == []
    assert differences(run.folder, virtual, 0.0) == []


def test_a_run_makes_certificates_for_its_guests_and_listens_for_them(tmp_path: Path, virtual: Path) -> None:
    endpoint, made = free_endpoint(), tmp_path / "certificates"
    secure = ("--secure", "--certificates", str(made), "--listen", endpoint, "--field", "external")
    run = Run(tmp_path / "run", *FIELD, *secure)
    until((made / "run.json").exists)
    with ExitStack() as stack:
        for name in NAMES[1:]:
            shown = ("--connect", endpoint, "--secure", str(made / "guest"), "--wait")
            stack.enter_context(process("node", *shown, said=tmp_path / f"{name}.said"))
        code, said = run.finish()
    assert code == 0, said
    assert nobody(run)
    assert differences(run.folder, virtual, 0.0) == []


def test_a_process_whose_certificate_expires_is_out_and_the_run_goes_on(tmp_path: Path) -> None:
    """Its lifetime grows until the field starts within it, however slow the machine is."""
    plan = replace(planned(load("spcpf", nodes=4, settings=["target.steps=40", "sensor.threshold=0.5"])))
    security, authority = made(plan, Wanted())

    def outcome(lifetime_s: float) -> Outcome:
        def issue(name: str) -> object:
            soon = datetime.now(UTC) + timedelta(seconds=lifetime_s)
            return authority.issue(name, soon if name == "n001" else None)

        folder = tmp_path / f"{lifetime_s:g}"
        (folder / "logs").mkdir(parents=True)
        short = Security(issue, security.settings)  # type: ignore[arg-type]
        return run_processes(plan, folder, Quiet(), [], Way(security=short))

    try:
        ended = outcome(15)
    except RunFailed:
        ended = outcome(35)
    assert ended.exit_code == 1
    assert {one["id"] for one in ended.metrics["processes"]["died"]} == {"n001"}
    assert ended.metrics["ended_s"] >= plan.info.end_s
