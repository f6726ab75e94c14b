"""`python -m acquisition` is `gonio`."""

from acquisition.cli import main

main()
