"""Pictures of a material on simple shapes, and the cost of a wrong model of it in seeing.

Open `render` first. Axes of every picture: x to the right, y up, z to the viewer, who is far away
(orthographic). Images are `image[row, column]`, row 0 at the top. Lengths are in radii of the
sphere.
"""
