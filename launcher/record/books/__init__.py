"""Parts of the ledger: payloads in words, and the balance of what it found with what processes counted."""
