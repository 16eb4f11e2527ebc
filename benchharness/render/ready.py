"""A scene as its author gives it -> as it is drawn: turned, brought near, lit and split."""

from __future__ import annotations

from benchharness.render.bake import bake
from benchharness.render.normalisation import normalised
from benchharness.render.orientation import oriented
from benchharness.scene import Scene, refined


def ready(scene: Scene, bake_spp: int, seed: int = 0) -> Scene:
    """The scene with its fronts where they are seen, around the origin, with radiance on every object, and `h_max` applied.

    Baked with `bake_spp` paths per vertex where an object lacks radiance. Lengths are in `Scene.unit` metres. What is ready
    stays as it is. Raises ValueError for mirrors that cannot be wound.
    """
    return refined(lit(scene, bake_spp, seed))


def lit(scene: Scene, bake_spp: int, seed: int = 0) -> Scene:
    """The same, but for `h_max`, which is left to whoever draws it. Raises ValueError likewise."""
    scene = normalised(oriented(scene)[0])
    has_light = all(part.mesh.radiance is not None for part in scene.objects)
    return scene if has_light else bake(scene, spp=bake_spp, seed=seed)
