"""`python -m topobelief` is `topobelief`."""

from topobelief.cli import main

if __name__ == "__main__":
    main()
