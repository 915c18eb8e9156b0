"""The command line."""

from ringsweep.cli.entry import main

__all__ = ["main"]
