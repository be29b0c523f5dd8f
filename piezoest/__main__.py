"""``python -m piezoest``: the command line."""

from piezoest.cli import main

if __name__ == "__main__":
    main()
