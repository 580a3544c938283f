"""``python -m head``: one master, or with ``peer`` or ``ear`` one node that may lead, that joins a run by a router."""

from __future__ import annotations

from trackfield.drivers.standalone import main

PEER = {"member": "node.member:Member", "header": "head.header:Header"}
EAR = {"ear": "node.ear:Ear", "hearing": "head.hearing.role:Hearing"}

main("head", {"master": "head.master:Master", "peer": PEER, "ear": EAR}, __doc__, installed=True)
