"""What the room names, for checkers of types; `__init__.py` loads each when first used."""

from .bundled_cities import attribution_of as attribution_of
from .bundled_cities import cities as cities
from .condensation_masks import read_condensation as read_condensation
from .condensation_masks import read_mask as read_mask
from .density_files import read_wanted_density as read_wanted_density
from .lines import PlacedLines as PlacedLines
from .lines import condensation_along as condensation_along
from .lines import line_on as line_on
from .lines import read_lines as read_lines
from .lines import write_lines as write_lines
from .map_reader import (
    READERS as READERS,
)
from .map_reader import (
    name_of as name_of,
)
from .map_reader import (
    plugin_warnings as plugin_warnings,
)
from .map_reader import (
    read_map as read_map,
)
from .map_reader import (
    readers as readers,
)
from .map_reader import (
    suffixes as suffixes,
)
from .reader_types import Footprints as Footprints
from .reader_types import Grid as Grid
from .reader_types import Reader as Reader
from .reader_types import Request as Request
from .writers import (
    FACES_WRITERS as FACES_WRITERS,
)
from .writers import (
    FIELD_WRITERS as FIELD_WRITERS,
)
from .writers import (
    LEAVES_WRITERS as LEAVES_WRITERS,
)
from .writers import (
    RAW_WRITERS as RAW_WRITERS,
)
from .writers import (
    SHARES_WRITERS as SHARES_WRITERS,
)
from .writers import (
    WINDOW_WRITERS as WINDOW_WRITERS,
)
from .writers import (
    WRITERS as WRITERS,
)
from .writers import (
    write_faces as write_faces,
)
from .writers import (
    write_field as write_field,
)
from .writers import (
    write_leaves as write_leaves,
)
from .writers import (
    write_map as write_map,
)
from .writers import (
    write_shares as write_shares,
)
from .writers import (
    write_windows as write_windows,
)
