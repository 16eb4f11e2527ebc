"""The cache: arrays that are expensive to make, filed under a hash of everything they were made from.

An entry is one .npz file, `<folder>/<FORMAT>/<kind>/<key>.npz`: the arrays, and a checksum of their names, types, shapes and
content and of the entry's own kind and key. The folder is the user's cache folder of the platform, or what the environment
variable BENCHHARNESS_CACHE names. An entry is written under a temporary name and then renamed, so that
a crash leaves either the whole entry or none. An entry that cannot be read, or is not what was written, is made again, with
a warning in the log.
Entries never expire: the key changes when anything that matters does, the source code that makes them included.

What takes long is filed in `Parts` while it is made, so that whoever is killed goes on from there. They go when the whole is
filed; those of an entry that is never finished stay, in a folder `<key>.parts`.
"""

from __future__ import annotations

import hashlib
import logging
import os
import shutil
import struct
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import platformdirs

log = logging.getLogger("benchharness")

Arrays = dict[str, np.ndarray]

FORMAT = "2"
"""Of entries. Another one's are not touched, so that two versions can be run beside each other."""
CHECKSUM = "checksum"
"""Name of the array of an entry that is none of those which were filed."""
KEEP_S, KEEP_TIMES = 10.0, 20.0
"""How long an entry that is filed in parts is worked on before they are filed again: seconds, and times as long as filing took,
at least. So much a kill costs at most, beside the part in work."""


def cache_folder() -> Path:
    """Where entries live; not necessarily there yet."""
    named = os.environ.get("BENCHHARNESS_CACHE")
    return (Path(named).expanduser() if named else Path(platformdirs.user_cache_dir("benchharness"))) / FORMAT


def content_hash(*content) -> str:
    """Hex digest of arrays, numbers, strings, bytes, None, and (nested) sequences and dicts of them.

    Types and shapes count: 1, 1.0, True, "1" and [1] differ. Raises TypeError for anything else.
    """
    digest = hashlib.sha256()
    _feed(digest, content)
    return digest.hexdigest()[:40]


def _feed(digest, value) -> None:
    def item(tag: str, data: bytes) -> None:
        digest.update(tag.encode() + struct.pack("<q", len(data)) + data)

    match value:
        case None:
            item("none", b"")
        case bool() | np.bool_():
            item("bool", bytes([bool(value)]))
        case int() | np.integer():
            item("int", str(int(value)).encode())
        case float() | np.floating():
            item("float", struct.pack("<d", float(value)))
        case str():
            item("str", value.encode())
        case bytes():
            item("bytes", value)
        case np.ndarray() if not value.dtype.hasobject:
            item(f"array {value.dtype.str} {value.shape}", np.ascontiguousarray(value).tobytes())
        case tuple() | list():
            item("sequence", struct.pack("<q", len(value)))
            for element in value:
                _feed(digest, element)
        case dict():
            item("dict", struct.pack("<q", len(value)))
            for key in sorted(value):
                _feed(digest, (key, value[key]))
        case _:
            raise TypeError(f"content_hash: cannot hash a {type(value).__name__}; accepted: arrays, numbers, text")


def source_hash(*files: str) -> str:
    """Hash of the text of source files: goes into keys, so that an entry does not outlive the code that made it."""
    return content_hash(*[Path(file).read_bytes() for file in files])


def cached(kind: str, key: str, compute: Callable[[], Arrays]) -> Arrays:
    """The arrays filed under `kind` and `key`; made by `compute` and filed where there are none yet."""
    arrays = _filed(kind, key)
    if arrays is None:
        arrays = compute()
        _file(kind, key, arrays)
    return arrays


def cached_in_parts(kind: str, key: str, compute: Callable[[Parts], Arrays]) -> Arrays:
    """The same of what takes long: `compute` finds the parts that somebody made before it was killed, and files its own."""
    parts = Parts(kind, key)
    arrays = cached(kind, key, lambda: compute(parts))
    if _path(kind, key).exists():
        parts.drop()
    return arrays


class Parts:
    """What is done of an entry that is not finished: arrays by name, each filed as an entry is, so that none is half there.

    A part has to follow from the entry's key and its own name alone, or from what was filed under that name before.
    """

    def __init__(self, kind: str, key: str) -> None:
        self._kind, self._key = kind, f"{key}.parts"
        self._new: dict[str, Arrays] = {}
        self._due, self._writes = time.monotonic() + KEEP_S, True

    def get(self, name: str) -> Arrays | None:
        """A part that was filed; None where there is none, or a damaged one."""
        return _filed(self._kind, f"{self._key}/{name}")

    def put(self, name: str, arrays: Arrays) -> None:
        """Files a part, and those that wait with it, if that is due (KEEP_S); else it waits. One of the same name is replaced.
        Where parts cannot be written that is said once, and no more are."""
        if not self._writes:
            return
        self._new[name] = arrays
        began = time.monotonic()
        if began < self._due:
            return
        self._writes = all(_file(self._kind, f"{self._key}/{each}", new) for each, new in self._new.items())
        self._new.clear()
        ended = time.monotonic()
        self._due = ended + max(KEEP_S, KEEP_TIMES * (ended - began))

    def drop(self) -> None:
        """Deletes what was filed."""
        shutil.rmtree(cache_folder() / self._kind / self._key, ignore_errors=True)


def _path(kind: str, key: str) -> Path:
    return cache_folder() / kind / f"{key}.npz"


def _filed(kind: str, key: str) -> Arrays | None:
    """The arrays of an entry; None where there is none, and for a damaged one, which the log tells of."""
    path = _path(kind, key)
    if not os.path.lexists(path):
        return None
    try:
        return _read(path, kind, key)
    except Exception as error:  # whatever the readers of archives and arrays raise for one that is damaged
        log.warning("cache: cannot read %s (%s: %s); computing it again", path, type(error).__name__, error)
        return None


def _file(kind: str, key: str, arrays: Arrays) -> bool:
    """Files an entry; returns whether it could be written, the log says why not."""
    assert CHECKSUM not in arrays, CHECKSUM
    path = _path(kind, key)
    try:
        _write(path, arrays | {CHECKSUM: _checksum(kind, key, arrays)})
    except OSError as error:
        log.warning("cache: cannot write %s (%s); set BENCHHARNESS_CACHE to a folder that can be written", path, error)
        return False
    return True


def _read(path: Path, kind: str, key: str) -> Arrays:
    """The arrays of an entry. Raises ValueError for what was not written as this entry; readers raise what they like."""
    with path.open("rb") as file:
        entry = np.load(file, allow_pickle=False)
        if not isinstance(entry, np.lib.npyio.NpzFile):
            raise ValueError("it is no archive")
        with entry:
            arrays = {name: entry[name] for name in entry.files}
    checksum = arrays.pop(CHECKSUM, None)
    if checksum is None or not np.array_equal(checksum, _checksum(kind, key, arrays)):
        raise ValueError("its checksum is another one")
    return arrays


def _checksum(kind: str, key: str, arrays: Arrays) -> np.ndarray:
    return np.frombuffer(bytes.fromhex(content_hash(kind, key, arrays)), np.uint8)


def _write(path: Path, arrays: Arrays) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.stem[:8], suffix=".tmp")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, **arrays)  # pyright: ignore[reportArgumentType]
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
