"""`gonio bench`: what accuracy costs, measured on the machine it runs on.

What to use when: `trial` and `study` for what is measured, `studies` for all of it, `page` and
`files` for what is left behind. Every study sets cost against the error to an independent truth.
"""
