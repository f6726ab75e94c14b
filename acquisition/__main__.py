"""Run the command line: `python -m acquisition` is `gonio`."""

from acquisition.entry import main

if __name__ == "__main__":
    main()
