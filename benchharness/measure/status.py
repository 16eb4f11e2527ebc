"""The status of a row: what of a record may be relied on, and why not."""

from __future__ import annotations

from benchharness.measure.entry import Entry

MOSTLY = 0.5  # of the mirrors' pixels
OTHER_MASK = 0.02  # share of the mirrors' pixels that may be a mirror's in one of frame and reference alone, and
OTHER_MASK_PX = 32  # as many always may: edges run through pixels' centres


def crashed(entry: Entry) -> dict:
    return {"status": "crashed", "reason": entry.broken}


def sound(measured: dict, kept: str | None) -> dict:
    """The record with its status: "invalid" for a picture that is none, or whose time is not the time of making it."""
    if measured["nonfinite_px"]:
        kept = f"{measured['nonfinite_px']} pixels are NaN, infinite or negative"
    return {"status": "ok", **measured} if kept is None else {"status": "invalid", "reason": kept, **measured}


def trusted(record: dict) -> dict:
    """The record, its status "invalid" where its errors are against nothing that a method could be judged by."""
    if record["status"] != "ok":
        return record
    shown, union = record["reference_px"], max(record["reflector_px"], record["reference_px"])
    reason = None
    if record["mask_diff_px"] > OTHER_MASK_PX + OTHER_MASK * union:
        both = f"frame ({record['reflector_px']}) and reference ({shown})"
        reason = f"{record['mask_diff_px']} pixels are a mirror's in only one of {both}"
    elif record["dark_px"] > MOSTLY * shown:
        reason = f"the reference is black in {record['dark_px']} of the mirrors' {shown} pixels"
    elif record["back_px"] > MOSTLY * shown:
        reason = f"{record['back_px']} of the mirrors' {shown} pixels show backs of objects, which have no light of their own"
    return record if reason is None else record | {"status": "invalid", "reason": reason}
