"""Pictures side by side, as the page asks for them: many in one file."""

import io
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from PIL import Image

#: Pictures that one request may name, and the sides that it may ask for, px.
MOST, SIDES = 96, (96, 192)
# In a row.
_ACROSS = 8


@dataclass(frozen=True)
class Sheet:
    """Pictures of the births ``ids``, in their order, each ``width`` × ``height`` px, ``across`` in
    a row of the ``image``, a PNG. ``lacking``: id -> why it has none."""

    ids: list[int]
    image: bytes
    across: int
    width: int
    height: int
    lacking: dict[int, str]

    @classmethod
    def of(
        cls, pictures: Mapping[int, np.ndarray], lacking: Mapping[int, str], packed: int = 1
    ) -> "Sheet":
        """Of ``pictures`` (height, width, 3), all of one size, by id. ``packed``: how well, 0 for
        not at all, where room costs nothing."""
        ids = list(pictures)
        if not ids:
            return cls([], b"", 1, 0, 0, dict(lacking))
        height, width, _ = pictures[ids[0]].shape
        across = min(_ACROSS, len(ids))
        whole = np.zeros((-(-len(ids) // across) * height, across * width, 3), np.uint8)
        for place, one in enumerate(ids):
            top, left = place // across * height, place % across * width
            whole[top : top + height, left : left + width] = pictures[one]
        kept = io.BytesIO()
        Image.fromarray(whole).save(kept, "PNG", compress_level=packed)
        return cls(ids, kept.getvalue(), across, width, height, dict(lacking))

    @property
    def about(self) -> dict:
        """All but the image, plain values."""
        return {
            "tiles": self.ids,
            "across": self.across,
            "width": self.width,
            "height": self.height,
            "lacking": [[one, why] for one, why in self.lacking.items()],
        }


__all__ = ["MOST", "SIDES", "Sheet"]
