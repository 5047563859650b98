"""The command line as `python -m evocity`."""

from evocity.cli import main

if __name__ == "__main__":
    main(prog_name="evocity")
