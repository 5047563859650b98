"""The page's colours: legible, and apart for who sees no green."""

import itertools
import re

import numpy as np
import pytest

from evocity.viewer.module_bundle import text

# Machado, Oliveira & Fernandes 2009, table 1: deuteranopia, severity 1; of linear RGB.
DEUTERANOPIA = np.array(
    [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ]
)
# Ottosson 2020, of linear RGB.
LMS = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
OKLAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def colours() -> dict[str, np.ndarray]:
    """Name -> linear RGB, as `elements.js` has them."""
    (body,) = re.findall(r"COLOURS = \{(.*?)\};", text("elements.js"), re.S)
    found = {name: bytes.fromhex(code) for name, code in re.findall(r'(\w+): "#(\w{6})"', body)}
    for name, listed in re.findall(r"(\w+): \[([\d, ]+)\]", body):
        found[name] = bytes(map(int, listed.split(",")))
    assert {"paper", "ink", "faint", "pale", "passing", "chosen"} <= set(found)
    shares = {name: np.frombuffer(code, np.uint8) / 255 for name, code in found.items()}
    # who does not pass is never drawn denser than this, in `parallel.js` and `scatter.js`
    shares["pale"] = 0.52 * shares["pale"] + 0.48 * shares["paper"]
    return {
        name: np.where(one <= 0.04045, one / 12.92, ((one + 0.055) / 1.055) ** 2.4)
        for name, one in shares.items()
    }


def luminance(colour: np.ndarray) -> float:
    return float(colour @ (0.2126, 0.7152, 0.0722))


def oklab(colour: np.ndarray) -> np.ndarray:
    return OKLAB @ np.cbrt(LMS @ np.clip(colour, 0, 1))


@pytest.mark.parametrize("name", ["ink", "faint", "chosen"])
def test_texts_have_contrast(name):
    found = colours()
    light, dark = luminance(found["paper"]), luminance(found[name])
    assert (light + 0.05) / (dark + 0.05) >= 4.5


def test_lines_are_apart_for_who_sees_no_green():
    """Those that do not pass, those that pass, the chosen, the one that is looked at, the paper."""
    found = colours()
    for one, other in itertools.combinations(("paper", "pale", "passing", "chosen", "ink"), 2):
        seen = [oklab(DEUTERANOPIA @ found[name]) for name in (one, other)]
        assert np.linalg.norm(seen[0] - seen[1]) > 0.1, (one, other)
