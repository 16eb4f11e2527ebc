"""What a method's answer is judged by: the reference, and the true reflection points of its vertices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from support.mirror_room import EYE, SIZE
from support.small_room import quad

from benchharness.measure import truth
from benchharness.render import reference
from benchharness.scene import Reflector
from scenes.props import bowls


def picture(made, size=SIZE):
    return reference.render(made, 0.0, size)


def reflector_of(answer):
    return np.array(answer.frame.reflector).reshape(answer.active.shape)


def lanes(array):
    """A point array on the host, float64 [N, 3]."""
    return np.array(array, np.float64).T


def truths(answer, made, step=10):
    """Of every tenth converged vertex of a scene that stands still: its lane, and V and its true R (NaN: none known)."""
    vertices, mirror = answer.reflection.vertices, made.reflectors[0]
    lane = np.flatnonzero(np.array(vertices.converged))[::step]
    mesh = mirror.closed or mirror.mesh
    V = np.concatenate([part.mesh.vertices for part in made.parts])[lane]
    R = lanes(vertices.R)[lane]
    points, valid = truth.reflection_points(mesh.vertices, mesh.normals, mesh.faces, np.asarray(made.camera(0.0).eye), V, R)
    return lane, V, truth.nearest(points, valid, R)


def apart_px(one, other, made):
    camera = made.camera(0.0)
    return np.linalg.norm(truth.on_screen(one, camera, *SIZE) - truth.on_screen(other, camera, *SIZE), axis=1)


def off_px(answer, made, step=10):
    """Pixels between the found and the true reflection points of converged vertices."""
    lane, _, true = truths(answer, made, step)
    return apart_px(lanes(answer.reflection.vertices.R)[lane], true, made)


def image_off_px(answer, made):
    """The same of the virtual vertices."""
    lane, V, true = truths(answer, made)
    image = truth.image_of(V, true, np.asarray(made.camera(0.0).eye))
    return apart_px(lanes(answer.reflection.vertices.virtual)[lane], image, made)


def clearances(V, eye=EYE, radius=0.5):
    """How far from a ball about the origin the segments from the eye to V [N, 3] pass; negative: through it."""
    along, eye = V - eye, np.asarray(eye)
    t = np.clip(-(along @ eye) / (along**2).sum(1), 0, 1)
    return np.linalg.norm(eye + t[:, None] * along, axis=1) - radius


def tilted_sheet(size: float = 1.0) -> Reflector:
    """A plane mirror of two triangles, none of whose corners lies on a covered texel."""
    return Reflector("sheet", quad((-0.52 * size, 0, -0.47 * size), (1.01 * size, 0.2 * size, 0.03 * size),
                                   (0.02 * size, 0.1 * size, 0.93 * size)))  # fmt: skip


def hollow(name):
    """A bowl that is looked into, or the outer band of a ring; ideal mirrors, with their closed stand-ins."""
    made = {"concave": bowls.concave_bowl((0, 0, -0.26), EYE), "torus": bowls.torus_bowl((0, 0, 0))}[name]
    return replace(made, eta=None, k=None)
