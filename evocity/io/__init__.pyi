"""What the room names, for checkers of types; `__init__.py` loads each when first used."""

from .bundled import attribution_of as attribution_of
from .bundled import cities as cities
from .condensing import read_condensation as read_condensation
from .condensing import read_mask as read_mask
from .lines import PlacedLines as PlacedLines
from .lines import condensation_along as condensation_along
from .lines import line_on as line_on
from .lines import read_lines as read_lines
from .lines import write_lines as write_lines
from .reading import (
    READERS as READERS,
)
from .reading import (
    name_of as name_of,
)
from .reading import (
    plugin_warnings as plugin_warnings,
)
from .reading import (
    read_map as read_map,
)
from .reading import (
    readers as readers,
)
from .reading import (
    suffixes as suffixes,
)
from .sources import Footprints as Footprints
from .sources import Grid as Grid
from .sources import Reader as Reader
from .sources import Request as Request
from .writing import (
    FIELD_WRITERS as FIELD_WRITERS,
)
from .writing import (
    LEAVES_WRITERS as LEAVES_WRITERS,
)
from .writing import (
    RAW_WRITERS as RAW_WRITERS,
)
from .writing import (
    SHARES_WRITERS as SHARES_WRITERS,
)
from .writing import (
    WINDOW_WRITERS as WINDOW_WRITERS,
)
from .writing import (
    WRITERS as WRITERS,
)
from .writing import (
    write_field as write_field,
)
from .writing import (
    write_leaves as write_leaves,
)
from .writing import (
    write_map as write_map,
)
from .writing import (
    write_shares as write_shares,
)
from .writing import (
    write_windows as write_windows,
)
