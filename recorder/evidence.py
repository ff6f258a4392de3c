"""The key that a configuration signs with."""

from __future__ import annotations

from flight_file.errors import KeyFileError
from flight_file.signature import Signer
from recorder.errors import ConfigurationError
from recorder.settings import EvidenceSettings


def configured_signer(settings: EvidenceSettings) -> Signer | None:
    """Who signs the finished segments; None if nobody shall.

    Raises
    ------
    ConfigurationError
        The key cannot be read, or is none.
    """
    if settings.key is None:
        return None
    # The package behind keys costs memory and start-up time; a box that does not sign shall not pay for it.
    from flight_file.keys import load_signer  # noqa: PLC0415

    try:
        return load_signer(settings.key)
    except KeyFileError as error:
        raise ConfigurationError(f"evidence.key: {error}") from error
