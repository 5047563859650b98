"""What the room names, for checkers of types; `__init__.py` loads each when first used."""

from .fill import fill_face as fill_face
from .gene import SCALES as SCALES
from .gene import FaceGene as FaceGene
from .laying import lay as lay
from .plan import PLAN_VERSION as PLAN_VERSION
from .plan import Plan as Plan
from .plan import plan_of as plan_of
