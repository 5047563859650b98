from .curve import CurveForm as CurveForm
from .files import read_form as read_form
from .form import Form as Form
from .shape import ShapeForm as ShapeForm
from .site import Site as Site
