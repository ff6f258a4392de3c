"""The camera's own calls: JSON objects over HTTP, one answer for each.

A request has a method, parameters, a number, and the version *of that method*; an answer has the same number and either
a result or an error. Only an error's code is meaningful: its text is often just the method's name.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from itertools import count
from typing import Any

from camera_drivers.errors import CameraRefusedError, CameraSilentError
from camera_drivers.qx10.link import Answer, Link
from camera_drivers.thresholds import MAX_ANSWER_BYTES

VERSION = "1.0"  # of every method but getEvent, which has 1.1 too

_OK = 200
_INT = 2**31 - 1  # the camera's own numbers have 32 bits


class Code:
    """Error codes that the driver distinguishes."""

    ANY = 1
    TIMEOUT = 2
    ILLEGAL_ARGUMENT = 3
    ILLEGAL_STATE = 7
    NO_SUCH_METHOD = 12
    UNSUPPORTED_VERSION = 14
    FORBIDDEN = 403
    NOT_FOUND = 404
    SHOOTING_FAILED = 40400
    NOT_READY = 40401
    ALREADY_POLLING = 40402
    NOT_FINISHED = 40403


class RemoteApi:
    """Calls to one camera from one thread.

    Parameters
    ----------
    services
        URL of each service by its name.
    """

    def __init__(self, link: Link, services: Mapping[str, str]) -> None:
        self.link = link
        self.services = services
        self._numbers = count(1)

    def call(
        self,
        method: str,
        *params: object,
        service: str = "camera",
        version: str = VERSION,
        limit_s: float | None = None,
    ) -> list[Any]:
        """Make a call and return its result.

        Raises
        ------
        CameraRefusedError
            The camera answered with an error.
        CameraUnreachableError, CameraSilentError
            There was no usable answer.
        Stopped
            Stopping was asked for.
        """
        if service not in self.services:
            raise CameraRefusedError(method, Code.NO_SUCH_METHOD)
        number = next(self._numbers)
        question = {"method": method, "params": list(params), "id": number, "version": version}
        answer = self.link.post(
            method,
            self.services[service],
            json.dumps(question).encode(),
            max_bytes=MAX_ANSWER_BYTES,
            limit_s=limit_s or self.link.limits.call_s,
        )
        return _result(method, number, answer)


def _result(method: str, number: int, answer: Answer) -> list[Any]:
    try:
        document = json.loads(answer.body)
    except (ValueError, RecursionError):
        document = None
    if answer.status != _OK:  # such an answer may be anything, and may lack its number
        raise CameraRefusedError(method, _code(document) or answer.status)
    if not isinstance(document, dict):
        raise CameraSilentError(method, "the answer is no JSON object")
    if document.get("id") != number:
        raise CameraSilentError(method, "the answer belongs to another question")
    if "error" in document:
        raise CameraRefusedError(method, _code(document) or Code.ANY)
    result = document.get("result", document.get("results"))
    if not isinstance(result, list):
        raise CameraSilentError(method, "the answer has no result")
    return result


def _code(document: object) -> int | None:
    error = document.get("error") if isinstance(document, dict) else None
    code = error[0] if isinstance(error, list) and error else None
    return code if isinstance(code, int) and not isinstance(code, bool) and abs(code) <= _INT else None
