"""What the functions of the package take, for type checkers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from surgescope._native import Progress

Path: TypeAlias = Union[str, "PathLike[str]"]
Numbers: TypeAlias = NDArray[np.float64]
Effects: TypeAlias = Union[str, Sequence[str]]
Values: TypeAlias = dict[str, float]
Bounds: TypeAlias = dict[str, Union[float, tuple[float, float]]]
Valve: TypeAlias = Literal["linear", "flow-ramp", "flow-cycloid"]
Method: TypeAlias = Literal["least-squares", "global", "micro-ga", "global-local", "stepwise"]
Watcher: TypeAlias = Union[Callable[["Progress"], object], bool, None]


class Frame(Protocol):
    """A DataFrame: its columns by name."""

    @property
    def columns(self) -> Iterable[str]: ...
    def __getitem__(self, name: str, /) -> Any: ...


Columns: TypeAlias = Union[Mapping[str, ArrayLike], Frame]
