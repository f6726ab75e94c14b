"""Maps of where methods fail, for `gonio bench --maps`.

Open `all_maps` first, which draws all of them; `map_style` is their common look.
"""
