"""A study: TOML -> validated config -> list of jobs, one per configuration of a scene.

    [run]              how to run: variant, size, frames, rounds (see `Run`)
    [scenes.NAME]      keywords of the builder; or `source = "file.py:Name"` and its keywords; or a table of mesh files
    [reference]        what errors are measured against (see `reference.ReferenceOptions`)
    [methods.NAME]     fields of the method, optional `source`; [[methods.NAME]] are several sweeps of one method

A list sweeps: every combination is a row of its own. Whatever is wrong is a ValueError that names file, key, value and
what would be accepted, before any work is done. Methods and scenes are asked in a process of their own
(`benchharness.study.loading`, through `benchharness.study.apart`): what is here of them is what they said, as plain data.
"""

from __future__ import annotations

import math
import time
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from benchharness.render.inside import check_cameras
from benchharness.render.orientation import oriented
from benchharness.scene import Scene, refined
from benchharness.study import identity, params, plugins
from benchharness.study.apart import Apart

if TYPE_CHECKING:
    from benchharness.api import Method

SECTIONS = ("run", "scenes", "reference", "methods")

MOST_FRAMES = 100_000
"""Of an animation: over an hour at 25 per second. All of it is hashed."""
MOST_PIXELS = 1 << 25
"""Of a picture: 8K. A frame keeps some hundred bytes per pixel."""
MOST_SCENES = 256
"""Configurations of scenes in a study; each is built before the first is rendered."""
DEPTH = 16
"""Tables and arrays within each other in a TOML file; none of ours has more than 5."""
SAID_EVERY_S = 5.0

Frames = Annotated[int, Field(ge=1, le=MOST_FRAMES)]
Rounds = Annotated[int, Field(ge=1, le=10_000)]
Index = Annotated[int, Field(ge=0, lt=MOST_FRAMES)]
Seed = Annotated[int, Field(ge=0, lt=1 << 32)]
Pixels = Annotated[int, Field(ge=1, le=16384)]
Timeout = Annotated[float, Field(gt=0, le=86400)]


@dataclass(frozen=True)
class Run:
    """[run].

    size        width, height in pixels
    frames      that many, evenly over the animation with its first and last; or a list of frames; 3 or all if fewer
    min_rounds  timed rounds at least, and
    max_rounds  at most, until the median is known well enough
    images      frames whose pictures are kept; all if not given
    timeout_s   seconds that a frame may take with all its methods, and the scene's preparation
    """

    variant: Literal["llvm_ad_rgb", "cuda_ad_rgb"] = "llvm_ad_rgb"
    size: tuple[Pixels, Pixels] = (720, 512)
    frames: Frames | Annotated[list[Index], Field(min_length=1)] | None = None
    min_rounds: Rounds = 5
    max_rounds: Rounds = 40
    images: list[Index] | None = None
    seed: Seed = 0
    timeout_s: Timeout = 600.0


@dataclass(frozen=True)
class Entry:
    """One method with one set of parameters: what a row of the table is about.

    method       the name in the table
    source       absolute `file.py` or `file.py:Name`; None for a discovered method
    params       every field of the method -> value
    changed      those of them that are not the defaults
    method_hash  of its source, see `identity.of_method`
    """

    method: str
    source: str | None
    params: dict[str, Any]
    changed: list[str] = field(default_factory=list)
    method_hash: str = ""

    @property
    def params_text(self) -> str:
        """The column `params`."""
        return params.canonical(self.params)

    @property
    def key(self) -> str:
        """Method and parameters in one line; unique within a run."""
        return f"{self.method} {self.params_text}".strip()

    def build(self) -> Method:
        """The method, imported and built in this process. Raises ValueError where it cannot be, and what its own
        `__post_init__` raises."""
        cls = plugins.given("method", self.method, self.source, self.method).target
        declared = params.of_method(cls)
        return cls(**{name: declared[name].value(given, f"{self.method}.{name}") for name, given in self.params.items()})


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
        if self.table:
            from benchharness.study import tablescene

            table = tablescene.validated(self.keywords, self.where)
            return tablescene.build(self.label, table, Path(self.base), self.where)
        builder = plugins.given("scene", self.name, self.source, self.where).target
        declared = params.of_builder(builder)
        keywords = {name: declared[name].value(given, f"{self.where}.{name}") for name, given in self.keywords.items()}
        try:
            scene = builder(**keywords)
        except Exception as error:  # whatever a builder may raise
            raise ValueError(f"{self.where}: the scene cannot be built: {plugins.said(error)}") from error
        if not isinstance(scene, Scene):
            raise ValueError(f"{self.where}: the builder returned {type(scene).__name__}; accepted: a Scene")
        return replace(scene, name=self.label)


@dataclass(frozen=True)
class Job:
    """All frames and all methods of one configuration of a scene.

    frames  ascending
    images  those of them whose pictures are kept
    facts   columns of the table that the scene alone determines
    notes   sentences about what was wrong with the scene, and mended
    """

    scene: SceneSpec
    frames: list[int]
    images: list[int]
    facts: dict[str, Any]
    entries: list[Entry]
    notes: list[str]


@dataclass(frozen=True)
class Config:
    """A validated study. `reference`: the fields of `reference.ReferenceOptions`. `method_hashes` is by `Entry.key`."""

    name: str
    path: Path
    run: Run
    reference: dict[str, Any]
    jobs: list[Job]
    entries: list[Entry]
    config_hash: str
    method_hashes: dict[str, str] = field(default_factory=dict)


def load(
    path: Path, extra: Sequence[str] = (), only: Sequence[str] = (), tell: Callable[[str], None] = lambda text: None
) -> Config:
    """Reads and validates a config.

    extra  methods to add with their default parameters: `file.py` or `file.py:Name`, relative to the working folder
    only   names of the methods to keep; all if empty
    tell   hears how far it is, where that takes long

    Raises ValueError for what is wrong in the config, platform.EnvironmentBroken where the variant cannot be used.
    """
    document = read(path)
    run = _run(document.get("run", {}), f"{path}: [run]")
    section, extra = _only(document.get("methods", {}), extra, only)
    with Apart(run.variant) as apart:
        where, asked = f"{path}: [reference]", document.get("reference", {})
        params.check_plain(asked, where)
        reference = apart.call("benchharness.study.loading:reference", where, table=asked, where=where)
        given = distinct([*entries(section, path, apart), *(plugged_in(spec, apart) for spec in extra)])
        if not given:
            raise ValueError(f"{path}: there is no method to run; accepted: at least one [methods.NAME] or --plugin FILE")
        if len(given) > params.MOST_POINTS:
            most = f"{params.MOST_POINTS:,}"
            raise ValueError(f"{path}: there are {len(given):,} methods with parameters; accepted: at most {most}")
        specs = list(_scenes(document.get("scenes", {}), path, apart))
        if len(specs) > MOST_SCENES:
            raise ValueError(f"{path}: there are {len(specs):,} configurations of scenes; accepted: at most {MOST_SCENES}")
        jobs = [_job(spec, run, given, path, apart) for spec in _slowly(specs, tell)]
    if not jobs:
        raise ValueError(f"{path}: there is no scene; accepted: at least one [scenes.NAME]")
    places = Counter((job.facts["scene"], job.facts["detail"]) for job in jobs)
    for place, count in places.items():
        if count > 1:
            raise ValueError(
                f"{path}: two configurations are called scene {place[0]!r}, detail {place[1]!r}; accepted: a builder "
                "that hands its `detail` on to the Scene"
            )
    determines = {k: v for k, v in asdict(run).items() if k in ("variant", "size", "frames", "seed")}
    config_hash = identity.of_options({"run": determines, "reference": reference})
    method_hashes = {entry.key: entry.method_hash for entry in given}
    return Config(path.stem, path.resolve(), run, reference, jobs, given, config_hash, method_hashes)


def _slowly(specs: Sequence[SceneSpec], tell: Callable[[str], None]) -> Iterator[SceneSpec]:
    """The scenes, with a word about how many are built every SAID_EVERY_S."""
    said = time.monotonic()
    for number, spec in enumerate(specs):
        if time.monotonic() - said > SAID_EVERY_S:
            tell(f"scene {spec.label}: building {number + 1} of {len(specs)}")
            said = time.monotonic()
        yield spec


def read(path: Path, sections: Sequence[str] = SECTIONS) -> dict[str, Any]:
    """The TOML document. Raises ValueError for what is no file, no TOML, has unknown sections, or numbers without bounds."""
    if not path.is_file():
        near = plugins.close(path.name, [p.name for p in path.parent.glob("*.toml")])
        raise ValueError(f"{path}: there is no such config{plugins.did_you_mean(near)}; accepted: a TOML file")
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except RecursionError:
        raise ValueError(f"{path}: tables or arrays lie too deep within each other; accepted: at most {DEPTH}") from None
    except ValueError as error:  # TOML's, UTF-8's, and a number's of thousands of digits
        raise ValueError(f"{path}: not valid TOML: {error}") from None
    for section, content in document.items():
        if section not in sections:
            raise ValueError(f"{path}: section {plugins.unknown(section, sections)}")
        if not isinstance(content, dict):
            raise ValueError(f"{path}: {section} is {content!r}; accepted: a table [{section}]")
        _check_bounds(content, f"{path}: [{section}]")
    return document


def _check_bounds(table: dict[str, Any], where: str) -> None:
    """Raises ValueError for numbers that are not finite or exceed TOML's 64 bits, and for what lies too deep."""
    level: list[tuple[str, Any]] = [(where, table)]
    for _ in range(DEPTH):
        below: list[tuple[str, Any]] = []
        for name, value in level:
            if isinstance(value, dict):
                below += [(f"{name}.{key}", item) for key, item in value.items()]
            elif isinstance(value, list):
                below += [(f"{name}[{number}]", item) for number, item in enumerate(value)]
            elif isinstance(value, float) and not math.isfinite(value):
                raise ValueError(f"{name} is {value}; accepted: a finite number")
            elif isinstance(value, int) and not -(1 << 63) <= value < 1 << 63:
                raise ValueError(f"{name} is a number of {value.bit_length()} bits; accepted: at most 64, with its sign")
        level = below
    if level:
        raise ValueError(f"{where}: tables or arrays lie too deep within each other; accepted: at most {DEPTH}")


def pick_frames(asked: int | list[int] | None, available: int, where: str) -> list[int]:
    """The frames to render, ascending, out of an animation of `available` frames. Raises ValueError."""
    if asked is None:
        asked = min(3, available)
    if isinstance(asked, int):
        if asked > available:
            raise ValueError(f"{where} is {asked}; accepted: 1 to {available}, the animation's length")
        return [round(float(f)) for f in np.linspace(0, available - 1, asked)]
    if max(asked) >= available:
        raise ValueError(f"{where} asks for frame {max(asked)}; accepted: 0 to {available - 1}")
    twice = [frame for frame, count in Counter(asked).items() if count > 1]
    if twice:
        raise ValueError(f"{where} asks for frame {twice[0]} more than once; accepted: every frame once")
    return sorted(asked)


def _run(table: Mapping[str, Any], where: str) -> Run:
    run = params.options(Run, table, where)
    if run.min_rounds > run.max_rounds:
        raise ValueError(f"{where}.min_rounds is {run.min_rounds}; accepted: at most max_rounds, {run.max_rounds}")
    if math.prod(run.size) > MOST_PIXELS:
        raise ValueError(f"{where}.size is {list(run.size)}; accepted: at most {MOST_PIXELS:,} pixels, as 7680 x 4320")
    return run


def _only(section: Mapping[str, Any], extra: Sequence[str], only: Sequence[str]) -> tuple[dict[str, Any], list[str]]:
    """The tables and files of the methods to keep, before anything of the others is imported. Raises ValueError for a name
    that there is not."""
    named = {spec: plugins.name_of(spec) for spec in extra}
    names = list(dict.fromkeys([*section, *named.values()]))
    for name in only:
        if name not in names:
            raise ValueError(f"--only: method {plugins.unknown(name, names)}")
    kept = set(only or names)
    return {k: v for k, v in section.items() if k in kept}, [spec for spec, name in named.items() if name in kept]


def entries(section: Mapping[str, Any], path: Path, apart: Apart) -> Iterator[Entry]:
    """The entries of the tables [methods.NAME]. Raises ValueError for what is wrong in them."""
    for name, content in section.items():
        several = isinstance(content, list)
        for number, table in enumerate(content if several else [content]):
            where = f"{path}: [methods.{name}]" + (f"[{number}]" if several else "")
            if not isinstance(table, dict):
                raise ValueError(f"{where} is {table!r}; accepted: a table of the method's fields")
            source = _source("method", name, table, path, where)
            fields = {key: value for key, value in table.items() if key != "source"}
            yield from _entries(name, source, fields, where, apart, where if source is None else f"{where}.source")


def plugged_in(spec: str, apart: Apart) -> Entry:
    """An entry for `--plugin`: named like its file, with default parameters."""
    name, source = plugins.name_of(spec), plugins.absolute(spec, Path.cwd())
    plugins.check_free("method", name, source, "--plugin")
    return next(_entries(name, source, {}, f"--plugin {spec}", apart, "--plugin"))


def installed(apart: Apart, tell: Callable[[str], None] = print) -> list[Entry]:
    """Every installed method that loads, with default parameters; `tell` hears of those that do not."""
    found = []
    for name in plugins.sites("method"):
        try:
            found += _entries(name, None, {}, name, apart, name)
        except ValueError as error:
            tell(f"left out: {error}")
    return found


def _entries(name: str, source: str | None, fields: Mapping[str, Any], where: str, apart: Apart, named: str) -> Iterator[Entry]:
    """One per combination of a table's values. `named` is the place that names the method."""
    if source is None:
        plugins.site("method", name, named)
    params.check_plain(fields, where)
    said = apart.call(
        "benchharness.study.loading:method", where, name=name, source=source, fields=fields, where=where, named=named
    )  # fmt: skip
    for point in said["points"]:
        yield Entry(name, source, point["params"], point["changed"], said["hash"])


def distinct(entries: Iterable[Entry]) -> list[Entry]:
    """The entries without repetitions. Raises ValueError if one name stands for two different files."""
    kept: dict[str, Entry] = {}
    sources: dict[str, str | None] = {}
    for entry in entries:
        if sources.setdefault(entry.method, entry.source) != entry.source:
            first = sources[entry.method] or "the discovered method"
            raise ValueError(
                f"method {entry.method!r} is given twice, by {first} and by {entry.source or 'its name'}; "
                "accepted: a name of its own for each: [methods.NAME] with `source`"
            )
        kept.setdefault(entry.key, entry)
    return list(kept.values())


def _scenes(section: Mapping[str, Any], path: Path, apart: Apart) -> Iterator[SceneSpec]:
    base = str(path.parent.resolve())
    installed = {name for name, site in plugins.sites("scene").items() if site.offers}
    for name, table in section.items():
        where = f"{path}: [scenes.{name}]"
        if not isinstance(table, dict):
            raise ValueError(f"{where} is {table!r}; accepted: a table of the builder's keywords")
        source = _source("scene", name, table, path, where)
        given = {key: value for key, value in table.items() if key != "source"}
        params.check_plain(given, where)
        if source is None and name not in installed and {"objects", "reflectors", "camera"} & set(table):
            yield SceneSpec(name, name, None, True, table, base, where)
            continue
        named = where if source is None else f"{where}.source"
        if source is None and name not in installed:
            raise ValueError(f"{named}: {plugins.unknown(name, installed)}")
        said = apart.call(
            "benchharness.study.loading:scene", where, name=name, source=source, fields=given, where=where, named=named
        )  # fmt: skip
        for point, label in zip(said["points"], said["labels"], strict=True):
            yield SceneSpec(label, name, source, False, point, base, where)


def _job(spec: SceneSpec, run: Run, entries: list[Entry], path: Path, apart: Apart) -> Job:
    """Has the scene built once, to see that it can be rendered as asked, and keeps what the table says about it."""
    arguments = {"spec": asdict(spec), "run": asdict(run), "path": str(path)}
    said = apart.call("benchharness.study.config:examined", spec.where, timeout_s=run.timeout_s, **arguments)
    return Job(spec, said["frames"], said["images"], said["facts"], entries, said["notes"])


def examined(spec: dict[str, Any], run: dict[str, Any], path: str) -> dict[str, Any]:
    """Builds a scene in this process. Returns what a `Job` holds of it. Raises ValueError where it cannot be rendered."""
    return _examined(SceneSpec(**spec), Run(**run), path)


def _examined(spec: SceneSpec, run: Run, path: str) -> dict[str, Any]:
    scene = spec.build()
    for name, count in [
        ("frames", scene.frames),
        ("objects", len(scene.objects)),
        ("reflectors", len(scene.reflectors)),
    ]:
        if count < 1:
            raise ValueError(f"{spec.where}: the scene has {count} {name}; accepted: at least one")
    if scene.frames > MOST_FRAMES:
        raise ValueError(f"{spec.where}: the scene has {scene.frames:,} frames; accepted: at most {MOST_FRAMES:,}")
    _check_light(scene, spec.where)
    try:
        scene, notes = oriented(scene)
    except ValueError as error:
        raise ValueError(f"{spec.where}: {error}") from None
    frames = pick_frames(run.frames, scene.frames, f"{path}: [run].frames, for scene {spec.label},")
    strange = sorted({*(run.images or [])} - {*frames})
    if strange:
        shown = f"{frames}" if len(frames) < 20 else f"the {len(frames)} frames of the run"
        raise ValueError(f"{path}: [run].images asks for frame {strange[0]}; accepted: of {shown}")
    check_cameras(scene, frames, spec.where)
    try:
        drawn = refined(scene)
    except ValueError as error:
        raise ValueError(f"{spec.where}: {error}") from None
    facts = {
        "scene": spec.label,
        "detail": scene.detail,
        "vertices": drawn.vertices,
        "triangles": drawn.triangles,
        "reflectors": len(scene.reflectors),
        "ppd": scene.ppd,
        "scene_hash": identity.of_scene(scene),
    }
    images = frames if run.images is None else sorted({*run.images})
    remarkable = [str(note) for note in notes if note.remarkable]
    return {"frames": frames, "images": images, "facts": facts, "notes": remarkable}


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


def _source(kind: str, name: str, table: Mapping[str, Any], path: Path, where: str) -> str | None:
    """The absolute form of a table's `source`, if it has one. Raises ValueError where an installed plugin has its name."""
    source = table.get("source")
    if source is None:
        return None
    if not isinstance(source, str):
        raise ValueError(f'{where}.source is {source!r}; accepted: "file.py" or "file.py:Name"')
    source = plugins.absolute(source, path.parent)
    plugins.check_free(kind, name, source, where)
    return source
