"""What the room names, for checkers of types; `__init__.py` loads each when first used."""

from .changes import CHANGE_KINDS as CHANGE_KINDS
from .changes import apply_changes as apply_changes
from .changes import draw_change as draw_change
from .changes import renumbering as renumbering
from .fill import fill_face as fill_face
from .fill import fill_halves as fill_halves
from .gene import SCALES as SCALES
from .gene import FaceGene as FaceGene
from .inheritance import InheritedPlan as InheritedPlan
from .inheritance import find_plan as find_plan
from .inheritance import plan_key as plan_key
from .laying import lay as lay
from .plan import PLAN_VERSION as PLAN_VERSION
from .plan import Plan as Plan
from .plan import plan_of as plan_of
from .storeys import storey_range as storey_range
