"""Scans that choose their geometries while they run, until the u asked for are reached.

Open `course.py` first: it is the choice that the engine asks for each batch, and it writes every
one into the record. `chooser.py` decides from readings alone, `layout.py` puts references and
points in order, and `candidate_list.py` makes the protocol whose steps are the candidates.
"""
