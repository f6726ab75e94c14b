"""Gallery of the four papers: each figure that needs no photograph, drawn by the project's models.

Open `figure` first: it defines a figure, its panels and its checks. `papers` lists all figures,
`page` makes one page of them; the rooms `paper_*` and `paper_1994` hold the figures themselves.
"""
