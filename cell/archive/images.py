"""PNG images on disk: whole and of the right size, or refused."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np

from cell.archive.files import read_bytes
from cell.core.errors import DocumentError
from cell.core.observation import Image

SIGNATURE = b"\x89PNG\r\n\x1a\n"
LARGEST = 50_000_000  # bytes; an image of the sensor has some 400,000
HEADER = b"\x00\x00\x00\rIHDR"  # then width and height


def read_image(path: Path, image_size: tuple[int, int]) -> Image:
    """Read a PNG as 8-bit grey; `image_size` is (width, height) as the sensor has it.

    Raises:
        DocumentError: absent, no PNG, cut short, damaged, or of another size.
    """
    content = read_bytes(path, LARGEST)
    # OpenCV fills what is missing of a damaged file with grey and says nothing.
    if fault := _find_fault(content):
        raise DocumentError(f"expected a whole PNG image; {fault}", source=str(path))
    width, height = struct.unpack_from(">II", content, len(SIGNATURE + HEADER))
    if (width, height) != tuple(image_size):
        raise DocumentError(f"expected {image_size[0]} x {image_size[1]} px, the sensor's size; "
                            f"came {width} x {height} px", source=str(path))
    image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise DocumentError("expected a whole PNG image; it cannot be decoded", source=str(path))
    return np.asarray(image, dtype=np.uint8)


def _find_fault(content: bytes) -> str | None:
    """Walk through the chunks of a PNG; None if all are whole and the end is there."""
    if not content.startswith(SIGNATURE):
        return "this is none" if content else "the file is empty"
    if not content.startswith(SIGNATURE + HEADER):
        return "it does not begin with its size"
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
