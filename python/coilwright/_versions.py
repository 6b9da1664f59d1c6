"""What is installed, for reports of defects."""

from __future__ import annotations

import importlib.metadata
import platform
import sys

from . import _coilwright

_OTHERS = ("numpy", "matplotlib", "pandas", "polars", "pyarrow", "tqdm", "xarray")


def versions() -> dict[str, str]:
    """Names and versions: this package, Python, the system, and what it works with where that is installed."""
    found = {
        "coilwright": _coilwright.__version__,
        "python": sys.version.split()[0] + ("" if getattr(sys, "_is_gil_enabled", lambda: True)() else " free-threaded"),
        "system": platform.platform(),
        "processors": str(_coilwright.threads),
    }
    for name in _OTHERS:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found


def show_versions() -> None:
    """Prints :func:`versions`, one a line."""
    for name, version in versions().items():
        print(f"{name:<12} {version}")
