"""Authorities of users' own, as openssl would leave them in a folder."""

from __future__ import annotations

from pathlib import Path

import trustme


def root_in(folder: Path) -> trustme.CA:
    """An authority in this folder."""
    root = trustme.CA(organization_name="A company")
    return write(folder, root.cert_pem.bytes(), root.private_key_pem.bytes(), root)


def write(folder: Path, certificate: bytes, key: bytes, made: trustme.CA) -> trustme.CA:
    folder.mkdir(exist_ok=True)
    (folder / "authority.pem").write_bytes(certificate)
    (folder / "authority.key").write_bytes(key)
    return made
