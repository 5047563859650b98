"""Shares of genomes in a grown fabric, from numbers and pictures on the command line."""

import contextlib
import warnings
from collections.abc import Sequence

from evocity.errors import EvocityError


def share_of(words: Sequence[str], count: int):
    """Return the value of --share: None, a number, or an array of shares."""
    if not words:
        return None
    needed = 1 if count == 2 else count
    if count == 1 or len(words) != needed:
        raise EvocityError(
            f"{len(words)} × --share for {count} genomes",
            "one for two genomes; one for each of three or more",
            "leave --share out" if count == 1 else f"give --share {needed} times",
        )
    shares = [_read_share(word) for word in words]
    if needed == 1:
        return shares[0]
    rasters = {share.shape for share in shares if not isinstance(share, float)}
    if len(rasters) > 1:
        sizes = " and ".join(f"{tall} × {wide}" for tall, wide in sorted(rasters))
        raise EvocityError(
            f"the pictures after --share have several sizes: {sizes} px",
            "pictures that all have the same size",
            "scale the pictures to the same size",
        )
    if not rasters:
        return shares
    import numpy as np

    return np.stack([np.broadcast_to(share, *rasters) for share in shares])


def _read_share(word: str):
    """Read a number, or a picture's shares: 0 where it is black, 1 where it is white."""
    with contextlib.suppress(ValueError):
        return float(word)
    import numpy as np
    from PIL import Image

    try:
        with warnings.catch_warnings(action="ignore"), Image.open(word) as image:
            if image.mode.startswith("I"):  # 16 bits a pixel
                return np.asarray(image, float) / 65535
            return np.asarray(image.convert("L"), float) / 255
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise EvocityError(
            f"--share {word}: {error}",
            "a number from 0 to 1, or a picture that is black for the first genome and white for "
            "the second genome",
            "check the name of the picture and its format",
        ) from error
