"""Files with one thing wrong."""

from __future__ import annotations

import random


def damaged(data: bytes, rng: random.Random) -> bytes:
    """The bytes with one thing wrong."""
    at, wrong = rng.randrange(len(data)), bytearray(data)
    match rng.randrange(7):
        case 0:
            wrong[at] ^= 1 << rng.randrange(8)
        case 1:
            wrong[at:at] = bytes(rng.randrange(256) for _ in range(rng.randrange(1, 9)))
        case 2:
            del wrong[at : at + rng.randrange(1, 9)]
        case 3:
            del wrong[at:]
        case 4:
            wrong[at : at + 64] = bytes(len(wrong[at : at + 64]))
        case _:
            lines = data.splitlines(keepends=True)
            rng.shuffle(lines)
            wrong = bytearray(b"".join(lines[: rng.randrange(1, len(lines) + 1)] + lines[:1]))
    return bytes(wrong)
