"""What writes a run down: the ledger of frames, the recorder, tables of tracks and messages, figures."""
