"""[scenes.NAME]: keywords of the builder; or `source = "file.py:Name"` and its keywords; or a table of mesh files.

Scenes are asked and built in a process of their own (`benchharness.study.apart`): a `SceneSpec` is plain data, and so is what
`examined` says of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchharness.render.inside import check_cameras
from benchharness.render.orientation import oriented
from benchharness.scene import Scene, refined
from benchharness.study import document, identity, params, plugins
from benchharness.study.apart import Apart
from benchharness.study.run import MOST_FRAMES, Run, pick_frames


@dataclass(frozen=True)
class SceneSpec:
    """One configuration of a scene, as plain values from which any process can build it.

    label     the name in the table: the section's, with the keywords that the config sweeps over (but for `detail`)
    source    absolute `file.py[:Name]`; None for a discovered scene, and for a table
    table     whether `keywords` is a table of mesh files
    base      folder that paths are relative to
    """

    label: str
    name: str
    source: str | None
    table: bool
    keywords: dict[str, Any]
    base: str
    where: str

    def build(self) -> Scene:
        """The scene, named by its label. Raises ValueError for what the user can mend, a failing builder included."""
        return self.built()[0]

    def built(self) -> tuple[Scene, list[str]]:
        """The same, and sentences about what was mended of its files, or left out."""
        if self.table:
            from benchharness.study import tablescene

            table = tablescene.validated(self.keywords, self.where)
            return tablescene.built(self.label, table, Path(self.base), self.where)
        builder = plugins.given("scene", self.name, self.source, self.where).target
        declared = params.of_builder(builder)
        keywords = {name: declared[name].value(given, f"{self.where}.{name}") for name, given in self.keywords.items()}
        try:
            scene = builder(**keywords)
        except Exception as error:  # whatever a builder may raise
            raise ValueError(f"{self.where}: the scene cannot be built: {plugins.said(error)}") from error
        if not isinstance(scene, Scene):
            raise ValueError(f"{self.where}: the builder returned {type(scene).__name__}; accepted: a Scene")
        return replace(scene, name=self.label), []


def specs(section: Mapping[str, Any], path: Path, apart: Apart) -> Iterator[SceneSpec]:
    """The configurations that the tables [scenes.NAME] ask for. Raises ValueError for what is wrong in them."""
    base = str(path.parent.resolve())
    installed = {name for name, site in plugins.sites("scene").items() if site.offers}
    for name, table in section.items():
        where = f"{path}: [scenes.{name}]"
        if not isinstance(table, dict):
            raise ValueError(f"{where} is {table!r}; accepted: a table of the builder's keywords")
        source = document.source("scene", name, table, path, where)
        named = where if source is None else f"{where}.source"
        given = {key: value for key, value in table.items() if key != "source"}
        params.check_plain(given, where)
        if source is None and name not in installed and {"objects", "reflectors", "camera"} & set(table):
            yield SceneSpec(name, name, None, table=True, keywords=table, base=base, where=where)
            continue
        if source is None and name not in installed:
            raise ValueError(f"{named}: {plugins.unknown(name, installed)}")
        asked = {"name": name, "source": source, "fields": given, "where": where, "named": named}
        said = apart.call("benchharness.study.loading:scene", where, **asked)
        for point, label in zip(said["points"], said["labels"], strict=True):
            yield SceneSpec(label, name, source, table=False, keywords=point, base=base, where=where)


def examined(spec: dict[str, Any], run: dict[str, Any], path: str) -> dict[str, Any]:
    """Builds a scene in this process. Returns what a `Job` holds of it. Raises ValueError where it cannot be rendered."""
    asked, where = SceneSpec(**spec), spec["where"]
    scene, said = asked.built()
    _check_counts(scene, where)
    _check_light(scene, where)
    try:
        scene, notes = oriented(scene)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
    frames, images = _frames(Run(**run), scene, asked.label, path)
    check_cameras(scene, frames, where)
    try:
        drawn = refined(scene)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
    facts = {
        "scene": asked.label,
        "detail": scene.detail,
        "vertices": drawn.vertices,
        "triangles": drawn.triangles,
        "reflectors": len(scene.reflectors),
        "ppd": scene.ppd,
        "scene_hash": identity.of_scene(scene),
    }
    remarkable = [*said, *(str(note) for note in notes if note.remarkable)]
    return {"frames": frames, "images": images, "facts": facts, "notes": remarkable}


def _frames(run: Run, scene: Scene, label: str, path: str) -> tuple[list[int], list[int]]:
    """The frames to render, and those whose pictures are kept. Raises ValueError for one that there is not."""
    frames = pick_frames(run.frames, scene.frames, f"{path}: [run].frames, for scene {label},")
    if run.images is None:
        return frames, frames
    strange = sorted({*run.images} - {*frames})
    if strange:
        shown = f"{frames}" if len(frames) < 20 else f"the {len(frames)} frames of the run"
        raise ValueError(f"{path}: [run].images asks for frame {strange[0]}; accepted: of {shown}")
    return frames, sorted({*run.images})


def _check_counts(scene: Scene, where: str) -> None:
    """Raises ValueError for a scene without frames, objects or mirrors, or with too many frames."""
    counts = {"frames": scene.frames, "objects": len(scene.objects), "reflectors": len(scene.reflectors)}
    for name, count in counts.items():
        if count < 1:
            raise ValueError(f"{where}: the scene has {count} {name}; accepted: at least one")
    if scene.frames > MOST_FRAMES:
        raise ValueError(f"{where}: the scene has {scene.frames:,} frames; accepted: at most {MOST_FRAMES:,}")


def _check_light(scene: Scene, where: str) -> None:
    """Raises ValueError for a scene in which nothing shines: whatever a mirror shows there is black, and right."""
    given = any(part.mesh.radiance is not None and part.mesh.radiance.any() for part in scene.objects)
    emits = any(np.any(part.mesh.emission) for part in scene.objects)
    around = np.any(scene.background) or (scene.environment is not None and scene.environment.radiance.any())
    if not (given or emits or around or any(any(light.intensity) for light in scene.lights)):
        raise ValueError(
            f"{where}: nothing shines; accepted: an object with emission, a background, an environment or a light "
            "that is not black"
        )
