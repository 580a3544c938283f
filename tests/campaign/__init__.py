"""A campaign of faults, drawn from seeds: fields and protocols under everything at once.

``cases`` makes a plan of a seed, ``fields`` and ``talkers`` draw what is in it; ``verdicts`` says what must hold all
the same, and ``census`` what a campaign should have provoked.

``python -m tests.campaign`` is the campaign.
"""
