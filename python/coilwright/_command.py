"""The command ``coilwright``, as the wheel installs it."""

from __future__ import annotations

import sys

from . import _coilwright


def main() -> int:
    """Runs the command line that the process was given; its exit code."""
    import signal

    # The command listens for Ctrl-C itself, so that long work ends in good order.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _coilwright.command(["coilwright", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
