"""Output of a benchmark: JSON, CSV tables, charts and the HTML page.

Open `files` first, which writes all of it. `page` is the page, `charts` draws cost against error,
`labels` places the texts beside the marks.
"""
