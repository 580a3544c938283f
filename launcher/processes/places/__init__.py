"""The places of a run whose processes start elsewhere: who is offered one, and who has it."""
