"""Commands on all sources of a folder; open `each_source.py` first."""
