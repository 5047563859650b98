"""Surfaces of roofs: vaults, domes, saddles and sheds, as polynomials or as rows of them."""

import numpy as np

from evocity.errors import is_whole, setting, spell
from evocity.shapes.curve_fit import polynomial_maps
from evocity.shapes.languages import ShapeError
from evocity.shapes.surface_detail import DetailedSurface

#: Names of forms.
FORMS = ("vault", "dome", "saddle", "shed")
#: The most bays side by side.
MOST_BAYS = 8

# Cubic maps, so that a form and the details of another ground have the same maps; 49 heights.
_POINTS, _DEPTH = 4, 4
# Share of a shed's bay that its slope takes; the rest is the steep glass.
_SLOPE = 0.75


def surface_form(name: str, bays: int | None = None) -> DetailedSurface:
    """Make a surface of 49 × 49 heights, 0 to 1 m, in the form of a roof.

    name : one of `FORMS`. With s from the west and t from the north, 0 to 1, the heights are:
        "vault": 4 t (1 − t), a barrel vault; "dome": 16 s (1 − s) t (1 − t), 0 at all eaves;
        "saddle": (1 + (2 s − 1)² − (2 t − 1)²) / 2, high at both ends; "shed": up from 0 in
        the first quarter of each bay, the glass, and down to 0 to the south.
    bays : number of vaults or sheds side by side from north to south, 1 to 8; None means 1 vault
        and 4 sheds. Domes and saddles have one bay.

    A form of one bay is a polynomial, and the surface equals it to 1e-9. Raises `ShapeError` for an
    unknown ``name`` and for other ``bays``.
    """
    if name not in FORMS:
        raise ShapeError(
            f"the form {spell(name)} is unknown", f"one of {', '.join(FORMS)}", "choose one of them"
        )
    most = MOST_BAYS if name in ("vault", "shed") else 1
    if bays is None:
        bays = 4 if name == "shed" else 1
    if not is_whole(bays, 1) or bays > most:
        raise ShapeError(
            f"{setting('bays', bays)} for a {name}",
            f"a whole number, 1 to {most}" if most > 1 else "one bay",
            "choose another number, or leave it out",
        )
    maps = polynomial_maps(_POINTS, 2)
    is_polynomial = name != "shed" and bays == 1
    kept = 0 if is_polynomial else _DEPTH
    at = np.linspace(0, 1, (_POINTS - 1) * 2**kept + 1)
    s, t = at[None, :], at[:, None]
    if name == "dome":
        heights = 16 * s * (1 - s) * t * (1 - t)
    elif name == "saddle":
        heights = (1 + (2 * s - 1) ** 2 - (2 * t - 1) ** 2) / 2
    else:
        own = (bays * t) % 1.0
        if name == "vault":
            own = 4 * own * (1 - own)
        else:
            own = np.where(own < 1 - _SLOPE, own / (1 - _SLOPE), (1 - own) / _SLOPE)
            own = np.minimum(own, 1.0)
        heights = own
    whole = np.round(np.broadcast_to(heights, (len(at), len(at))), 12)
    return DetailedSurface.drawn(whole, maps, maps, kept, _DEPTH)
