"""Authorities of runs, and folders of certificates: what is in them, and every way in which one can be wrong."""

from __future__ import annotations

import json
import shutil
import stat
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
import trustme
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding
from hypothesis import given
from hypothesis import strategies as st

from launcher.plan.prepare import load, planned
from launcher.records import LIVE, RECORDER, ROUTER, Plan
from launcher.security.authority import Authority, lifetime_s
from launcher.security.security import Wanted, kept_in, made_in, named_in
from tests.authorities import root_in, write
from trackfield.drivers.session import Credentials
from trackfield.errors import ScenarioError
from trackfield.wire import keys


def certificate(credentials: Credentials) -> x509.Certificate:
    return x509.load_pem_x509_certificate(credentials.certificate.encode())


def named(credentials: Credentials) -> set[str]:
    names = certificate(credentials).extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    return {*names.get_values_for_type(x509.DNSName), *map(str, names.get_values_for_type(x509.IPAddress))}


@pytest.fixture(scope="module")
def plan() -> Plan:
    return planned(load("spcpf", nodes=4, settings=["target.steps=5"]))


@pytest.fixture
def folder(plan: Plan, tmp_path: Path) -> Path:
    made_in(tmp_path / "certificates", plan, Wanted())
    return tmp_path / "certificates"


# --- authorities ------------------------------------------------------------------------------------------------------


def test_a_router_is_found_by_this_machines_names_and_those_that_it_is_told() -> None:
    authority = Authority("run-1", 60.0, ["Router", "10.0.0.7", "fd00::7"])
    assert {"localhost", "127.0.0.1", "::1", "router", "10.0.0.7", "fd00::7"} <= named(authority.issue(ROUTER))
    assert named(authority.issue("n0")) == {"process.invalid"}


@pytest.mark.parametrize("host", ["", "a b", "-a", "a..b", "https://a", "a:1", "x" * 64, "ä"])
def test_what_is_no_host_is_refused(host: str) -> None:
    with pytest.raises(ScenarioError, match="is no host"):
        Authority("run-1", 60.0, [host])


def test_certificates_expire_and_begin_a_while_before_now() -> None:
    now = datetime.now(UTC)
    authority = Authority("run-1", 3600.0)
    made, soon = certificate(authority.issue("n0")), certificate(authority.issue("n1", now + timedelta(seconds=90)))
    assert timedelta(seconds=3590) < made.not_valid_after_utc - now < timedelta(seconds=3700)
    assert now - made.not_valid_before_utc > timedelta(minutes=59)
    assert soon.not_valid_after_utc - now <= timedelta(seconds=90)


@given(st.floats(0, 1e7), st.none() | st.floats(0.001, 3650))
def test_certificates_are_valid_for_a_day_or_twice_the_run_or_as_told(length_s: float, days: float | None) -> None:
    assert lifetime_s(length_s, days) == (max(86_400, 2 * length_s) if days is None else days * 86_400)


@given(st.from_regex(keys._ID, fullmatch=True))
def test_every_id_can_be_a_common_name(id: str) -> None:
    names = certificate(AUTHORITY.issue(id)).subject.get_attributes_for_oid(x509.NameOID.COMMON_NAME)
    assert [one.value for one in names] == [id]


AUTHORITY = Authority("a-run-with-a-name-that-is-longer-than-the-64-characters-of-a-unit-in-x520-1-0badcafe", 60.0)


def test_an_authority_of_ones_own_certifies_that_of_the_run(tmp_path: Path) -> None:
    root = x509.load_pem_x509_certificate(root_in(tmp_path / "ca").cert_pem.bytes())
    authority = Authority("run-1", 60.0, ca=tmp_path / "ca")
    chain = x509.load_pem_x509_certificates(authority.issue("n0").certificate.encode())
    assert len(chain) == 2
    chain[0].verify_directly_issued_by(chain[1])
    chain[1].verify_directly_issued_by(root)
    limits = chain[1].extensions.get_extension_for_class(x509.BasicConstraints).value
    assert (limits.ca, limits.path_length) == (True, 0)
    assert authority.certificate.encode() == chain[1].public_bytes(Encoding.PEM)


def no_folder(ca: Path) -> str:
    return "cannot be read (No such file or directory)"


def no_key(ca: Path) -> str:
    root_in(ca)
    (ca / "authority.key").unlink()
    return "authority.key: --ca: cannot be read"


def another_key(ca: Path) -> str:
    write(ca, trustme.CA().cert_pem.bytes(), trustme.CA().private_key_pem.bytes(), trustme.CA())
    return "is not for the key in authority.key"


def no_pem(ca: Path) -> str:
    root = trustme.CA()
    write(ca, b"nonsense", root.private_key_pem.bytes(), root)
    return "holds no authority"


def a_processs(ca: Path) -> str:
    root = trustme.CA()
    leaf = root.issue_cert("localhost")
    write(ca, leaf.cert_chain_pems[0].bytes(), leaf.private_key_pem.bytes(), root)
    return "may certify no other authority"


def too_low(ca: Path) -> str:
    root = trustme.CA(path_length=0)
    write(ca, root.cert_pem.bytes(), root.private_key_pem.bytes(), root)
    return "may certify no other authority"


@pytest.mark.parametrize("wrong", [no_folder, no_key, another_key, no_pem, a_processs, too_low])
def test_what_is_no_authority_is_refused(wrong: Callable[[Path], str], tmp_path: Path) -> None:
    what = wrong(tmp_path / "ca")
    with pytest.raises(ScenarioError) as error:
        Authority("run-1", 60.0, ca=tmp_path / "ca")
    assert what in str(error.value)
    assert "--ca" in str(error.value)


# --- folders ----------------------------------------------------------------------------------------------------------


def test_a_folder_has_one_of_each_and_is_its_owners_alone(folder: Path, plan: Plan) -> None:
    names = {"launcher", ROUTER, RECORDER, LIVE, "guest", *plan.ids}
    files = {f"{name}{end}" for name in names for end in (".pem", ".key")} | {
        "authority.pem",
        "run.json",
        "router.json",
    }
    assert {file.name for file in folder.iterdir()} == files | {"guest"}
    assert {file.name for file in (folder / "guest").iterdir()} == {"authority.pem", "guest.pem", "guest.key"}
    modes = {stat.S_IMODE(file.stat().st_mode) for file in folder.rglob("*") if file.is_file()}
    assert modes == {0o600}
    assert {stat.S_IMODE(one.stat().st_mode) for one in (folder, folder / "guest")} == {0o700}
    told = "".join(file.read_text() for file in (folder / "run.json", folder / "router.json"))
    assert "PRIVATE KEY" not in told


def test_the_run_takes_its_id_from_the_folder(folder: Path, plan: Plan) -> None:
    again = planned(load("spcpf", nodes=4, settings=["target.steps=5"]))
    assert again.run.run != plan.run.run
    again = named_in(again, folder)
    assert (again.run.run, again.info.run) == (plan.run.run, plan.run.run)
    kept = kept_in(folder, again)
    assert certificate(kept.credentials("n001")).subject == certificate(kept.credentials("n001")).subject
    for name in ("launcher", ROUTER, RECORDER, LIVE, *plan.ids):
        assert kept.credentials(name) is kept.credentials(name)


def test_a_folder_in_use_is_not_written_again(folder: Path, plan: Plan) -> None:
    before = {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()}
    with pytest.raises(ScenarioError, match="cannot be written"):
        made_in(folder, plan, Wanted())
    assert {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()} == before


def another_run(folder: Path, plan: Plan) -> None:
    facts = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(facts | {"seed": 7}))


def incomplete(folder: Path, plan: Plan) -> None:
    (folder / "n001.key").unlink()


def over(folder: Path, plan: Plan) -> None:
    facts = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(facts | {"expires": datetime.now(UTC).isoformat()}))


def no_date(folder: Path, plan: Plan) -> None:
    facts = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(facts | {"expires": "soon"}))


def naive_date(folder: Path, plan: Plan) -> None:
    facts = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(facts | {"expires": "2100-01-01"}))


def strange_run(folder: Path, plan: Plan) -> None:
    facts = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(facts | {"run": "**"}))


def no_facts(folder: Path, plan: Plan) -> None:
    (folder / "run.json").write_text("[]")


def damaged(folder: Path, plan: Plan) -> None:
    (folder / "run.json").write_text('{"run": ')


def open_to_all(folder: Path, plan: Plan) -> None:
    (folder / "router.json").write_text('{"access_control": {"enabled": true, "default_permission": "allow"}}')


def other_rules(folder: Path, plan: Plan) -> None:
    text = (folder / "router.json").read_text()
    assert "/telemetry/n001/" in text
    (folder / "router.json").write_text(text.replace("/telemetry/n001/", "/telemetry/n002/"))


def no_rules(folder: Path, plan: Plan) -> None:
    (folder / "router.json").write_text('{"access_control": {"enabled": true, "default_permission": "deny"}}')


def not_enabled(folder: Path, plan: Plan) -> None:
    (folder / "router.json").write_text('{"access_control": {"enabled": false, "default_permission": "deny"}}')


def another_authority(folder: Path, plan: Plan) -> None:
    (folder / "authority.pem").write_text(Authority(plan.run.run, 60.0).certificate)


def anothers(folder: Path, plan: Plan) -> None:
    shutil.copy(folder / "n001.pem", folder / "launcher.pem")


def anothers_key(folder: Path, plan: Plan) -> None:
    shutil.copy(folder / "n001.key", folder / "launcher.key")


def unreadable(folder: Path, plan: Plan) -> None:
    (folder / "launcher.key").unlink()
    (folder / "launcher.key").mkdir()


def no_certificate(folder: Path, plan: Plan) -> None:
    (folder / "launcher.pem").write_text("-----BEGIN CERTIFICATE-----\nnonsense\n-----END CERTIFICATE-----\n")


@pytest.mark.parametrize(
    ("wrong", "what"),
    [
        (another_run, "is for zhai-spcpf with seed 7, not zhai-spcpf with seed 1"),
        (incomplete, "has no certificate and key of n001"),
        (over, "before this run could end"),
        (no_date, "run.json: --certificates: does not say what it is for"),
        (naive_date, "run.json: --certificates: does not say what it is for"),
        (strange_run, "run.json: --certificates: does not say what it is for"),
        (no_facts, "run.json: --certificates: is damaged"),
        (damaged, "run.json: --certificates: is damaged"),
        (open_to_all, "router.json: --certificates: does not say what each"),
        (not_enabled, "router.json: --certificates: does not say what each"),
        (no_rules, "router.json: --certificates: does not say what each"),
        (other_rules, "lets processes do other things, in router.json, than they do in this run"),
        (another_authority, "launcher.pem: --certificates: is not from the authority in authority.pem"),
        (anothers, "launcher.pem: --certificates: is the certificate of n001"),
        (anothers_key, "launcher.pem: --certificates: is not for the key in launcher.key"),
        (unreadable, "launcher.key: --certificates: cannot be read (Is a directory)"),
        (no_certificate, "launcher.pem: --certificates: is damaged"),
    ],
)
def test_a_folder_that_will_not_do_is_refused(
    wrong: Callable[[Path, Plan], None], what: str, folder: Path, plan: Plan
) -> None:
    wrong(folder, plan)
    with pytest.raises(ScenarioError) as error:
        kept_in(folder, plan)
    assert what in str(error.value)
    assert "; expected " in str(error.value)


def test_a_certificate_that_expired_is_refused(folder: Path, plan: Plan) -> None:
    authority = Authority(plan.run.run, 60.0)
    late = authority.issue("launcher", datetime.now(UTC) - timedelta(seconds=1))
    (folder / "authority.pem").write_text(authority.certificate)
    (folder / "launcher.pem").write_text(late.certificate)
    (folder / "launcher.key").write_text(late.key)
    with pytest.raises(ScenarioError, match=r"launcher.pem: --certificates: is not valid now, at .* it expires at "):
        kept_in(folder, plan)


def test_a_run_that_takes_longer_than_its_certificates_is_refused(folder: Path, plan: Plan) -> None:
    slow = replace(plan, run=replace(plan.run, speed=0.00001))
    with pytest.raises(ScenarioError, match="before this run could end"):
        kept_in(folder, slow)
