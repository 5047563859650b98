"""What the room names, for checkers of types; `__init__.py` loads each when first used."""

from .facts import Facts as Facts
from .failing import (
    differing as differing,
)
from .failing import (
    differing_told as differing_told,
)
from .failing import (
    failures as failures,
)
from .failing import (
    repeated as repeated,
)
from .failing import (
    unrecorded as unrecorded,
)
from .grid import grid_picture as grid_picture
from .grid import run_picture as run_picture
from .html import write_report as write_report
from .pictures import contact_sheet as contact_sheet
