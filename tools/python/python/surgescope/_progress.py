"""The bar that shows how far a computation has come."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from surgescope._native import Error, Progress
from surgescope._types import Watcher


class Bar:
    """A bar of tqdm; what it shows is the line of the progress."""

    def __init__(self, tqdm: Any, total: int | None) -> None:
        counted = {} if total else {"bar_format": "{desc} {elapsed}"}
        self._bar = tqdm(total=total, leave=False, **counted)

    def __call__(self, progress: Progress) -> None:
        if progress.done is not None:
            self._bar.update(progress.done - self._bar.n)
        else:
            self._bar.set_description_str(str(progress))

    def close(self) -> None:
        self._bar.close()


def _in_notebook() -> bool:
    """Whether a Jupyter or marimo notebook runs this."""
    marimo = sys.modules.get("marimo")
    if marimo is not None and marimo.running_in_notebook():
        return True
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return shell is not None and type(shell).__name__ == "ZMQInteractiveShell"


def watcher(asked: Watcher, total: int | None) -> Callable[[Progress], object] | None:
    """What hears the progress: `asked` is a callable, True for a bar, False for none, or None for a bar in a notebook."""
    if asked is None or isinstance(asked, bool):
        if asked is False or (asked is None and not _in_notebook()):
            return None
        try:
            from tqdm.auto import tqdm
        except ModuleNotFoundError:
            if asked is None:
                return None
            raise Error("progress=True needs tqdm, which is not installed: pip install tqdm") from None
        return Bar(tqdm, total)
    if not callable(asked):
        raise Error(f"progress = {asked!r} is neither a callable nor True nor False")
    return asked
