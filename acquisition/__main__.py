"""Run the command line: `python -m acquisition` is `gonio`."""

from acquisition.cli import main

if __name__ == "__main__":
    main()
