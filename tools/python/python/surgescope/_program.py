"""The program `surgescope`, as the console script calls it."""

from __future__ import annotations

import signal
import sys

from surgescope._native import run_program


def main() -> int:
    """Run the program with this process's arguments; the result is its exit code."""
    # As in the program itself, Ctrl-C ends what does not heed it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return run_program(sys.argv)
