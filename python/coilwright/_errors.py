"""One hierarchy of exceptions; their words are the command line's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Fault:
    """One fault of a file: what was expected, what was found, what to do; and where."""

    message: str
    line: int | None
    """Counted from 1; None for a fault of the file as a whole."""
    note: str | None
    """What to do about it, where that takes a sentence of its own."""


class CoilwrightError(Exception):
    """Whatever this package raises."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (_restored, (type(self), self.args, self.__dict__))


class FileError(CoilwrightError, ValueError):
    """A file has faults: all of them, with their source lines drawn.

    Attributes:
        file: its name.
        faults: every :class:`Fault`, in the file's order.
    """

    file: str | None
    faults: tuple[Fault, ...]


class RequestError(CoilwrightError, ValueError):
    """What was asked for makes no sense: an unknown name, a number out of its range, a pattern of another coil."""


class ModelError(CoilwrightError, ValueError):
    """The model or the record cannot be worked with: no profile, a fit that says nothing, an effect that forbids a bound."""


class WriteError(CoilwrightError, OSError):
    """A file or folder cannot be written."""


def _restored(kind: type[CoilwrightError], args: tuple[Any, ...], state: dict[str, Any]) -> CoilwrightError:
    error = kind(*args)
    error.__dict__.update(state)
    return error


_KINDS: dict[str, type[CoilwrightError]] = {
    "file": FileError,
    "request": RequestError,
    "model": ModelError,
    "write": WriteError,
}


def made(
    kind: str, message: str, file: str | None, faults: list[tuple[str, int | None, str | None]]
) -> CoilwrightError:
    """The exception that the extension module raises."""
    error = _KINDS[kind](message)
    if isinstance(error, FileError):
        error.file = file
        error.faults = tuple(Fault(*fault) for fault in faults)
    return error
