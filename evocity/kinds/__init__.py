"""Kinds of chromosome: the interface between genomes and the log, workers and loop of a search.

The search itself only uses a genome's ``digest`` and ``made``. Its kind does the rest: columns of
the births, adoption by a run, operators and measures, the expressed map. `fabric` is a city as an
iterated function system, `shape` a few maps of the plane, `curve` a few control points, `site` a
fabric with courses through it. docs/kinds.md describes them.
"""

from collections.abc import Mapping

from evocity.kinds.curve_form import CurveForm
from evocity.kinds.fabric import Fabric
from evocity.kinds.form import Form
from evocity.kinds.form_files import read_form
from evocity.kinds.kind import Expressed, Kind, Window
from evocity.kinds.shape_and_curve import Curves, Shapes
from evocity.kinds.shape_form import ShapeForm
from evocity.kinds.site import Sites
from evocity.kinds.site_form import Site

#: All kinds of chromosome, by the name in a run's header.
KINDS: Mapping[str, Kind] = {kind.name: kind for kind in (Fabric(), Shapes(), Curves(), Sites())}

__all__ = [
    "KINDS",
    "CurveForm",
    "Curves",
    "Expressed",
    "Fabric",
    "Form",
    "Kind",
    "ShapeForm",
    "Shapes",
    "Site",
    "Sites",
    "Window",
    "read_form",
]
