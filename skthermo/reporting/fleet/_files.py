"""Files of the pages of single bridges."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Hashable, Iterable
from hashlib import sha256
from pathlib import Path
from urllib.parse import quote

LONGEST = 60  # letters of a file's name
RESERVED = re.compile(r"(?i)(con|prn|aux|nul|com\d|lpt\d)$")  # no names of files on Windows


def folder_of(file: Path) -> Path:
    """Where the pages of single bridges are, beside the page of all."""
    return file.with_name(f"{file.stem}_pages")


def page_names(bridges: Iterable[Hashable]) -> dict[Hashable, str]:
    """A file name for each bridge, of plain letters: no two are equal, in capitals or not."""
    plain = {bridge: _plain(str(bridge)) for bridge in bridges}
    shared = Counter(name.casefold() for name in plain.values())
    names = {
        bridge: name if shared[name.casefold()] == 1 else f"{name}-{_digest(bridge)}" for bridge, name in plain.items()
    }
    taken: dict[str, Hashable] = {}
    for bridge, name in names.items():
        number, free = 2, name
        while free.casefold() in taken:
            number, free = number + 1, f"{name}-{number}"
        taken[free.casefold()], names[bridge] = bridge, free
    return {bridge: f"{name}.html" for bridge, name in names.items()}


def link(*parts: str) -> str:
    """A relative address of a file."""
    return "/".join(quote(part) for part in parts)


def _plain(name: str) -> str:
    letters = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    text = re.sub(r"[^A-Za-z0-9]+", "_", letters).strip("_")[:LONGEST].rstrip("_")
    return f"bridge_{text}".rstrip("_") if not text or RESERVED.match(text) else text


def _digest(bridge: Hashable) -> str:
    return sha256(repr(bridge).encode("utf-8", "backslashreplace")).hexdigest()[:8]
