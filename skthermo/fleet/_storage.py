"""What is known of each bridge, in memory or in a folder."""

from __future__ import annotations

import pickle
import re
import zlib
from collections.abc import Hashable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

from skthermo._io import alone_with, write_when_complete
from skthermo.fleet._bridge import BridgeOutcome, Failure, pickled, unpickled
from skthermo.monitoring import Monitor

ENDING, REPLACED = ".bridge", ".replaced"
LONGEST = 40  # letters of a name that its file shows
SECONDS_TO_WAIT = 60.0  # for another process that works on the same folder


@dataclass
class Storage:
    """Outcomes by name, at hand; fitted objects as bytes in a folder or in memory, or monitors read elsewhere."""

    folder: Path | None = None
    outcomes: dict[Hashable, BridgeOutcome] = field(default_factory=dict)
    in_memory: dict[Hashable, bytes] = field(default_factory=dict)
    elsewhere: Mapping[Hashable, Monitor] = field(default_factory=dict)

    def read(self) -> None:
        """Read what the folder holds; a file that cannot be read is a bridge that is not fitted."""
        if self.folder is None:
            return
        for file in sorted(self.folder.glob(f"*{ENDING}")):
            try:
                outcome = _content(file)[0]
            except Exception as error:  # damaged files raise errors of every type
                outcome = BridgeOutcome(file.stem, failures=(Failure.of("reading its file", error),))
            self.outcomes[outcome.name] = outcome

    def put(self, outcome: BridgeOutcome, fitted: bytes | None) -> None:
        """Keep what is known of a bridge; without bytes, its fitted objects stay what they are."""
        if fitted is None:
            fitted = self.fitted(outcome.name) if outcome.is_fitted else b""
        if self.folder is None:
            self.in_memory[outcome.name] = fitted
        else:
            write_when_complete(self._file(outcome.name), zlib.compress(pickle.dumps((outcome, fitted)), level=0))
        self.outcomes[outcome.name] = outcome

    def set_aside(self, name: Hashable) -> None:
        """Keep a bridge as it was beside what follows it; nothing reads that again."""
        if self.folder is not None:
            self._file(name).replace(self._file(name).with_suffix(REPLACED))

    def fitted(self, name: Hashable) -> bytes:
        """Fitted objects of a bridge as bytes."""
        if self.folder is not None:
            return _content(self._file(name))[1]
        return self.in_memory[name] if name in self.in_memory else pickled(self.objects(name))

    def objects(self, name: Hashable) -> tuple[Any, Monitor | None]:
        """The fitted estimator of a bridge, None elsewhere, and its monitor."""
        if self.folder is None and name not in self.in_memory:
            return None, self.elsewhere[name]
        return unpickled(self.fitted(name))

    def estimator(self, name: Hashable) -> Any:
        return self.objects(name)[0]

    def monitor(self, name: Hashable) -> Any:
        return self.objects(name)[1]

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Be the only process that works on the folder; what killed processes left half written is removed."""
        if self.folder is None:
            yield
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        with alone_with(self.folder / "fleet", SECONDS_TO_WAIT):
            for left in self.folder.glob(f".*{ENDING}.*"):
                left.unlink(missing_ok=True)
            yield

    def _file(self, name: Hashable) -> Path:
        """The file of a bridge, whose name may hold any letters."""
        assert self.folder is not None
        shown = re.sub(r"[^\w-]+", "_", str(name))[:LONGEST]
        return self.folder / f"{shown}-{sha256(repr(name).encode()).hexdigest()[:10]}{ENDING}"


def _content(file: Path) -> tuple[BridgeOutcome, bytes]:
    """What `Storage.put` wrote, with a checksum."""
    outcome, fitted = pickle.loads(zlib.decompress(file.read_bytes()))
    return outcome, fitted
