"""Figures of Nayar, Ikeuchi and Kanade 1991: physical and geometrical optics of reflection."""

from analysis.gallery.figure import Paper
from analysis.gallery.paper_1991 import framework, geometrical_optics, physical_optics

PAPER = Paper(
    key="1991",
    citation=(
        "Nayar, Ikeuchi and Kanade 1991: Surface Reflection: Physical and Geometrical Perspectives"
    ),
    figures=(
        physical_optics.figure_9,
        physical_optics.figure_10,
        geometrical_optics.figure_11,
        geometrical_optics.figure_12,
        geometrical_optics.figure_13,
        geometrical_optics.figure_14,
        framework.figure_15,
        framework.figure_16,
        framework.figure_17,
    ),
    left_out="Figures 1–8 and 18–21, sketches that define symbols.",
)
