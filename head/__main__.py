"""``python -m head``: one master, or with ``base`` the base, that joins a run through a router."""

from __future__ import annotations

from trackfield.drivers.standalone import main

main("head", {"master": "head.master:Master", "base": "head.base:Base"}, __doc__, installed=True)
