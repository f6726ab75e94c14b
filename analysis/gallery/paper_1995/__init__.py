"""Figures of Oren and Nayar 1995: from V-cavities to pictures of rough surfaces."""

from analysis.gallery.figure import Paper
from analysis.gallery.paper_1995 import cavities, gaussian_slopes, samples, stereo, vase, vision

PAPER = Paper(
    key="1995",
    citation=(
        "Oren and Nayar 1995: Generalization of the Lambertian Model and Implications for Machine "
        "Vision"
    ),
    figures=(
        cavities.figure_5,
        cavities.figure_6,
        cavities.figure_7,
        cavities.figure_8,
        cavities.figure_9,
        gaussian_slopes.figure_10,
        gaussian_slopes.figure_11,
        gaussian_slopes.figure_12,
        gaussian_slopes.figure_13,
        gaussian_slopes.figure_14,
        samples.figure_16,
        samples.figure_17,
        samples.figure_18,
        samples.figure_19,
        samples.figure_20,
        samples.figure_21,
        samples.figure_22,
        vase.figure_24,
        vision.figure_25,
        stereo.figure_26,
        stereo.figure_27,
    ),
    left_out=(
        "Figures 1 and 23 (photographs), 2 and 4 (sketches that define symbols), 3 (spheres, which "
        "are Figure 14 of 1994), 15 (the rig); of the others the measured points."
    ),
)
