"""``python -m fusion``: one fusion centre, or with ``base`` or ``sink`` a base, that joins a run through a router."""

from __future__ import annotations

from trackfield.drivers.standalone import main

ROLES = {"fusion": "fusion.role:Fusion", "base": "fusion.base:Base", "sink": "fusion.sink:Sink"}

main("fusion", ROLES, __doc__, installed=True)
