"""Options for the details of curves and surfaces: which levels change, and by how much."""

from evocity.cli.shared.options import WHOLE, option
from evocity.errors import EvocityError

finest_levels_option = option(
    "--levels",
    "Number of finest levels whose details the command replaces. [all but the coarsest]",
    WHOLE,
)
donor_gain_option = option("--gain", "Factor that multiplies the details of DONOR.", float, 1.0)
gain_option = option(
    "--gain",
    "Factor that multiplies the details; a factor of 0 removes all details.",
    float,
    required=True,
)
levels_option = option(
    "--levels A,B", "Levels of detail to change; level 0 is the coarsest level. [all]"
)


def levels_of(text: str | None) -> list[int] | None:
    """Read the numbers of levels after ``--levels``; None means all. Raises `EvocityError`."""
    if text is None:
        return None
    parts = [part.strip() for part in text.split(",")]
    if not all(part.isdecimal() and len(part) < 4 for part in parts):
        raise EvocityError(
            f"--levels {text} is not a list of levels",
            "the numbers of levels with commas between them, such as 5,6",
            "correct the list after --levels",
        )
    return [int(part) for part in parts]
