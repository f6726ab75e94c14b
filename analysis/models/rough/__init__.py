"""Rough diffuse surfaces of Oren and Nayar: printed forms, exact integral, and the error between.

Open `oren_nayar_forms` first for the printed equations (33), (34) and (36), or `oren_nayar_exact`
for the integral (31), with `single_slope` for (29) below it, on `azimuth_arcs`, and `v_cavity` for
one facet as printed. `oren_nayar` holds the models of the printed forms, with their validity by
`form_bounds`, which stands on `form_error` and its `form_error_table`.
"""
