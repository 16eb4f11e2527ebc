"""Virtual triangles drawn from virtual vertices in closed form."""

from __future__ import annotations

import dataclasses

import drjit as dr
import mitsuba as mi
import numpy as np
from support.mirror_room import smooth, still
from support.small_room import quad
from support.truth_shapes import alhazen, unit

from benchharness.kernels import geometry
from benchharness.kernels.vertices import textures, virtual
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Reflector

WIDTH, HEIGHT = 96, 72
EYE = np.array([0.3, -3.0, 0.4])
CAMERA = still(tuple(EYE), (0.0, 0.0, 0.0), 40.0)
SHEET = Reflector("sheet", quad((-1, 0, -0.8), (2, 0, 0), (0, 0, 1.6)))  # the plane y = 0, seen from -y


def coloured(mesh):
    return dataclasses.replace(mesh, radiance=smooth(5 * mesh.vertices))


def draw(made, moved, kind, at, hidden="cut", depth="perspective", whole=False, behind=False):
    """What mirror 0 shows of `made`: L [P, 3], distance [P], covered [P], and the frame.

    In the frame, the objects hide no mirror unless `whole`.

    moved, at [V, 3], kind [V]     virtual positions, reflection points and kinds of the vertices of the objects
    hidden, depth                  `virtual.Drawing`
    behind                         whether nothing is drawn behind the mirror's nearest back
    """
    frame = FrameRenderer(made if whole else dataclasses.replace(made, objects=()), WIDTH, HEIGHT).render(0)
    lit = [(o.mesh.vertices, o.mesh.radiance, o.mesh.faces) for o in made.objects]
    black = [(r.mesh.vertices, np.zeros_like(r.mesh.vertices), r.mesh.faces) for r in made.reflectors]
    triangles = geometry.upload(lit + black)
    rest = triangles.vertex_count - len(kind)
    packets = np.concatenate([np.column_stack([moved, kind]), np.zeros((rest, 4))]).astype(np.float32)
    points = np.concatenate([np.column_stack([at, np.zeros(len(kind))]), np.zeros((rest, 4))]).astype(np.float32)
    part = dr.opaque(mi.UInt32, len(made.objects))
    window = textures.window(frame.view, frame.boxes[0], 1.0)
    texture = textures.render(frame.proxies[0], frame.poses, dr.opaque(mi.UInt32, 0), window.view)
    back = virtual.nearest_back(frame.proxies[0], frame.poses, dr.opaque(mi.UInt32, 0), frame.view) if behind else None
    images = virtual.Images(mi.Float(packets.ravel()), mi.Float(points.ravel()))
    target = virtual.Target(frame.view, frame.p, frame.reflector == 0, back)
    shown = virtual.nearest(images, triangles, part, target, virtual.Drawing(hidden, depth), texture)
    drawn = virtual.interpolated(shown, target, depth)
    return np.array(drawn.L).T, np.array(drawn.distance), np.array(drawn.covered), frame


def in_the_plane(V, eye=EYE):
    """(virtual vertices, kinds, reflection points) of V in the plane y = 0: in front is reflected, behind is hidden."""
    image = V * [1, -1, 1]
    R = eye - eye[1] / (image - eye)[:, 1:2] * (image - eye)
    front = V[:, 1] < 0
    return image, np.where(front, virtual.REFLECTED, virtual.HIDDEN), np.where(front[:, None], R, V)


def on_the_sphere(V):
    """(virtual vertices, kinds, reflection points) of V in the unit sphere, by Alhazen."""
    along = V - EYE
    A, B, C = (along**2).sum(1), along @ EYE, EYE @ EYE - 1
    t = (-B - np.sqrt(np.maximum(B**2 - A * C, 0))) / A
    hidden = (B**2 > A * C) & (t < 1) & (t > 0)
    R = np.array([alhazen(EYE, v) for v in V])
    away = np.linalg.norm(R - EYE, axis=1) + np.linalg.norm(V - R, axis=1)
    image = EYE + away[:, None] * unit(R - EYE)
    return (
        np.where(hidden[:, None], 99.0, image),
        np.where(hidden, virtual.HIDDEN, virtual.REFLECTED),
        np.where(hidden[:, None], V, R),
    )
