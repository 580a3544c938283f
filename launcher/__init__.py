"""System control: command line, processes, recorder, ledger, reports."""

from typing import Final

INTERRUPTED: Final = 130
"""Exit code of the program when Ctrl-C ends it: 128 + SIGINT."""
