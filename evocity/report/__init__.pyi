"""Public names of the room, for type checkers; `__init__.py` loads each on first use."""

from evocity.analysis.failed_births import differing as differing
from evocity.analysis.failed_births import differing_told as differing_told
from evocity.analysis.failed_births import failures as failures
from evocity.analysis.failed_births import repeated as repeated
from evocity.analysis.failed_births import unrecorded as unrecorded

from .grid import grid_picture as grid_picture
from .grid import run_picture as run_picture
from .html import write_report as write_report
from .sheet import contact_sheet as contact_sheet
