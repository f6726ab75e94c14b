"""Many sources at once: what a folder holds, and work on it by processes or a Dask cluster.

Open `processes.py` first: it hands out the sources one at a time; `cluster.py` has Dask do it.
"""
