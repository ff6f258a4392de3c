"""Pictures as the bytes of their files."""

from __future__ import annotations

import io

from PIL import Image


def encoded(picture: Image.Image, kind: str = "JPEG", **options: object) -> bytes:
    """A picture as Pillow writes it."""
    stream = io.BytesIO()
    picture.save(stream, kind, **options)
    return stream.getvalue()


def plain_picture(kind: str = "JPEG", size: tuple[int, int] = (64, 48), **options: object) -> bytes:
    """A small picture of one colour."""
    return encoded(Image.new("RGB", size, (90, 120, 60)), kind, **options)
