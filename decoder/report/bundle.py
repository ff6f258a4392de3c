"""The page's style and script in one piece each, and the policy by which a browser lets these run, and nothing else."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterator
from hashlib import sha256
from importlib.resources import files
from importlib.resources.abc import Traversable

PAGE = files("decoder.report") / "page"
SHARED = files("decoder.setup") / "page"
PLOTLY = files("decoder.report") / "vendor" / "plotly-basic.min.js"
STYLES = ("style.css", "parts.css", "print.css")
_IMPORT = re.compile(r'^import \{[^}]*\} from "\./([a-z]+\.js)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:const|class|function|async) )", re.MULTILINE)


def style() -> str:
    """All style sheets."""
    return "\n".join((PAGE / name).read_text(encoding="utf-8") for name in STYLES)


def script() -> str:
    """All modules that `main.js` needs, each after those it imports, in one scope of their own."""
    done: dict[str, str] = {}
    _collect("main.js", done)
    return '"use strict";\n{\n' + "\n".join(done.values()) + "}\n"


def plotly() -> str:
    """plotly.js with its basic kinds of plots, as its makers publish it; `vendor/README.md` says from where."""
    return PLOTLY.read_text(encoding="utf-8")


def security_policy(scripts: Iterator[str]) -> str:
    """The content security policy of a page: these scripts, its own styles and embedded pictures; no network at all."""
    hashes = " ".join(f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'" for text in scripts)
    return (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data:;"
        " base-uri 'none'; form-action 'none'"
    )


def _collect(name: str, done: dict[str, str]) -> None:
    text = _module(name).read_text(encoding="utf-8")
    for needed in _IMPORT.findall(text):
        if needed not in done:
            _collect(needed, done)
    done[name] = _EXPORT.sub("", _IMPORT.sub("", text))


def _module(name: str) -> Traversable:
    own = PAGE / name
    return own if own.is_file() else SHARED / name
