"""The simulated camera as a whole: made, used as a context, and told to misbehave by its `fault_schedule`."""

from __future__ import annotations

import threading
from types import TracebackType
from typing import Self, TextIO

from camera_drivers.clock import Clock
from camera_drivers.qx10.simulator.behaviour import Behaviour
from camera_drivers.qx10.simulator.faults import FaultSchedule
from camera_drivers.qx10.simulator.ledger import Ledger
from camera_drivers.qx10.simulator.model import CameraModel
from camera_drivers.qx10.simulator.pictures import Source, drawn_picture
from camera_drivers.qx10.simulator.services import DESCRIPTION_PATH, CameraServer, SearchAnswers
from camera_drivers.qx10.simulator.shot_faults import Parts, Power

LOOPBACK = "127.0.0.1"


class SimulatedQx10:
    """A camera on loopback; entering the context switches it on.

    Parameters
    ----------
    clock
        A clock that really waits.
    port
        Of all its services; 0 for any.
    ledger_file
        See `Ledger`.
    search_port, search_group
        Where it answers searches; port 0 for any, None for nowhere. With a group, the multicast group to join.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        source: Source = drawn_picture,
        behaviour: Behaviour | None = None,
        host: str = LOOPBACK,
        port: int = 0,
        ledger_file: TextIO | None = None,
        search_port: int | None = None,
        search_group: str | None = None,
    ) -> None:
        self._host = host
        self._server: CameraServer | None = CameraServer(host, port)
        self._port = self._server.server_port
        self.address = f"http://{host}:{self._port}"
        self.url = self.address + DESCRIPTION_PATH
        self.fault_schedule = FaultSchedule()
        self.ledger = Ledger(ledger_file)
        self.model = CameraModel(source, behaviour or Behaviour(), clock, self.ledger, self.address)
        self._power = Power(self.model, clock, self._set_on)
        self._parts = Parts(self.model, self.fault_schedule, self.ledger, self._power, self.address)
        self._server.parts = self._parts
        self._lock = threading.Lock()
        self._searched: SearchAnswers | None = None
        if search_port is not None:
            self._searched = SearchAnswers(
                self.url, self.fault_schedule, host=host, port=search_port, group=search_group
            )

    @property
    def search_address(self) -> tuple[str, int]:
        """The address at which it answers searches."""
        if self._searched is None:
            raise ValueError("this camera answers no searches")
        return self._searched.address

    def __enter__(self) -> Self:
        if self._server is not None:
            _serve(self._server)
        if self._searched is not None:
            self._searched.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None, /
    ) -> None:
        self._power.end()
        if self._searched is not None:
            self._searched.close()
        self._set_on(False)

    def _set_on(self, on: bool) -> None:  # noqa: FBT001 - it is a switch
        with self._lock:
            if on and self._server is None:
                self._server = CameraServer(self._host, self._port)
                self._server.parts = self._parts
                _serve(self._server)
            elif not on and self._server is not None:
                self._server.shutdown()
                self._server.server_close()
                self._server = None


def _serve(server: CameraServer) -> None:
    threading.Thread(target=server.serve_forever, args=(0.05,), name="simulated camera", daemon=True).start()
