"""Specular lobes and spikes: geometrical optics, physical optics (1991), and computer graphics.

Open `torrance_sparrow` first; `beckmann_spizzichino` is the lobe by physical optics, with
`scattered_power` and `surface_statistics`; `unified` is the framework of 1991; `ggx` the lobe of
computer graphics.
"""
