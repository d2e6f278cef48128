"""How it is measured: contenders, recorded states, replays, interleaved timing, verification and
statistics.
"""
