"""The command ``coilwright``, as the wheel installs it."""

from __future__ import annotations

import os
import shutil
import sys
import sysconfig

from . import _coilwright


def program() -> str:
    """Where the command is, for workflows that call it: beside this interpreter, else on the path."""
    places = [sysconfig.get_path("scripts"), os.path.dirname(sys.executable), None]
    found = (shutil.which("coilwright", path=place) for place in places)
    return os.path.abspath(next((place for place in found if place), "coilwright"))


def main() -> int:
    """Runs the command line that the process was given; its exit code."""
    import signal

    # The command listens for Ctrl-C itself, so that long work ends in good order.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _coilwright.command([program(), *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
