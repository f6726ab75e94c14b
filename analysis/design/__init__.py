"""Choice of the geometries that determine a model's parameters best.

Open `information.py` first; `optimal.py` chooses from a list, `bound.py` says how good any choice
can be, and `rivals.py` holds the models that a design must tell apart.
"""
