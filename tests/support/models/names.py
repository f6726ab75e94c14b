"""Names of models and sums that every test of all models goes through."""

from __future__ import annotations

from analysis.models import MODELS

SUMS = [
    "oren_nayar+torrance_sparrow",
    "oren_nayar_exact+torrance_sparrow_lobe",
    "minnaert+beckmann_spizzichino",
    "wolff_oren_nayar+ggx",
    "wolff+eon+unified",
]
NAMES = [*MODELS, *SUMS]
