"""How far long work is: a callback of the caller's, a bar of tqdm where that is installed, or nothing."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[float, str], object]
"""Called with the share that is done, from 0 to 1, and where the work stands, in words."""


@contextmanager
def shown(progress: bool | Progress | None, task: str) -> Iterator[Progress | None]:
    """What the extension module calls: None shows nothing, True a bar."""
    if progress is None or progress is False:
        yield None
        return
    if callable(progress):
        yield progress
        return
    try:
        from tqdm.auto import tqdm
    except ImportError:
        yield _line(task)
        sys.stderr.write("\n")
        return
    with tqdm(total=100, desc=task, unit="%", bar_format="{desc} {bar} {n:3.0f} % {elapsed} {postfix}") as bar:

        def at(share: float, words: str) -> None:
            bar.n = max(bar.n, 100.0 * share)
            bar.set_postfix_str(words, refresh=False)
            bar.refresh()

        yield at
        bar.n = 100.0
        bar.refresh()


def _line(task: str) -> Progress:
    def at(share: float, words: str) -> None:
        sys.stderr.write(f"\r{task} {100 * share:3.0f} % {words}\x1b[K")
        sys.stderr.flush()

    return at
