"""`recorder simulate`: be a camera on this machine."""

from __future__ import annotations

import signal
from contextlib import ExitStack
from pathlib import Path

import click

from camera_drivers.qx10.simulator.behaviour import Behaviour
from camera_drivers.qx10.simulator.faults import FAULTS, UnknownFaultError
from camera_drivers.qx10.simulator.pictures import NoPicturesError, open_pictures
from camera_drivers.qx10.simulator.services import GROUP, PORT
from camera_drivers.qx10.simulator.simulator import LOOPBACK, SimulatedQx10
from flight_file.untrusted import say
from recorder.cli import failures_as_sentences
from recorder.host import SystemClock
from recorder.supervision import Stop
from recorder.thresholds import LOOK_S


def _list_faults(context: click.Context, _parameter: click.Parameter, wanted: bool) -> None:  # noqa: FBT001 - click's
    if wanted:
        width = max(map(len, FAULTS))
        for fault in FAULTS.values():
            say(f"{fault.name:{width}}  {fault.place:11}  {fault.what}")
        context.exit()


@click.command(
    epilog="""\b
Examples:
  recorder simulate --port 64321
  recorder simulate --pictures fixtures/thesis_a1.mcap --fault cut_short@3 --fault reboot@10
  recorder simulate --list-faults

\b
A recorder.yaml for it:
  camera: {driver: qx10, url: 'http://127.0.0.1:64321/DmsRmtDesc.xml'}
  storage: {directory: flights/}""",
)
@click.option("--port", type=click.IntRange(0, 65535), default=0, show_default=True, help="Of all services; 0 for any.")
@click.option("--host", default=LOOPBACK, show_default=True, help="The address to listen on.")
@click.option(
    "--pictures", type=click.Path(path_type=Path, exists=True), help="A folder of JPEGs or a flight file; else drawn."
)
@click.option("--shot-s", type=click.FloatRange(0, 60), default=0.3, show_default=True, help="How long a shot takes.")
@click.option(
    "--fault",
    "faults",
    multiple=True,
    metavar="NAME[@N]",
    help="Misbehave: at the next shot, download and so on, or at the N-th; may be repeated.",
)
@click.option("--ledger", type=click.Path(path_type=Path, dir_okay=False), help="JSON lines of what was delivered.")
@click.option("--ssdp", is_flag=True, help="Answer searches on the network, at --host's interface.")
@click.option(
    "--list-faults", is_flag=True, is_eager=True, expose_value=False, callback=_list_faults, help="List them and stop."
)
def simulate(
    *,
    port: int,
    host: str,
    pictures: Path | None,
    shot_s: float,
    faults: tuple[str, ...],
    ledger: Path | None,
    ssdp: bool,
) -> None:
    """Be a QX10 on this machine until SIGTERM or Ctrl-C.

    The address to configure is printed first. Nothing of the recorder can tell it from a camera, save that its pictures
    are yours.
    """
    stop = Stop()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda number, _frame: stop.request(signal.Signals(number).name))
    with ExitStack() as stack, failures_as_sentences():
        try:
            camera = SimulatedQx10(
                SystemClock(),
                source=open_pictures(pictures),
                behaviour=Behaviour(shot_s=shot_s),
                host=host,
                port=port,
                ledger_file=stack.enter_context(ledger.open("w", encoding="utf-8")) if ledger else None,
                search_port=PORT if ssdp else None,
                search_group=GROUP if ssdp else None,
            )
            for fault in faults:
                camera.fault_schedule.order_as_text(fault)
        except (NoPicturesError, UnknownFaultError) as error:
            raise click.UsageError(str(error)) from error
        except OSError as error:
            raise click.ClickException(f"{host}:{port} cannot be used ({error.strerror}); give another.") from error
        with camera:
            say(camera.url)
            while not stop.event.wait(LOOK_S):
                pass
    taken, delivered = len(camera.ledger.taken), len(camera.ledger.delivered())
    say(f"{taken} pictures taken, {delivered} delivered whole.", err=True)
