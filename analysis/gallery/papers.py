"""The four papers, in the order of their years."""

from analysis.gallery.paper_1991 import PAPER as PAPER_1991
from analysis.gallery.paper_1995 import PAPER as PAPER_1995

PAPERS = (PAPER_1991, PAPER_1995)
