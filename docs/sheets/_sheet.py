"""What the scripts beside this one share: pictures in rows, a line over each, thanks below."""

from collections.abc import Sequence
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

import evocity
from evocity.pictures.colours import FAINT, INK, PAPER

IMAGES = Path(__file__).parent.parent / "images"
FONT = Path(evocity.__file__).parent / "data" / "fonts" / "roboto-regular.ttf"
GAP, MARGIN = 14, 24


def font(size: int) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(FONT, size)


def contact_sheet(
    rows: Sequence[Sequence[tuple[str, Image.Image]]],
    *,
    titles: Sequence[str] = (),
    thanks: Sequence[str] = (),
    text: int = 15,
) -> Image.Image:
    """Rows of (line, picture), all of one size, each row under its title if there are any."""
    wide, tall = rows[0][0][1].size
    line, head = round(1.6 * text), round(2.2 * text)
    most = max(len(row) for row in rows)
    width = 2 * MARGIN + most * wide + (most - 1) * GAP
    each = tall + line + GAP + (head if titles else 0)
    height = 2 * MARGIN + len(rows) * each + len(thanks) * line
    sheet = Image.new("RGB", (width, height), PAPER)
    brush = ImageDraw.Draw(sheet)
    top = MARGIN
    for number, row in enumerate(rows):
        if titles:
            brush.text((MARGIN, top), titles[number], INK, font(round(1.2 * text)), "lt")
            top += head
        for index, (caption, picture) in enumerate(row):
            left = MARGIN + index * (wide + GAP)
            brush.text((left, top), caption, INK, font(text), "lt")
            sheet.paste(picture, (left, top + line))
        top += tall + line + GAP
    for number, credit in enumerate(thanks):
        brush.text((MARGIN, top + number * line), credit, FAINT, font(round(0.9 * text)), "lt")
    return sheet


def save(sheet: Image.Image, name: str, colours: int = 96) -> None:
    """Write docs/images/``name`` with few colours, and say how large it became."""
    target = IMAGES / name
    sheet.quantize(colours, dither=Image.Dither.NONE).save(target, optimize=True)
    print(f"wrote {target.relative_to(IMAGES.parent)}, {target.stat().st_size // 1024} KB")
