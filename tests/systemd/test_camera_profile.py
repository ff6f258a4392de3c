"""The camera's Wi-Fi, read back by NetworkManager's own library."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

SYSTEMD = Path(__file__).parents[2] / "systemd"
TEMPLATE = (SYSTEMD / "camera.nmconnection").read_text(encoding="utf-8")
SYSTEM_PYTHON = "/usr/bin/python3"  # Debian's, which has the bindings to libnm

LIBNM = """
import json, sys, gi
gi.require_version("NM", "1.0")
from gi.repository import GLib, NM
print("{}", flush=True)
for line in sys.stdin:
    profile, keys = json.loads(line), GLib.KeyFile()
    keys.load_from_data(profile, len(profile.encode()), GLib.KeyFileFlags.NONE)
    read = NM.keyfile_read(keys, "/", NM.KeyfileHandlerFlags.NONE, None, None)
    read.get_setting_connection().set_property("uuid", NM.utils_uuid_generate())  # as the daemon does
    read.verify()
    wifi, security = read.get_setting_wireless(), read.get_setting_wireless_security()
    told = {"ssid": wifi.get_ssid().get_data().hex(), "psk": security.get_psk(), "interface": read.get_interface_name()}
    settings = [section + "." + key for section in keys.get_groups()[0] for key in keys.get_keys(section)[0]]
    print(json.dumps({**told, "settings": settings}), flush=True)
"""

Read = Callable[[str], dict[str, Any]]


@pytest.fixture(scope="module")
def read() -> Iterator[Read]:
    """Reads a profile as NetworkManager does."""
    command, pipe = [SYSTEM_PYTHON, "-I", "-c", LIBNM], subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, encoding="utf-8") as process:
        assert process.stdin is not None
        assert process.stdout is not None
        if not process.stdout.readline():
            pytest.skip("Debian's python3-gi and gir1.2-nm-1.0 are not installed")
        stdin, stdout = process.stdin, process.stdout

        def ask(profile: str) -> dict[str, Any]:
            stdin.write(json.dumps(profile) + "\n")
            stdin.flush()
            told: dict[str, Any] = json.loads(stdout.readline())
            return told

        yield ask
        stdin.close()


def load() -> Any:  # noqa: ANN401 - a script
    """The script as a module."""
    spec = spec_from_file_location("camera_profile", SYSTEMD / "camera_profile.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


SCRIPT = load()

PRINTED = st.characters(exclude_categories=("Cc", "Cs"))
PASSWORDS = st.text(PRINTED, min_size=8, max_size=63).filter(lambda text: len(text.encode()) in range(8, 64))
KEYS = st.text("0123456789abcdefABCDEF", min_size=64, max_size=64)
NAMES = st.one_of(
    st.binary(min_size=1, max_size=32).map(lambda name: name.replace(b"\0", b"0")),
    st.text(min_size=1, max_size=32).map(lambda name: name.encode("utf-8", "replace")[:32].replace(b"\0", b"0")),
    st.text("\\;12 sn\n\t\r=[]#", min_size=1, max_size=32).map(str.encode),
)
INTERFACES = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9._-]{0,14}", fullmatch=True)


@given(ssid=NAMES, interface=INTERFACES, password=st.one_of(PASSWORDS, KEYS))
@example(ssid=b"DIRECT-reQ0:DSC-QX10", interface="wlan0", password="8 letter")  # noqa: S106
@example(ssid=b"x\n[ipv4]\nmethod=shared", interface="wlan0", password="\\n[ipv4]\\n")  # noqa: S106
@example(ssid=b"1;2;3;", interface="wlan0", password="@SSID@@INTERFACE@")  # noqa: S106
@example(ssid=b" \\; ", interface="wlan0", password="  \\s  \\s  ")  # noqa: S106
@example(ssid=b"\xff", interface="wlan0", password="#;=[x]    ")  # noqa: S106
def test_profile_is_read_back_as_it_was_meant(read: Read, ssid: bytes, interface: str, password: str) -> None:
    """Any name of one to 32 bytes, any password that a Wi-Fi can have; and nothing beside what the template sets."""
    told = read(SCRIPT.profile(ssid, interface, password.encode()))
    settings = read(TEMPLATE)["settings"]

    assert told == {"ssid": ssid.hex(), "psk": password, "interface": interface, "settings": settings}


@given(ssid=st.binary(max_size=40), interface=st.text(max_size=20), password=st.binary(max_size=70))
def test_whatever_is_given_is_refused_or_changes_three_values(ssid: bytes, interface: str, password: bytes) -> None:
    """What is written has the lines of the template, whatever was given."""
    try:
        lines = SCRIPT.profile(ssid, interface, password).split("\n")
    except ValueError as error:
        refused = str(error)
        lines = TEMPLATE.split("\n")
    else:
        refused = ""

    assert "\n" not in refused
    assert [line.partition("=")[0] for line in lines] == [line.partition("=")[0] for line in TEMPLATE.split("\n")]


def test_password_is_on_no_command_line() -> None:
    """It comes on standard input, with or without an end of line."""
    for end in (b"", b"\n"):
        command = [sys.executable, SYSTEMD / "camera_profile.py", "camera", "wlan0"]
        done = subprocess.run(command, input=b"pass word" + end, capture_output=True, check=True)
        assert b"\npsk=pass word\n" in done.stdout
