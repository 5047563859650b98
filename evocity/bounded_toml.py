"""Parsing of TOML within limits, so that a stranger's text cannot fill the memory."""

import re
import tomllib

#: Most bytes of a text, and most parts of a key's path: those of headers, of dotted keys, and of
#: the lists and inline tables around a key.
MOST_BYTES, MOST_PARTS = 1_000_000, 32

# Strings and comments hide what they contain. A string without an end reaches to the text's end.
_TOKEN = re.compile(
    r'"""(?:[^\\]|\\.)*?(?:"{3,5}|\Z)'
    r"|'''.*?(?:'{3,5}|\Z)"
    r'|"(?:[^"\\\n]|\\.)*"?'
    r"|'[^'\n]*'?"
    r"|#[^\n]*"
    r"|[\w+-]+"
    r"|[\[\]{}=.,\n]",
    re.DOTALL,
)


class LimitError(ValueError):
    """A text of TOML exceeds a limit. ``expected`` and ``remedy`` are the parts of a message."""

    def __init__(self, found: str, expected: str, remedy: str):
        super().__init__(found)
        self.expected, self.remedy = expected, remedy


def parse_toml(text: str) -> dict:
    """Parse a ``text`` of TOML.

    Raises `LimitError` beyond `MOST_BYTES` or `MOST_PARTS`, before it parses: tomllib needs
    memory for the square of a key's parts. Raises the errors of `tomllib.loads`.
    """
    if len(text) > MOST_BYTES or len(text.encode(errors="replace")) > MOST_BYTES:
        raise LimitError(
            f"the TOML text has more than {MOST_BYTES} bytes",
            f"at most {MOST_BYTES} bytes of TOML",
            "shorten the text, for example by removing comments",
        )
    if (line := _too_deep(text)) is not None:
        raise LimitError(
            f"line {line} has a key of more than {MOST_PARTS} dotted parts",
            f"keys of at most {MOST_PARTS} dotted parts, including the parts of the table header",
            "shorten the key by nesting fewer tables and lists",
        )
    return tomllib.loads(text)


def _too_deep(text: str) -> int | None:
    """Return the number of the first line with a key of too many parts, None without one."""
    line, table, parts = 1, 0, 0  # parts of the table's header, and of the key that is read
    value = 0  # parts of the path to the value that is read
    around: list[tuple[str, int]] = []  # open lists and inline tables, with the parts before them
    is_key, is_header, at_start = True, False, True
    for match in _TOKEN.finditer(text):
        token = match[0]
        inside, outer = around[-1] if around else ("", table)
        if token == "\n":
            line += 1
            if not around:
                table = parts if is_header else table
                parts, is_key, is_header, at_start = 0, True, False, True
            continue
        if token == "[" and at_start:
            parts, is_header, table = 0, True, 0
        elif token == "=":
            parts, is_key, value = 0, False, outer + parts
        elif token == ",":
            parts, is_key, value = 0, inside == "{", outer
        elif token in "[{" and not is_header:
            around.append((token, max(value, outer) + (token == "[")))
            parts, is_key = 0, token == "{"
        elif token in "]}" and around:
            around.pop()
            parts, is_key = 0, False
        elif token not in "[]{}." and token[0] != "#" and (is_key or is_header):
            parts += 1
        at_start = False
        if max(outer + parts, value, around[-1][1] if around else 0) > MOST_PARTS:
            return line
        line += token.count("\n")
    return None
