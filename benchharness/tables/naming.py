"""Names of files that say what is in them: pictures by scene, frame and method, whatever those are called."""

from __future__ import annotations

import hashlib
import json
import re
from typing import Any


def image_name(scene: str, detail: str, frame: int, kind: str, method: str | None = None, params: str | None = None) -> str:
    """File name of a picture in `images/`.

    kind   "reference", "image" (a method's picture) or "error" (its FLIP map); PNG, the sRGB picture as it is looked
           at. An error map is either coloured already or one channel, where 0 .. 255 is FLIP 0 .. 1.
    params hashed to 8 hex digits when present. Names that are not safe in a file system get a hash of their own.
    """
    if kind not in ("reference", "image", "error"):
        raise ValueError(f"image kind {kind!r}; accepted: 'reference', 'image', 'error'")
    if (kind == "reference") != (method is None):
        raise ValueError(f"image kind {kind!r} with method {method!r}; accepted: a method for all but the reference")
    parts = [safe_name(scene), safe_name(detail), f"{frame:04d}", kind]
    if method is not None:
        parts.append(safe_name(method))
    if params:
        parts.append(hashlib.sha256(params.encode()).hexdigest()[:8])
    return "-".join(parts) + ".png"


def picture_name(regime: str, severity: float, label: str) -> str:
    """Name of a picture of the stability suite."""
    return safe_name(f"{regime}-{severity:g}-{label}") + ".png"


def safe_name(text: str) -> str:
    """`text` if it is safe as part of a file name, else its safe letters and a hash, so that no two collide."""
    if re.fullmatch(r"[A-Za-z0-9_]{1,64}", text):
        return text
    return re.sub(r"[^A-Za-z0-9_]+", "_", text)[:48].strip("_") + "_" + hashlib.sha256(text.encode()).hexdigest()[:8]


def short_hash(value: Any) -> str:
    """12 hex digits of a JSON value's content, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, ensure_ascii=False).encode()).hexdigest()[:12]
