"""The four papers, in the order of their years."""

from analysis.gallery.paper_1991 import PAPER as PAPER_1991
from analysis.gallery.paper_1994 import PAPER as PAPER_1994
from analysis.gallery.paper_1995 import PAPER as PAPER_1995
from analysis.gallery.paper_1998 import PAPER as PAPER_1998

PAPERS = (PAPER_1991, PAPER_1994, PAPER_1995, PAPER_1998)
