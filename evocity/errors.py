"""The one family of errors evocity raises for input at fault.

Every message has three parts: what was found, what was expected, what to do.
"""


class EvocityError(Exception):
    """Something the user gave cannot be used.

    Parameters
    ----------
    found : what arrived, with its name (file, key, parameter).
    expected : what would have been right.
    remedy : what to do next, one sentence.
    """

    def __init__(self, found: str, expected: str, remedy: str):
        super().__init__(found, expected, remedy)
        self.found, self.expected, self.remedy = found, expected, remedy

    def __str__(self) -> str:
        return f"{self.found}\n  expected: {self.expected}\n  what to do: {self.remedy}"


class MapError(EvocityError):
    """A map, or the file it should be read from, cannot be used."""


class GenomeError(EvocityError):
    """A genome, or a file of one, breaks the bounds of its nucleotides or its schema."""


class OperatorError(EvocityError):
    """A breeding operator got parents or parameters it cannot work with."""


class FitnessError(EvocityError):
    """A measure is unknown, cannot be loaded, or is declared wrongly."""


class RecipeError(EvocityError):
    """A recipe has faults; the message lists all of them."""


class RunError(EvocityError):
    """A run folder is missing, damaged, in use, or in the way."""
