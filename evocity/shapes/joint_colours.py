"""Shapes in the product of forms and colours: maps that mix both.

A map of such a shape moves a point of form and colour together: the colour may depend on the place,
and the place on the colour (Tosan, Excoffier, Rondet-Mignotte 2005, §4.1, after Nikiel 1998). The
colours of `Shape` are the separable case, §4.2.
"""

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from evocity.shapes._kernels import DEEPEST
from evocity.shapes.checks import MOST_MAPS, array_like, corners
from evocity.shapes.contraction import check_contraction, contraction_of
from evocity.shapes.languages import Language, ShapeError
from evocity.shapes.linear import compose_maps
from evocity.shapes.rendering import Frame, inked
from evocity.shapes.shape import MOST_PIECES, Shape, walk

#: Coordinates of a form in the plane, and of red, green and blue.
_FORM, _COLOUR = 2, 3
#: The largest spread of colours within a piece.
_FINE_COLOUR = 4 / 255
_SLACK = 1e-9
#: The most letters of the products that bound a box.
_LETTERS = 24


def joint_picture(maps: ArrayLike, side: int = 512, most: int = MOST_PIECES) -> Image.Image:
    """Draw the attractor of affine maps of the plane times the colours in ``side`` × ``side`` px.

    maps : ``(N, 5, 6)``: the first two rows give the place, the other three red, green and blue.
        The columns are the factors of x, y, red, green and blue, and a constant. The colours of the
        attractor must lie in 0…1.

    The picture has pieces as fine as pixels, whose colours differ by less than 4/255. Later words
    cover earlier words, as in `picture_of`. Raises `ShapeError` for maps that do not contract,
    colours outside 0…1, or more pieces than ``most``.
    """
    given = _joint_maps(maps)
    box = joint_box(given)
    _check_colours(box)
    frame = Frame.of(box[:, :_FORM], side)
    fine = (1 + _SLACK) / frame.scale
    # in these units, a piece is small if its place and its colour are
    units = np.concatenate([np.ones(_FORM), np.full(_COLOUR, fine / _FINE_COLOUR)])
    scaled = given * units[:, None] / np.append(units, 1.0)
    ends = corners(box) * units
    automaton = Shape(np.repeat([[[0.5, 0, 0], [0, 0.5, 0]]], len(given), 0))._endless_automaton
    base = np.zeros((len(given), 0))
    products, _, _ = walk(scaled, automaton, ends, DEEPEST, fine, base, 0.5, most)
    middle = box.mean(axis=0) * units
    at = np.einsum("kij,j->ki", products[:, :, :-1], middle) + products[:, :, -1]
    return inked(frame, at[:, :_FORM], np.clip(at[:, _FORM:] / units[_FORM:], 0, 1))


def joint_box(maps: np.ndarray) -> np.ndarray:
    """Bound place and colour of the attractor of joint ``maps`` ``(N, m, m + 1)``, ``(2, m)``.

    Products of growing length move a box that holds the attractor; the box of their images is
    nearer to it with each letter.
    """
    size = maps.shape[1]
    products, letters = maps, 1
    while letters < _LETTERS and len(products) * len(maps) <= 20_000:
        letters += 1
        products = compose_maps(products[:, None], maps[None]).reshape(-1, size, size + 1)
    parts, at = products[:, :, :size], products[:, :, size]
    low, high = at.min(axis=0), at.max(axis=0)
    for _ in range(200):
        middle, half = (low + high) / 2, (high - low) / 2
        centres = parts @ middle + at
        halves = np.abs(parts) @ half
        least, most = (centres - halves).min(axis=0), (centres + halves).max(axis=0)
        done = np.abs(np.concatenate([least - low, most - high])).max() <= 1e-12 * (1 + half.max())
        low, high = least, most
        if done:
            break
    return np.stack([low, high])


def _joint_maps(maps: ArrayLike) -> np.ndarray:
    size = _FORM + _COLOUR
    given = array_like(
        maps,
        "maps",
        f"(N, {size}, {size + 1})",
        lambda s: len(s) == 3 and s[1:] == (size, size + 1) and 0 < s[0] <= MOST_MAPS,
    )
    check_contraction(contraction_of(given, Language.every(len(given))))
    return given


def _check_colours(box: np.ndarray) -> None:
    low, high = box[0, _FORM:].min(), box[1, _FORM:].max()
    if low < -_SLACK or high > 1 + _SLACK:
        raise ShapeError(
            f"the colours of the attractor lie between {low:.3g} and {high:.3g}",
            "colours from 0 to 1",
            "scale or shift the rows of red, green and blue",
        )
