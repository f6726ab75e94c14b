"""Vocabulary of the instrument: angles, devices, errors, time, configuration and run record.

It imports none of the other packages, and all of them import it. Open `geometry` first: it states
the convention of angles that everything else follows.
"""
