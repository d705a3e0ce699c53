"""Where a fleet's results go: a folder, or what a URL of fsspec names."""

from __future__ import annotations

import os
import posixpath
import secrets
from typing import Any

from gpsindy.data.dataset import Path

#: File systems in which a file appears with its last byte and moving is copying.
_WHOLE = {"abfs", "abfss", "adl", "az", "gcs", "gs", "memory", "oci", "oss", "s3", "s3a"}


class Remote:
    """Files below a URL, each written whole. Every worker makes its own connection."""

    __slots__ = ("_fs", "_root", "url")

    def __init__(self, url: str) -> None:
        try:
            from fsspec.core import url_to_fs
        except ImportError as missing:
            raise ImportError(f"{url}: a URL needs the package fsspec: pip install 'gpsindy[fsspec]'") from missing
        self.url = url
        # A listing that was kept hides what other workers wrote.
        self._fs, self._root = url_to_fs(url, use_listings_cache=False)

    def __reduce__(self) -> tuple[type[Remote], tuple[str]]:
        return Remote, (self.url,)

    def _path(self, name: str) -> str:
        return posixpath.join(self._root, name)

    def read(self, name: str) -> bytes | None:
        try:
            return bytes(self._fs.cat_file(self._path(name)))
        except FileNotFoundError:
            return None

    def has(self, name: str) -> bool:
        return bool(self._fs.exists(self._path(name)))

    def write(self, name: str, content: bytes) -> None:
        path = self._path(name)
        protocol = self._fs.protocol
        if _WHOLE.intersection([protocol] if isinstance(protocol, str) else protocol):
            self._fs.pipe_file(path, content)
            return
        folder, last = posixpath.split(path)
        self._fs.makedirs(folder, exist_ok=True)
        part = posixpath.join(folder, f".{last}.{secrets.token_hex(8)}.part")
        self._fs.pipe_file(part, content)
        self._fs.mv(part, path)

    def remove(self, name: str) -> None:
        try:
            self._fs.rm_file(self._path(name))
        except FileNotFoundError:
            pass

    def place(self, name: str) -> str:
        return posixpath.join(self.url, name)


def store(out: Path) -> str | Remote:
    """The folder as an absolute path, or the files below a URL."""
    place = os.fspath(out)
    if place.startswith("file://"):
        from urllib.parse import urlsplit
        from urllib.request import url2pathname

        return os.path.abspath(url2pathname(urlsplit(place).path))
    if "://" in place or "::" in place:
        return Remote(place)
    return os.path.abspath(place)


def where(place: str | Remote) -> Any:
    """The folder or URL as text."""
    return place.url if isinstance(place, Remote) else place
