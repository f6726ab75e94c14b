"""Smooth dielectrics of Wolff, Nayar and Oren (1998): scattering below a Fresnel interface.

Open `wolff` first; `internal_return` holds the light scattered inside, with its H-function in
`chandrasekhar`; `interface` the rays through the surface, with the formulas in `fresnel`; and
`wolff_oren_nayar` the combination with a rough surface.
"""
