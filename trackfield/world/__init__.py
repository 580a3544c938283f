"""The simulated world: the targets' paths, when each sensor may sense them, and what it then reads.

Nodes import ``path``, ``scene``, ``placed`` and ``faulty``, which need the standard library only; ``targets``,
``tracks`` and ``windows`` work on arrays and belong to the launcher's side.
"""
