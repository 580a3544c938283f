"""``python -m fusion``: one fusion centre that joins a run through a router."""

from __future__ import annotations

from trackfield.drivers.standalone import main

main("fusion", {"fusion": "fusion.role:Fusion"}, __doc__, installed=True)
