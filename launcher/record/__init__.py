"""Recording a run: the ledger of frames, the recorder, tables of tracks and messages, figures."""
