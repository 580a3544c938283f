"""System control: command line, processes, recorder, ledger, reports."""
