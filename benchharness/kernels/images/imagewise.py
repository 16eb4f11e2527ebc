"""What methods share that meet reflected rays with pictures of the scene: their state, and a frame's answer.

`roles` says which parts of the scene are shown by which pictures, `capture` takes them, `refresh` keeps them true, `assembly`
puts them where rays find them, and `bounces` looks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import pixels
from benchharness.kernels.differentials import FirstHits
from benchharness.kernels.eye import Eye, eye_of
from benchharness.kernels.images import assembly, bounces, capture, refresh
from benchharness.kernels.images.capture import CaptureOptions, DeviceScene
from benchharness.kernels.images.refresh import Captured
from benchharness.kernels.images.roles import Plan
from benchharness.kernels.types import Frame, Reflection, SceneLike


@dataclass
class State:
    """What a method keeps.

    scene      all that does not move
    captured   what was taken of it
    impostors  what rays can meet; None before the first `updated`
    poses      where the parts are since the last `updated`, 12 floats each; None before
    placed     where they are in `impostors`, float64 [parts, 3, 4]; None likewise
    """

    scene: DeviceScene
    captured: Captured
    impostors: bounces.ImpostorScene | None
    poses: mi.Float | None = None
    placed: np.ndarray | None = None


def begun(scene: SceneLike, plan: Plan) -> State:
    """The state that updates start from. Waits for the device."""
    return State(capture.uploaded(scene, plan), refresh.nothing(plan), None)


def updated(state: State, poses: mi.Float, options: CaptureOptions) -> State:
    """The state with every part where `poses` (12 floats per part) puts it. Waits for the device, but where pictures are as
    large as they are seen: these are left to `seen`, which knows the eye."""
    return replace(state, poses=poses) if options.seen else _brought(state, poses, options, None)


def seen(state: State, frame: Frame, options: CaptureOptions) -> State:
    """The state with pictures as large as they are seen in a frame, if they are to be, and every part where the last `updated`
    put it. Waits for the device then."""
    if not options.seen:
        return state
    assert state.poses is not None
    return _brought(state, state.poses, options, eye_of(frame))


def _brought(state: State, poses: mi.Float, options: CaptureOptions, eye: Eye | None) -> State:
    before, host = state.captured, refresh.matrices(poses)
    captured = refresh.refreshed(state.scene, before, poses, host, options, eye)
    same = not captured.renewed and captured.maps is before.maps and (captured.sizes == before.sizes).all()
    if same and state.placed is not None and (state.placed == host).all():
        return replace(state, captured=captured)
    return replace(state, captured=captured, impostors=assembly.assembled(state.scene, captured, host, options), placed=host)


def shown(state: State, frame: Frame, options: bounces.TraceOptions, attenuation: float) -> tuple[Reflection, State]:
    """What all mirrors of a frame show, and the state that the next frame starts from.

    attenuation  share of the light lost per metre of the reflected ray, as exp(-attenuation distance)

    Counters, one number for each of `frame.pixels`: rays against quads; segments or texels of depth maps; 1 where a ray
    reflects twice. Besides, pictures that the last update took, and spans that its depth maps dropped.
    """
    captured, impostors = state.captured, state.impostors
    after = replace(state, captured=replace(captured, renewed=[]))
    counters = _taken(captured)
    if dr.width(frame.pixels) == 0:  # no mirror in view
        empty = dr.zeros(mi.Float, dr.width(frame.active))
        doubt = mi.Bool(False) if options.doubts else None
        return Reflection(mi.Color3f(empty), empty, mi.Bool(frame.active), counters=counters, doubt=doubt), after
    hits = FirstHits(frame.p, frame.n, frame.reflector)
    answer = bounces.reflected(impostors, frame.view, hits, frame.pixels, options)
    L = answer.L * dr.exp(-attenuation * state.scene.unit * answer.distance) if attenuation > 0 else answer.L
    values = [L.x, L.y, L.z, answer.distance, answer.doubt]
    x, y, z, distance, doubt = pixels.spread(values, frame.pixels, frame.view)
    found = mi.Bool(frame.active)
    if any(state.scene.enclosed):
        found &= pixels.spread([answer.found], frame.pixels, frame.view)[0]
    counters |= {"quad_tests": answer.tests, "depth_steps": answer.work, "second_order": mi.UInt32(answer.second)}
    reflection = Reflection(mi.Color3f(x, y, z), distance, found, counters=counters, doubt=doubt if options.doubts else None)
    return reflection, after


def _taken(captured: Captured) -> dict[str, mi.UInt32]:
    """What the last update has taken and dropped, as counters."""
    dropped = captured.rows.dropped_last if captured.rows is not None and captured.renewed else mi.UInt32(0)
    return {"pictures_taken": dr.opaque(mi.UInt32, len(captured.renewed)), "spans_dropped": dropped}
