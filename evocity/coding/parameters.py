"""Parameters of coding: the domain blocks that a search compares, and the cap on σ."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from numbers import Real

import numpy as np

from evocity.citymap import MAX_PIXELS, MAX_SIDE, CityMap
from evocity.errors import GenomeError, is_whole, none_setting, setting

#: The largest finite cap on \\|σ\\|.
_STEEPEST = 1e9


@dataclass(frozen=True)
class Coding:
    """The domain blocks that a search compares with a range block, and the cap on \\|σ\\|, as in
    `evocity.encode`."""

    reach: int | None = 24
    domains: Sequence[int] = (2,)
    sigma_max: float = 0.9

    def __post_init__(self):
        if isinstance(self.domains, Iterable):
            object.__setattr__(self, "domains", tuple(dict.fromkeys(self.domains)))

    def faults(self, city: CityMap, finest: int) -> list[tuple[str, str]]:
        """List what does not suit a search of ``city`` in range blocks of ``finest`` px and more:
        (what arrived, what was expected) each."""
        faults = []
        domains, reach, steepest = self.domains, self.reach, self.sigma_max
        if (
            not isinstance(domains, tuple)
            or not domains
            or not all(is_whole(m, 2) for m in domains)
        ):
            shown = list(domains) if isinstance(domains, tuple) else domains
            faults.append((setting("domains", shown), "whole multiples of B, 2 or more"))
        elif min(domains) * finest > min(city.shape):
            faults.append(
                (f"domains of {min(domains) * finest} px", f"at most {min(city.shape)} px")
            )
        if reach is not None and not is_whole(reach, 0):
            allowed = f"a whole number of pixels, or {none_setting('reach')} for the whole map"
            faults.append((setting("reach", reach), allowed))
        if not (isinstance(steepest, Real) and (0 < steepest <= _STEEPEST or steepest == np.inf)):
            allowed = f"a number above 0, at most {_STEEPEST:g}, or inf for no cap"
            faults.append((setting("sigma_max", steepest), allowed))
        return faults


def check_encoding(city: CityMap, finest: int, coding: Coding, topological, threads) -> None:
    """Raise one `GenomeError` that lists every parameter of `evocity.encode` out of range."""
    faults = coding.faults(city, finest)
    if topological is not None and not (isinstance(topological, Real) and 0 <= topological <= 1):
        faults.append((setting("topological", topological), "a share from 0 to 1"))
    if threads is not None and not is_whole(threads, 1):
        allowed = f"1 or more, or {none_setting('threads')} for all cores"
        faults.append((setting("threads", threads), allowed))
    if max(city.shape) > MAX_SIDE or city.heights.size > MAX_PIXELS:
        allowed = f"sides up to {MAX_SIDE} px, {MAX_PIXELS // 10**6} million pixels in all"
        faults.append((f"a map of {city.shape[0]} × {city.shape[1]} px", allowed))
    if faults:
        found, expected = ("; ".join(part) for part in zip(*faults, strict=True))
        raise GenomeError(f"{city.name}: {found}", expected, "change the parameters of encode")
