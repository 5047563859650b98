"""Conditions on births, "fsi > 2 and crumbs < 4": parsed by Python, never executed.

A condition may have comparisons, also chained ones (0.2 < gsi <= 0.4), ``and``, ``or``, ``not``,
brackets, + - * /, numbers, texts, True and False, and names of columns. A name that is not a Python
name stands between backticks: `` `gsi@old town` > 0.3``.
"""

import ast
import re
import warnings
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

import numpy as np

from evocity.errors import EvocityError, near_miss, spell

#: Letters of a condition, and operations within each other.
MOST_LETTERS, DEEPEST = 2000, 50
#: Operations that a condition may have.
_COMPARED: Mapping[type, Callable] = {
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
    ast.Eq: np.equal,
    ast.NotEq: np.not_equal,
}
_CALCULATED: Mapping[type, Callable] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
}
_EXAMPLE = "a condition such as fsi > 2 and crumbs < 4 and operator == 'relocation'"
_QUOTED = re.compile("`([^`]*)`")
# What stands for a quoted name while Python reads: ǁ is a letter that no text is written with.
_PLACE = "quotedǁ{}"


@dataclass(frozen=True)
class Condition:
    """A condition on births; made by `Condition.read`. ``names``: the columns in it."""

    text: str
    names: tuple[str, ...]
    _tree: ast.expr
    _quoted: tuple[str, ...]
    _known: tuple[str, ...]

    @classmethod
    def read(cls, text: str, known: Collection[str]) -> "Condition":
        """Parse the condition in ``text``; ``known`` are the columns. Raises `EvocityError`."""
        if not isinstance(text, str):
            raise _fault(text, "it is not a text")
        if len(text) > MOST_LETTERS:
            raise _fault(text, f"{len(text)} letters, more than {MOST_LETTERS}")
        quoted: list[str] = []

        def placed(match: re.Match) -> str:
            quoted.append(match[1])
            return _PLACE.format(len(quoted) - 1)

        try:
            with warnings.catch_warnings():  # of texts that Python would find odd
                warnings.simplefilter("ignore")
                tree = ast.parse(_QUOTED.sub(placed, text).strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            where = getattr(error, "msg", None) or "it cannot be read"
            raise _fault(text, where) from None
        one = cls(text, (), tree, tuple(quoted), tuple(known))
        names = dict.fromkeys(one._names(tree, 0))
        return cls(text, tuple(names), tree, tuple(quoted), tuple(known))

    def kept(self, column: Callable[[str], np.ndarray], count: int) -> np.ndarray:
        """Return which births meet it, bool ``(count,)``. ``column``: a function from a name to its
        column. A birth without a number there (NaN) meets no comparison."""
        with np.errstate(all="ignore"):
            truths = self._value(self._tree, {name: column(name) for name in self.names})
        if _kind(truths) != "truth":
            raise _fault(self.text, f"it is a {_kind(truths)}, not a condition")
        return np.broadcast_to(truths, count).copy()

    # -- reading -----------------------------------------------------------------------------

    def _names(self, node: ast.expr, depth: int) -> list[str]:
        """The columns in a ``node``; raises for a part that a condition may not have."""
        if depth > DEEPEST:
            raise _fault(self.text, f"more than {DEEPEST} operations within each other")
        if (name := self._named(node)) is not None:
            return [self._column(name)]
        parts = _parts(node)
        if parts is None:
            raise _fault(self.text, f"{_shown(node)} may not stand in it")
        return [name for part in parts for name in self._names(part, depth + 1)]

    def _named(self, node: ast.expr) -> str | None:
        """The name that a ``node`` is: building_types.house, gsi@quarter; None for other nodes."""
        if isinstance(node, ast.Name):
            place, _, number = node.id.partition("ǁ")
            quoted = place == "quoted" and number.isdecimal() and int(number) < len(self._quoted)
            return self._quoted[int(number)] if quoted else node.id
        if isinstance(node, ast.Attribute):
            before = self._named(node.value)
            return None if before is None else f"{before}.{node.attr}"
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
            left, right = self._named(node.left), self._named(node.right)
            return None if None in (left, right) else f"{left}@{right}"
        return None

    def _column(self, name: str) -> str:
        for one in (name, name.removeprefix("fitness.")):
            if one in self._known:
                return one
        remedy = near_miss(name, self._known) or f"name one of {', '.join(self._known)}"
        raise EvocityError(
            f"{self.text!r}: there is no column {name!r}", "a column of the births", remedy
        )

    # -- evaluation --------------------------------------------------------------------------

    def _value(self, node: ast.expr, columns: Mapping[str, np.ndarray]):
        if (name := self._named(node)) is not None:
            return columns[self._column(name)]
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, ast.BoolOp):
            truths = [self._truth(self._value(one, columns)) for one in node.values]
            join = np.logical_and if isinstance(node.op, ast.And) else np.logical_or
            return join.reduce(np.broadcast_arrays(*truths))
        if isinstance(node, ast.UnaryOp):
            value = self._value(node.operand, columns)
            if isinstance(node.op, ast.Not):
                return np.logical_not(self._truth(value))
            return np.negative(self._number(value)) if isinstance(node.op, ast.USub) else value
        if isinstance(node, ast.BinOp):
            left, right = (self._number(self._value(n, columns)) for n in (node.left, node.right))
            return _CALCULATED[type(node.op)](left, right)
        assert isinstance(node, ast.Compare)
        values = [self._value(one, columns) for one in (node.left, *node.comparators)]
        pairs = zip(values, values[1:], node.ops, strict=False)
        truths = [self._compared(left, right, type(op)) for left, right, op in pairs]
        return np.logical_and.reduce(np.broadcast_arrays(*truths))

    def _compared(self, left, right, op: type) -> np.ndarray:
        kinds = {_kind(left), _kind(right)}
        if len(kinds) > 1:
            raise _fault(self.text, f"a {' is compared with a '.join(sorted(kinds))}")
        if kinds != {"number"} and op not in (ast.Eq, ast.NotEq):
            raise _fault(self.text, f"a {kinds.pop()} cannot be more or less than another")
        truths = np.asarray(_COMPARED[op](left, right), bool)
        if kinds == {"number"}:  # NaN is not a number, so it does not differ from any
            truths = truths & ~(np.isnan(left) | np.isnan(right))
        return truths

    def _truth(self, value) -> np.ndarray:
        if _kind(value) != "truth":
            raise _fault(self.text, f"it joins {_kind(value)}s like conditions")
        return np.asarray(value, bool)

    def _number(self, value):
        if _kind(value) != "number":
            raise _fault(self.text, f"it calculates with a {_kind(value)}")
        return np.asarray(value, float)


def _parts(node: ast.expr) -> list[ast.expr] | None:
    """The parts of a ``node``; None for a node that a condition may not have."""
    if isinstance(node, ast.Constant):
        kinds = (bool, int, float, str)
        large = isinstance(node.value, int) and abs(node.value) > 2**63
        return [] if type(node.value) in kinds and not large else None
    if isinstance(node, ast.BoolOp):
        return node.values
    if isinstance(node, ast.UnaryOp):
        return [node.operand] if isinstance(node.op, ast.Not | ast.USub | ast.UAdd) else None
    if isinstance(node, ast.BinOp):
        return [node.left, node.right] if type(node.op) in _CALCULATED else None
    if isinstance(node, ast.Compare):
        known = all(type(op) in _COMPARED for op in node.ops)
        return [node.left, *node.comparators] if known else None
    return None


def _kind(value) -> str:
    kind = np.asarray(value).dtype.kind
    return {"b": "truth", "U": "text", "O": "text", "T": "text"}.get(kind, "number")


def _shown(node: ast.expr) -> str:
    try:
        return spell(ast.unparse(node))
    except (ValueError, RecursionError):
        return "what"


def _fault(text: object, why: str) -> EvocityError:
    return EvocityError(
        f"{spell(text)}: {why}",
        _EXAMPLE,
        "use comparisons, and, or, not, + - * /, and brackets",
    )
