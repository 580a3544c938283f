"""``python -m fusion``: one fusion centre, or with ``base`` the base of masters, that joins a run through a router."""

from __future__ import annotations

from trackfield.drivers.standalone import main

main("fusion", {"fusion": "fusion.role:Fusion", "base": "fusion.base:Base"}, __doc__, installed=True)
