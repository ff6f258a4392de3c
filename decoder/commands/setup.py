"""`decode setup FLIGHT|PICTURE`: draw or edit a panel in the browser."""

from __future__ import annotations

import webbrowser
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import click

from flight_file.untrusted import say

if TYPE_CHECKING:
    from decoder.setup.session import SetupSession

EPILOG = """\b
Examples:
  decode setup flight.mcap
  decode setup flight.mcap --panel cockpit/panel.yaml
  decode setup other_flight.mcap --panel cockpit/panel.yaml --save-as other/panel.yaml
  decode setup cockpit.jpg --no-browser
  decode setup flight.mcap --propose panel.yaml
"""


@click.command("setup", epilog=EPILOG)
@click.argument("pictures", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FLIGHT...|PICTURE")
@click.option(
    "--panel", "panel_file", type=click.Path(path_type=Path, dir_okay=False), metavar="PANEL",
    help="The panel.yaml to open; a new one is started if it is not there.  [default: the flight's own]",
)  # fmt: skip
@click.option(
    "--save-as", "target", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE",
    help="Where it is saved, with its pictures.  [default: PANEL, or panel.yaml in the current folder]",
)  # fmt: skip
@click.option(
    "--camera", "camera_file", type=click.Path(path_type=Path, dir_okay=False), metavar="CAMERA",
    help="A camera.yaml of the camera that took the pictures.  [default: the flight's own]",
)  # fmt: skip
@click.option(
    "--propose", "proposal_file", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE",
    help="Draft a panel automatically, say how sure it is of each dial, and open no page.",
)  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="With --propose: print what was found as JSON.")
@click.option("--browser/--no-browser", default=True, help="Open the page, or only print its address.")
def command(
    pictures: tuple[Path, ...],
    panel_file: Path | None,
    target: Path | None,
    camera_file: Path | None,
    proposal_file: Path | None,
    *,
    as_json: bool,
    browser: bool,
) -> None:
    """Draw or edit the panel of FLIGHT, or of one PICTURE, in the browser.

    The page is served on this machine alone, until Ctrl-C. Every change is tried on frames of the flight at once.
    """
    if proposal_file is not None:
        if panel_file is not None or target is not None:
            raise click.UsageError("--propose writes a new panel: leave out --panel and --save-as")
        _propose(pictures, proposal_file, camera_file, as_json=as_json)
        return
    if as_json:
        raise click.UsageError("--json says what --propose found: give --propose FILE")
    if find_spec("uvicorn") is None or find_spec("starlette") is None:
        raise click.UsageError(
            "the set-up page needs starlette and uvicorn: pip install 'image-flight-recorder[setup]'"
        )
    from decoder.setup.app import setup_server  # noqa: PLC0415 - half a second that only this command needs

    session = _session(pictures, panel_file, target or panel_file or Path("panel.yaml"), camera_file)
    server = setup_server(session)
    say(f"Draw the panel at {server.url}", f"It is saved to {session.target}; Ctrl-C ends the page.")
    if browser:
        webbrowser.open(server.url)
    server.run()


def _session(
    pictures: tuple[Path, ...], panel_file: Path | None, target: Path, camera_file: Path | None, *, is_new: bool = False
) -> SetupSession:
    """Open the flight or picture for the page or the proposal."""
    import cv2  # noqa: PLC0415
    from threadpoolctl import threadpool_limits  # noqa: PLC0415

    from decoder.panel.camera import camera_from_file  # noqa: PLC0415
    from decoder.setup.session import SetupSession  # noqa: PLC0415
    from decoder.setup.sources import open_source  # noqa: PLC0415

    cv2.setNumThreads(1)  # as in `decode`, so that trials give the same readings
    threadpool_limits(1)
    camera = None if camera_file is None else camera_from_file(camera_file)
    return SetupSession(open_source(pictures), panel_file, target, camera=camera, is_new=is_new)


def _propose(pictures: tuple[Path, ...], target: Path, camera_file: Path | None, *, as_json: bool) -> None:
    """Write a draft of what was found, and report it."""
    from decoder.outputs.outputs import refuse_unwritable  # noqa: PLC0415
    from decoder.panel.errors import OutputError  # noqa: PLC0415
    from decoder.setup.proposing.draft import drafted  # noqa: PLC0415

    if target.exists():
        raise click.UsageError(f"{target} is there already: name another file for --propose")
    try:
        refuse_unwritable(target.parent, target.name)
    except OutputError as error:
        raise OutputError(f"{target.parent}: no panel can be written there; name another file for --propose") from error
    session = _session(pictures, None, target, camera_file, is_new=True)
    if session.draft is not None:
        raise click.UsageError(f"what was drawn for {target} is not saved yet: save it first, or name another file")
    draft = drafted(session)
    say(*(draft.json if as_json else draft.text).splitlines())
