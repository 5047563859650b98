"""Pictures that fit into a display."""

from PIL import Image

from evocity.pages import data_uri

#: Longest side of a display's picture, px, and most characters of its address.
LARGEST = 560
_MOST = 110_000


def fitted(picture: Image.Image, largest: int = LARGEST, most: int = _MOST) -> tuple[str, int]:
    """A ``data:`` address of the picture with at most ``most`` characters, and its width in px: it
    is made smaller until it fits."""
    while True:
        small = picture.copy()
        small.thumbnail((largest, largest), Image.Resampling.BOX)
        uri = data_uri(small)
        if len(uri) <= most or largest < 32:
            return uri, small.width
        largest = largest * 3 // 4


__all__ = ["LARGEST", "fitted"]
