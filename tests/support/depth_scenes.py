"""Scenes that depth maps as impostors are tested on: balls, fields of hills and combs before mirrors, light given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from support.mirror_room import ball, mirror_ball, plain, scene, smooth, still, walls
from support.small_room import box, quad, sphere

from benchharness.scene import Mesh, Object, Reflector, Scene, merged
from scenes import bunnies
from scenes.props import creature
from scenes.props.shapes import placed

RED, GREEN, GREY = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.25, 0.25, 0.25)


def thing(mesh: Mesh, name: str = "thing", **more) -> Object:
    return Object(name, mesh, "something to reflect", **more)


def view(eye=(0.0, 0.0, 4.0), target=(0.0, 0.0, 0.0), fov_deg=32.0, up=(0.0, 1.0, 0.0)):
    made = still(eye, target, fov_deg)(0.0)
    made = type(made)(made.eye, made.target, made.fov_deg, up)
    return lambda time: made


def before_grey(objects, reflectors, camera=None, **more) -> Scene:
    return scene(objects, reflectors, camera or view(), background=GREY, **more)


def touching(radius: float = 0.3, polar_deg: float = 50.0) -> Scene:
    """A red ball that touches a mirror ball of radius 1 at an angle from the eye's axis."""
    angle = np.radians(polar_deg)
    centre = (1 + radius) * np.array([np.sin(angle), 0.0, np.cos(angle)])
    return before_grey([thing(ball(radius, centre, RED, 4))], [mirror_ball("mirror", radius=1.0, fine=192)])


def hills(half: float = 1.0, height: float = 0.15, cells: int = 120) -> Mesh:
    """A smooth field of hills over the square of +-half in x and z, towards +y; colours as smooth."""
    x, z = np.meshgrid(*[np.linspace(-half, half, cells + 1)] * 2, indexing="ij")
    y = height * np.cos(3.1 * x + 0.4) * np.cos(2.3 * z - 0.2)
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(cells), np.arange(cells), indexing="ij"))
    a = i * (cells + 1) + j
    b, c, d = a + cells + 1, a + cells + 2, a + 1
    faces = np.concatenate([np.stack([a, d, c], 1), np.stack([a, c, b], 1)])
    return Mesh(points, faces, radiance=smooth(2 * points))


def field_before_mirror() -> Scene:
    """A mirror ball some way off a field of hills, which fills most of what it shows; the eye looks over the field."""
    mirror = mirror_ball("mirror", (0.0, 0.0, 0.0), 0.5, fine=192)
    field = hills().transformed(moved(0.0, -1.6, 0.0))
    return scene([thing(field)], [mirror], view((0.0, -1.2, 1.6), fov_deg=36.0), background=GREY)


def moved(x: float, y: float, z: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def sheet(half: float = 2.0, normal=(0.0, 0.0, 1.0), name: str = "mirror") -> Reflector:
    """A square plane mirror about the origin."""
    k = np.asarray(normal, float) / np.linalg.norm(normal)
    u = np.cross((0.0, 1.0, 0.0), k)
    u /= np.linalg.norm(u)
    v = np.cross(k, u)
    return Reflector(name, quad(-half * (u + v), 2 * half * u, 2 * half * v))


def red_backed_ball() -> Scene:
    """A ball near a plane mirror, towards its right end: green where it faces the mirror's middle, red on the other side,
    which is what the mirror shows to an eye on the right."""
    made = ball(0.3, (0, 0, 0), GREEN, 4)
    made = Mesh(made.vertices, made.faces, radiance=np.where(made.vertices[:, :1] > 0.0, RED, GREEN))
    camera = view((3.0, 0.3, 2.5), (1.5, 0.0, 0.0))
    return before_grey([thing(made.transformed(moved(1.2, 0.0, 0.4)))], [sheet()], camera)


def mirrors_on_both_sides() -> Scene:
    """A ball between two mirror balls that are one mirror: its middle is in the larger, on the left."""
    one, other = sphere(1.0, (-1.6, 0, 0), slices=96, stacks=48), sphere(0.35, (1.1, 0, 0), slices=96, stacks=48)
    return before_grey([thing(ball(0.25, (0.2, 0.0, 0.0), RED, 4))], [Reflector("mirror", merged(one, other))], view((0, 0, 6)))


def ball_before_plate() -> Scene:
    """A red ball half a metre before a green plate, one object, shown by a mirror ball to an eye on the right."""
    made = merged(ball(0.2, (0.0, 0.0, 1.5), RED, 4), plain(box((-0.8, -0.8, 2.2), (0.8, 0.8, 2.25)), GREEN))
    return before_grey([thing(made)], [mirror_ball("mirror", radius=1.0, fine=192)], view((3.0, 0.0, 1.6), fov_deg=36.0))


def off_axis(radius: float, away: float) -> Scene:
    """A red ball straight above a mirror ball of radius 1, `away` metres from its middle."""
    return before_grey([thing(ball(radius, (0.0, away, 0.0), RED, 4))], [mirror_ball("mirror", radius=1.0, fine=192)])


def along_the_axis() -> Scene:
    """A plane mirror at 45 degrees: the middle pixel's ray leaves from its middle to that of a red ball."""
    camera = view((3.0, 0.0, 0.0), fov_deg=30.0)
    return before_grey([thing(ball(0.3, (0.0, 0.0, 3.0), RED, 4))], [sheet(1.0, (1.0, 0.0, 1.0))], camera)


def comb(teeth: int = 24) -> Mesh:
    """Upright bars 1 cm wide and 4 cm apart, in the plane y = 0."""
    bars = []
    for k in range(teeth):
        x = 0.04 * (k - 0.5 * (teeth - 1))
        bars.append(box((x - 0.005, -0.02, -0.4), (x + 0.005, 0.02, 0.4)))
    return plain(merged(*bars), GREEN)


def before_a_comb() -> Scene:
    """A mirror ball between the teeth of a comb and the eye; more teeth side by side than rows of few points have spans."""
    comb_ = thing(comb().transformed(moved(0.0, -1.4, 0.0)))
    return before_grey([comb_], [mirror_ball("mirror", radius=0.5, fine=192)], view((0.0, -0.6, 3.0), (0.0, -0.3, 0.0), 14.0))


def egg(middle=(1.0, 0.0, 1.0)) -> Scene:
    """A convex body, of smooth colours, beside a mirror ball."""
    points = ball(0.4, (0, 0, 0), GREY, 4)
    v = points.vertices * [1.3, 0.8, 1.0]
    body = Mesh(v + middle, points.faces, radiance=smooth(3 * v))
    mirror = mirror_ball("mirror", radius=1.0, fine=192)
    return before_grey([thing(body)], [mirror], view((-1.0, 0.0, 3.8), (0.5, 0.0, 0.5), fov_deg=16.0))


def halves(motion, mirror_motion=None) -> Scene:
    """An egg, half red and half green, and a mirror ball, both of which may move; a frame a second."""
    made = ball(0.3, (0, 0, 0), GREEN, 4)
    made = Mesh(made.vertices * [1.5, 0.8, 0.8], made.faces, radiance=np.where(made.vertices[:, :1] > 0, RED, GREEN))
    mirror = mirror_ball("mirror", radius=1.0, fine=192, motion=mirror_motion)
    return before_grey([thing(made, motion=motion)], [mirror], frames=4, fps=1.0)


def turned(degrees: float, shift=(0.0, 0.0, 0.0)) -> np.ndarray:
    """About the y axis, then shifted."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    pose = np.eye(4)
    pose[:3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    pose[:3, 3] = shift
    return pose


def in_a_room(*reflectors: Reflector, balls_at=((0.0, -0.9, 0.55), (0.0, 0.1, 0.85)), **more) -> Scene:
    """Mirrors in a room of smooth colours, with a red and a green ball."""
    colours = (("red", RED), ("green", GREEN))
    things = [thing(ball(0.15, at, c, 4), name) for at, (name, c) in zip(balls_at, colours, strict=True)]
    camera = more.pop("camera", view((0.0, -2.2, 0.5), fov_deg=40.0, up=(0.0, 0.0, 1.0)))
    return scene((walls(4.0), *things), reflectors, camera, **more)


def two_in_one() -> Scene:
    """Two mirror balls that are one mirror."""
    one, other = (sphere(0.5, (x, 0, 0), slices=128, stacks=64) for x in (-0.6, 0.6))
    return in_a_room(Reflector("mirror", merged(one, other)))


def pair() -> Scene:
    """Two mirror balls close together, and two balls before them."""
    left, right = mirror_ball("left", (-0.45, 0, 0), 0.4, 128), mirror_ball("right", (0.45, 0.1, 0), 0.4, 128)
    return in_a_room(left, right, balls_at=((0.3, -0.75, 0.1), (-0.3, -0.6, 0.4)))


def hares(cell: float = 0.012) -> Scene:
    """The two bunnies of `scenes.bunnies`, which intersect, coarser, of smooth colours, on a floor."""
    furry = placed(creature.hare(cell), scale=bunnies.SCALE).transformed(bunnies.Walk()(0.0))
    mirror = placed(creature.body(cell), turn_deg=bunnies.MIRROR_DEG)
    things = [(furry, "furry"), (bunnies.floor(6), "floor")]
    objects = [thing(replace(mesh, radiance=smooth(mesh.vertices, 0.1)), name) for mesh, name in things]
    return scene(objects, [Reflector("mirror", mirror)], bunnies.CAMERA, background=GREY)
