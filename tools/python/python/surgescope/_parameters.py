"""Fitted parameters by name."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from surgescope._native import Error, Parameter

Key = str | tuple[str, str]


class UnknownParameter(Error, KeyError):
    """A name that no parameter of a fit has."""

    def __str__(self) -> str:
        return str(self.args[0])


class Parameters(Mapping[Key, Parameter]):
    """Parameters by name; one that each of several runs has of its own by its name and its file: `parameters["closing_time_s", "a.mcap"]`."""

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        times = Counter(p.name for p in parameters)
        self._all: dict[Key, Parameter] = {}
        for p in parameters:
            self._all[p.name if p.run is None or times[p.name] == 1 else (p.name, p.run)] = p

    def __getitem__(self, key: Key) -> Parameter:
        found = self._all.get(key)
        if found is not None:
            return found
        if isinstance(key, tuple) and len(key) == 2:
            alone = self._all.get(key[0])
            if alone is not None and alone.run == key[1]:
                return alone
        runs = [known[1] for known in self._all if isinstance(known, tuple) and known[0] == key]
        if runs:
            raise UnknownParameter(f"each run has its own {key}: name the run as well, one of {', '.join(runs)}")
        known = dict.fromkeys(known if isinstance(known, str) else known[0] for known in self._all)
        raise UnknownParameter(f"the fit has no parameter '{key}'; it has {', '.join(sorted(known))}")

    def __iter__(self) -> Iterator[Key]:
        return iter(self._all)

    def __len__(self) -> int:
        return len(self._all)

    def __repr__(self) -> str:
        return "{" + ", ".join(f"{key!r}: {p!r}" for key, p in self._all.items()) + "}"
