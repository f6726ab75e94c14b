"""Maps of where methods fail, for `gonio bench --maps`.

Open `all_maps` first, which draws all of them; `map_style` is their common look. The makers
`make_error_maps` and `make_form_error_table` compute the tables stored with the models.
"""
