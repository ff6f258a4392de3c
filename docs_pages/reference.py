"""The pages of docs/reference, from the commands and the descriptions' models as they are."""

from __future__ import annotations

from decoder.commands.cli import cli as decode
from decoder.panel.camera import Camera
from decoder.panel.panel import Panel
from docs_pages.commands import command_pages
from docs_pages.fields import field_sections
from recorder.cli import main as recorder
from recorder.config import RecorderConfig

MADE = "<!-- Made from the code by `make reference`; change it there. -->"


def pages() -> dict[str, str]:
    """Text by file name."""
    return {
        "decode.md": _page("The command `decode`", command_pages("decode", decode)),
        "recorder.md": _page("The command `recorder`", command_pages("recorder", recorder)),
        "panel.yaml.md": _page(
            "The keys of `panel.yaml`",
            "How they work together is in [the panel](../panel.md). Places are [x, y] in the panel picture's pixels,"
            " angles degrees, 0 = right, clockwise positive.\n\n" + field_sections(Panel),
        ),
        "camera.yaml.md": _page(
            "The keys of `camera.yaml`",
            "`decode calibrate` writes it; see [calibration](../calibration.md).\n\n" + field_sections(Camera),
        ),
        "recorder.yaml.md": _page(
            "The keys of `recorder.yaml`",
            "An example is in [the box](../box.md), more on the cameras' settings in [cameras](../cameras.md)"
            " and [the QX10](../qx10.md)."
            " Paths are relative to the file they stand in; a key that is not here is refused.\n\n"
            + field_sections(RecorderConfig),
        ),
    }


def _page(title: str, text: str) -> str:
    return f"# {title}\n\n{MADE}\n\n{text.rstrip()}\n"
