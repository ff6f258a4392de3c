"""Which store an address belongs to."""

from __future__ import annotations

from importlib.util import find_spec

from decoder.errors import StoreError
from decoder.fleet.addresses import is_url
from decoder.fleet.local_store import LocalStore
from decoder.fleet.store import Store

INSTALL = "pip install 'image-flight-recorder[cluster]'"


def store_of(address: str) -> Store:
    """The store that holds an address.

    Raises
    ------
    StoreError
        If there is none of that kind, or what it needs is not installed.
    """
    if not is_url(address):
        return LocalStore()
    if find_spec("fsspec") is None:
        raise StoreError(f"{address}: needs fsspec: {INSTALL}")
    from decoder.fleet.url_store import UrlStore  # noqa: PLC0415 - fsspec is an extra

    return UrlStore.of(address)
