"""Tables of measured values as text, one row per geometry or per incidence."""
