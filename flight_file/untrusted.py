"""Untrusted files and texts: opened without blocking, and made harmless for output.

Only regular files are opened: a FIFO waits for its writer, a device may have no end, a link may lead to either. A
refusal is a normal `OSError`, so that a reader has one kind of failure to report.

Text is made safe for file names, paths, terminals and spreadsheets. Plain text stays unchanged.
"""

from __future__ import annotations

import errno
import json
import os
import re
import stat
import sys
import unicodedata
from collections import Counter
from collections.abc import Iterable, Sequence
from hashlib import sha256
from pathlib import Path, PurePosixPath

import click

from flight_file.thresholds import (
    MAX_NAME_BYTES,
    MAX_READ_BYTES,
    MAX_SHOWN_CHARACTERS,
    MAX_YAML_BYTES,
)

_MARK_DIGITS = 8
_NOT_IN_NAMES = re.compile(r'[/\\:*?"<>|]')
# Device names, with any extension, for the file systems of memory sticks and network drives.
_DEVICE = re.compile(r"(con|prn|aux|nul|conin\$|conout\$|(com|lpt)[0-9¹²³])\s*(\..*)?", re.IGNORECASE)
_FORMULA = re.compile(r"'*[=+\-@\t\r]")


def open_regular(path: Path, *, through_links: bool = True) -> int:
    """Open a regular file for reading and return its descriptor.

    Parameters
    ----------
    through_links
        Whether the last part of the path may be a symbolic link.

    Raises
    ------
    OSError
        It does not exist, may not be read, or is not a regular file; or no file can have this name.
    """
    # O_NONBLOCK is for FIFOs and devices; it has no effect on a regular file.
    flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY | (0 if through_links else os.O_NOFOLLOW)
    try:
        descriptor = os.open(path, flags)
    except ValueError as error:  # a NUL, or an invalid character
        raise OSError(errno.EINVAL, "no file can have this name", str(path)) from error
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISREG(mode):
        return descriptor
    os.close(descriptor)
    if stat.S_ISDIR(mode):
        raise OSError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    raise OSError(errno.EINVAL, "it is no regular file", str(path))


def read_regular(path: Path, *, limit_bytes: int, through_links: bool = True) -> bytes:
    """Read a whole regular file.

    Raises
    ------
    OSError
        As `open_regular`; or it is larger than the limit.
    """
    with os.fdopen(open_regular(path, through_links=through_links), "rb") as file:
        content = file.read(limit_bytes + 1)
    if len(content) > limit_bytes:
        raise OSError(errno.EFBIG, f"it is larger than {limit_bytes // 2**20} MiB", str(path))
    return content


def read_beside(folder: Path, name: str, *, limit_bytes: int = MAX_READ_BYTES) -> bytes:
    """Read a file named by another one in this folder: only a regular file in the folder or below.

    Raises
    ------
    OSError
        As `read_regular`, with a reason that continues "cannot be read: "; or the name leads out of the folder.
    """
    return _read_in((folder,), name, limit_bytes)


def read_named_in(file: Path, name: str, *, limit_bytes: int = MAX_READ_BYTES) -> bytes:
    """Read a file named in `file`: beside it as `read_beside`; if `file` is a link, also beside its target.

    Raises
    ------
    OSError
        As `read_beside`.
    """
    folders = file.parent, Path(os.path.realpath(file)).parent
    return _read_in(folders if os.path.lexists(file.parent / name) else folders[::-1], name, limit_bytes)


def _read_in(folders: Sequence[Path], name: str, limit_bytes: int) -> bytes:
    """Read a file from the first of these folders, where a link may lead into any of them."""
    if leads_out(name):
        raise PermissionError(errno.EPERM, "it must lie in the same folder or below; move it there")
    path = Path(os.path.realpath(folders[0] / name))
    if not any(path.is_relative_to(os.path.realpath(folder)) for folder in folders):
        raise PermissionError(errno.EPERM, "it is a link out of the folder; put the file itself there")
    return read_regular(path, limit_bytes=limit_bytes, through_links=False)


def leads_out(name: str) -> bool:
    """Whether a name is not a path to a file in its own folder or below."""
    path = PurePosixPath(name)
    return not path.name or path.is_absolute() or ".." in path.parts or "\\" in name or not name.isprintable()


def regular_names(directory: Path) -> list[str]:
    """List the names of regular files in a directory, without links, sorted.

    Raises
    ------
    OSError
        The directory cannot be listed.
    """
    with os.scandir(directory) as entries:
        return sorted(entry.name for entry in entries if _is_regular(entry))


def _is_regular(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_file(follow_symlinks=False)
    except OSError:  # on a damaged disk a single name may be unreadable
        return False


def file_name(text: str, *, otherwise: str = "flight") -> str:
    """Turn a text into a valid file name for every file system.

    A valid name stays as it is. Any other text is changed and gets eight digits of its SHA-256 appended, so that no two
    become one name.

    Parameters
    ----------
    otherwise
        Used if nothing is left of the text.
    """
    plain = _NOT_IN_NAMES.sub("_", "".join(each if each.isprintable() else "_" for each in text))
    plain = plain.strip(" ").rstrip(". ")
    if plain.startswith((".", "-")) or _DEVICE.fullmatch(plain):
        plain = "_" + plain.lstrip("._-")
    if _cut(plain, MAX_NAME_BYTES) == text:
        return text or otherwise
    return _marked(plain if plain.strip("_") else otherwise, text)


def file_names(texts: Iterable[str]) -> dict[str, str]:
    """Give each text a `file_name` of its own, also on file systems that ignore case."""
    names = {text: file_name(text) for text in texts}
    counts = Counter(map(name_key, names.values()))
    return {text: name if counts[name_key(name)] == 1 else _marked(name, text) for text, name in names.items()}


def name_key(name: str) -> str:
    """Return a key that is equal for names that some file system takes for one."""
    return unicodedata.normalize("NFC", name.casefold())


def _marked(name: str, text: str) -> str:
    mark = sha256(text.encode(errors="surrogatepass")).hexdigest()[:_MARK_DIGITS]
    return f"{_cut(name, MAX_NAME_BYTES - _MARK_DIGITS - 1)}-{mark}"


def _cut(text: str, size_bytes: int) -> str:
    return text.encode()[:size_bytes].decode(errors="ignore")


def printable(text: str) -> str:
    """Escape characters that would control a terminal instead of being shown; a line break too."""
    return text if text.isprintable() else "".join(each if each.isprintable() else _escaped(each) for each in text)


def shown(text: str, *, most: int = MAX_SHOWN_CHARACTERS) -> str:
    """Make a stranger's text a part of a sentence: `printable`, and cut off after so many characters."""
    plain = printable(text[: most + 1])
    return plain if len(plain) <= most else plain[:most] + "..."


def encodable(text: str) -> str:
    """Escape characters that UTF-8 cannot encode, such as undecodable bytes of a file name; keep all others."""
    return text.encode(errors="backslashreplace").decode()


def _escaped(character: str) -> str:
    code = ord(character)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"  # noqa: PLR2004


def say(*lines: str, err: bool = False) -> None:
    """Print lines on the terminal, each of them `printable`; raises ClickException where stdout cannot be written."""
    for line in lines:
        _echo(printable(line), err=err)


def say_json(document: object) -> None:
    """Print a document for a script, all in ASCII; raises as `say`."""
    _echo(json.dumps(document, indent=2).replace("\x7f", "\\u007f"))


def _echo(text: str, *, err: bool = False) -> None:
    try:
        click.echo(text, err=err)
    except OSError as error:
        if err or error.errno == errno.EPIPE:  # a reader such as `head` has seen enough; click ends the program
            raise
        with open(os.devnull, "wb") as nowhere:  # noqa: PTH123 - text still in Python's buffer would fail again at exit
            os.dup2(nowhere.fileno(), sys.stdout.fileno())
        raise click.ClickException(f"stdout cannot be written ({error.strerror}); send it elsewhere.") from error


def to_cell(text: str) -> str:
    """Keep a spreadsheet from taking a text for a formula, by a leading apostrophe."""
    return f"'{text}" if _FORMULA.match(text) else text


def from_cell(cell: str) -> str:
    """Reverse `to_cell`."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell


def read_yaml_file(path: Path) -> bytes:
    """Read the bytes of a YAML file.

    Raises
    ------
    OSError
        It cannot be read, is not a regular file, or is larger than MAX_YAML_BYTES.
    """
    return read_regular(path, limit_bytes=MAX_YAML_BYTES)
