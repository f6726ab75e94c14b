"""Smooth dielectrics of Wolff, Nayar and Oren (1998): scattering below a Fresnel interface.

Open `wolff` first; `chandrasekhar` holds its H-function, `fresnel` its interface, and
`wolff_oren_nayar` the combination with a rough surface.
"""
