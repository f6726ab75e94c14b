"""Command `gonio plan --optimal`: open `optimal.py` first."""
