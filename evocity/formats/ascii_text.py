"""Text in ASCII, for parts of files that hold no other letters."""

import unicodedata

_SIGNS = {"©": "(c)", "®": "(R)", "–": "-", "—": "-", "’": "'"}


def to_ascii(text: str) -> str:
    """Spell ``text`` in ASCII: © as (c), é as e, and unknown letters as question marks."""
    for sign, letters in _SIGNS.items():
        text = text.replace(sign, letters)
    plain = unicodedata.normalize("NFKD", text)
    letters = "".join(letter for letter in plain if not unicodedata.combining(letter))
    return letters.encode("ascii", "replace").decode()
