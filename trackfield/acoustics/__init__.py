"""Sound as waveforms: what sources emit, what a microphone hears of them, and how a pass is found in it.

Works on arrays: of what sensor processes load, only those that listen load it.
"""
