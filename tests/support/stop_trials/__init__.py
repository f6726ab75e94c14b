"""Trials of a stop: the real command, emulated devices that outlive it, one fault, one verdict.

`python -m tests.support.stop_trials --seeds 0:1000 --at-once 12` runs them and prints the tree of
faults. Start with `trial`, which draws one, and `run_trial`, which carries it out.
"""
