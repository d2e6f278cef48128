"""Heights from the brightness of a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from harpy_pin.errors import InputError, shown
from harpy_pin.model.state import Vector

__all__: list[str] = []

BITS = {"I;16": 65535.0, "I;16B": 65535.0, "I": 65535.0}
"""Value of white in the modes of pictures with 16 bits for each point; in others it is 255."""


def brightness(path: str | Path, most: int) -> Vector:
    """Brightness of a picture from 0 to 1: rows from left to right, each from the bottom to the top.

    Args:
        path: of the picture.
        most: points in either direction; a picture with more is averaged down.

    Raises:
        InputError: it is no picture, or has fewer than two points in a direction.
    """
    from PIL import Image

    try:
        with Image.open(path) as opened:
            white = BITS.get(opened.mode, 255.0)
            picture = (opened if opened.mode in BITS else opened.convert("L")).convert("F")
    except (OSError, ValueError, TypeError, AttributeError, SyntaxError, Image.DecompressionBombError) as error:
        raise InputError(f"no picture can be read from {shown(path)}: {error}", name="path", value=path) from None
    share = min(most / max(picture.size), 1.0)
    width, height = (round(share * side) for side in picture.size)
    if min(width, height) < 2:
        message = f"a picture needs two points in each direction, got {picture.size[0]} by {picture.size[1]}"
        raise InputError(message, name="path", value=path)
    if share < 1.0:
        picture = picture.resize((width, height), Image.Resampling.BOX)
    return np.ascontiguousarray(np.asarray(picture, dtype=np.float64)[::-1].T / white)
