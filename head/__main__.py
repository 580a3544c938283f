"""``python -m head``: one master, or with ``peer`` one node that may lead, that joins a run through a router."""

from __future__ import annotations

from trackfield.drivers.standalone import main

PEER = {"member": "node.member:Member", "header": "head.header:Header"}

main("head", {"master": "head.master:Master", "peer": PEER}, __doc__, installed=True)
