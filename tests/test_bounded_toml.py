"""TOML within limits: refused before tomllib, which needs memory for a path's square, parses it."""

import time
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evocity.bounded_toml import MOST_BYTES, MOST_PARTS, LimitError, parse_toml
from evocity.errors import EvocityError
from evocity.recipe.reader import read_recipe
from evocity.views.classes.table import ClassTable


def path(parts: int) -> str:
    return ".".join("a" * parts)


FORMS = {
    "dotted key": lambda n: f"{path(n)} = 1.5",
    "quoted parts": lambda n: f'"q.q" . {path(n - 1)} = 1',
    "header": lambda n: f"[{path(n - 1)}]\nx = 0.5",
    "header of a list": lambda n: f"[[ {path(n - 1)} ]]  # of tables\nx = 2020-01-01T00:00:00.5",
    "inline tables": lambda n: "x = " + "{a = " * (n - 1) + "1" + "}" * (n - 1),
    "lists": lambda n: "[[p]]\nm = " + "[" * (n - 2) + "]" * (n - 2),
    "all of them": lambda n: f"[{path(10)}]\n{path(10)} = {{ {path(n - 20)} = 1 }}",
    "after a text": lambda n: f'x = {{ b = """a"""", {path(n - 1)} = 1 }}',
    "in a list": lambda n: f"x = [{{ b = [1.5,\n 2.5] }}, # c\n{{ {path(n - 2)} = 1 }}]",
}


@pytest.mark.parametrize("form", FORMS)
def test_paths_of_keys_have_a_limit(form):
    text = FORMS[form](MOST_PARTS)
    assert parse_toml(text) == tomllib.loads(text)
    with pytest.raises(LimitError, match="32 dotted parts"):
        parse_toml(FORMS[form](MOST_PARTS + 1))


@given(st.text(alphabet="a.=[]{}\"'#\n\\, 1", max_size=60))
def test_short_texts_parse_as_by_tomllib(text):
    def outcome(parse):
        try:
            return parse(text)
        except tomllib.TOMLDecodeError as error:
            return str(error)

    if text.count(".") + text.count("[") < MOST_PARTS and '"' not in text and "'" not in text:
        assert outcome(parse_toml) == outcome(tomllib.loads)


@pytest.mark.parametrize(
    "text",
    [
        "a." * 50_000 + "a = 1",
        "[" + "a." * 50_000 + "a]",
        "x = " + "{a = " * 6000 + "1" + "}" * 6000,
        "x = " + "[" * 6000,
        "x = 1\n" * (MOST_BYTES // 6) + "y = 2\n",
        "'" * 999_999,
        '"""' + '\\"""' * 200_000,
    ],
    ids=["key", "header", "tables", "lists", "long", "quotes", "text without an end"],
)
def test_hostile_texts_end_at_once(text, tmp_path):
    (tmp_path / "bad.toml").write_text(text)
    began = time.process_time()
    with pytest.raises(EvocityError):
        read_recipe(tmp_path / "bad.toml")
    with pytest.raises(EvocityError):
        ClassTable.of(text)
    assert time.process_time() - began < 1.5
