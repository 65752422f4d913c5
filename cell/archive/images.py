"""PNG images on disk: whole and of the right size, or refused."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np

from cell.core.errors import DocumentError
from cell.core.observation import Image

SIGNATURE = b"\x89PNG\r\n\x1a\n"


def read_image(path: Path, image_size: tuple[int, int]) -> Image:
    """Read a PNG as 8-bit grey; `image_size` is (width, height) as the sensor has it.

    Raises:
        DocumentError: absent, no PNG, cut short, damaged, or of another size.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise DocumentError(f"cannot be read: {error.strerror}", source=str(path)) from None
    fault = _find_fault(content)
    # OpenCV fills what is missing of a damaged file with grey and says nothing.
    image = None if fault else cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise DocumentError(f"expected a whole PNG image; {fault or 'it cannot be decoded'}",
                            source=str(path))
    height, width = image.shape
    if (width, height) != tuple(image_size):
        raise DocumentError(f"expected {image_size[0]} x {image_size[1]} px, the sensor's size; "
                            f"came {width} x {height} px", source=str(path))
    return np.asarray(image, dtype=np.uint8)


def _find_fault(content: bytes) -> str | None:
    """Walk through the chunks of a PNG; None if all are whole and the end is there."""
    if not content.startswith(SIGNATURE):
        return "this is none" if content else "the file is empty"
    place = len(SIGNATURE)
    while place + 12 <= len(content):
        length, name = struct.unpack(">I4s", content[place:place + 8])
        body = content[place + 4:place + 8 + length]
        check = content[place + 8 + length:place + 12 + length]
        if len(check) < 4:
            break
        if struct.pack(">I", zlib.crc32(body)) != check:
            return f"its part {name.decode('latin-1')} is damaged"
        if name == b"IEND":
            return None
        place += 12 + length
    return "it is cut short"
