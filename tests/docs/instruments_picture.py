"""`python -m tests.docs.instruments_picture`: the picture in docs/instruments.md, of instruments that tests draw."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.decoder.instruments import test_attitude as attitude
from tests.decoder.instruments import test_ball as ball
from tests.decoder.instruments import test_lamp as lamp
from tests.decoder.instruments import test_linear as linear
from tests.decoder.instruments import test_lookalikes as lookalikes
from tests.decoder.instruments import test_over_card as over_card
from tests.decoder.instruments import test_tape as tape
from tests.decoder.instruments.altimeters import drawn as altimeter
from tests.decoder.instruments.dials import CENTRE, Canvas, Hand, paint
from tests.decoder.instruments.displays import Drawn, exposed
from tests.decoder.instruments.printed_rows import DrawnRow
from tests.decoder.instruments.test_cards import draw as card

PICTURE = Path(__file__).parents[2] / "docs" / "pictures" / "instruments.png"
SIDE_PX, TEXT_PX, ROW = 190, 26, 6


Picture = NDArray[Any]


def dial(picture: Picture) -> Picture:
    """Cut a dial out of a picture."""
    x, y = round(CENTRE[0]), round(CENTRE[1])
    return picture[y - 84 : y + 84, x - 84 : x + 84]


def needle(canvas: Canvas) -> None:
    """A needle over tick marks."""
    canvas.dial(range(120, 421, 30))
    canvas.hand(Hand(), 250.0)


def cells() -> Mapping[str, Picture]:
    """By kind what it looks like."""
    _, grid = tape.compass()
    return {
        "needle": dial(paint(needle)),
        "geared hands": dial(altimeter((200.0, 320.0, 80.0))),
        "card": dial(card(25.0)),
        "needle over a card": dial(over_card.with_pointer(40.0, 200.0)),
        "attitude": dial(attitude.draw(20.0, 5.0)),
        "symmetrical pointer": dial(lookalikes.draw_aeroplane(15.0)),
        "ball": ball.draw(0.35)[60:160],
        "lamp": np.hstack([lamp.drawn(0.0), lamp.drawn(140.0)]),
        "straight scale": linear.window(70.0),
        "tape": tape.drum(305.0, grid),
        "digits": exposed(Drawn().picture("118.35")),
        "printed digits": DrawnRow().picture(2999.6),
    }


def titled(title: str, picture: Picture) -> Picture:
    """A picture in a square, with its title below."""
    scale = min((SIDE_PX - 8) / side for side in picture.shape)
    shown = cv2.resize(picture.astype(np.float32), None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    cell = np.full((SIDE_PX + TEXT_PX, SIDE_PX), 255, np.uint8)
    top, left = ((SIDE_PX - side) // 2 for side in shown.shape)
    cell[top : top + shown.shape[0], left : left + shown.shape[1]] = np.clip(shown, 0, 255)
    cv2.putText(cell, title, (8, SIDE_PX + 16), cv2.FONT_HERSHEY_SIMPLEX, 0.5, 0, 1, cv2.LINE_AA)
    return cell


def main() -> None:
    """Write the picture."""
    shown = [titled(*each) for each in cells().items()]
    shown += [np.full_like(shown[0], 255)] * (-len(shown) % ROW)
    rows = [np.hstack(shown[first : first + ROW]) for first in range(0, len(shown), ROW)]
    cv2.imwrite(str(PICTURE), np.vstack(rows))


if __name__ == "__main__":
    main()
