"""Figures of Wolff, Nayar and Oren 1998: smooth and rough surfaces compared."""

from analysis.gallery.figure import Paper
from analysis.gallery.paper_1998 import combined, cylinders, plane, roughness, spheres

PAPER = Paper(
    key="1998",
    citation=("Wolff, Nayar and Oren 1998: Improved Diffuse Reflection Models for Computer Vision"),
    figures=(
        plane.figure_1,
        plane.figure_3,
        plane.figure_4,
        plane.figure_5,
        cylinders.figure_6,
        cylinders.figure_7,
        cylinders.figure_8,
        cylinders.figure_9,
        cylinders.figure_10,
        spheres.figure_11,
        spheres.figure_12,
        spheres.figure_13,
        spheres.figure_14,
        spheres.figure_15,
        roughness.figure_16,
        combined.section_4,
    ),
    left_out=(
        "Figure 2, a sketch that defines symbols; of the others photographs and measured points."
    ),
)
