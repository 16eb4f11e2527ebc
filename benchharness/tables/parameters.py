"""Parameters and counters as text, `name=value; name=value`, and back."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any


def params_text(mapping: Mapping[str, Any]) -> str:
    """Parameters as `name=value; name=value`, in the order given; floats by repr, strings plain.

    Raises ValueError for a name or value that would not come back.
    """
    parts = []
    for name, value in mapping.items():
        text = value if isinstance(value, str) else repr(value.item() if hasattr(value, "item") else value)
        if not name.isidentifier() or "; " in text or text != text.strip() or "\n" in text:
            accepted = "an identifier, and a value without '; ', outer blanks or line ends"
            raise ValueError(f"parameter {name!r} = {text!r}; accepted: {accepted}")
        parts.append(f"{name}={text}")
    return "; ".join(parts)


def parse_params(text: str | None) -> dict[str, int | float | bool | str | None]:
    """The inverse of `params_text`; what looks like an int, float, True, False or None becomes one.

    Raises ValueError for a text that is no such list.
    """
    out: dict[str, int | float | bool | str | None] = {}
    for part in (text or "").split("; ") if text else []:
        name, equals, value = part.partition("=")
        if not equals or not name.isidentifier():
            raise ValueError(f"parameters {text!r}: {part!r} is not name=value; accepted: name=value; name=value")
        out[name] = _literal(value)
    return out


def _literal(text: str) -> int | float | bool | str | None:
    if text in ("True", "False", "None"):
        return {"True": True, "False": False, "None": None}[text]
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return text
