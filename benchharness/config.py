"""A study: TOML -> validated config -> list of jobs, one per configuration of a scene.

    [run]              how to run: variant, size, frames, rounds (see `Run`)
    [scenes.NAME]      keywords of the builder; or `source = "file.py:Name"` and its keywords; or a table of mesh files
    [reference]        what errors are measured against (see `reference.ReferenceOptions`)
    [methods.NAME]     fields of the method, optional `source`; [[methods.NAME]] are several sweeps of one method

A list sweeps: every combination is a row of its own. Whatever is wrong is a ValueError that names file, key, value and
what would be accepted, before any work is done.
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

from benchharness import identity, params, platform, plugins, tablescene
from benchharness.api import Method
from benchharness.inside import check_cameras
from benchharness.orientation import oriented
from benchharness.scene import Scene, refined

if TYPE_CHECKING:
    from benchharness.reference import ReferenceOptions

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

    method  the name in the table
    source  absolute `file.py` or `file.py:Name`; None for a discovered method
    params  every field of the method -> value
    """

    method: str
    source: str | None
    params: dict[str, Any]

    @property
    def params_text(self) -> str:
        """The column `params`."""
        return params.canonical(self.params)

    @property
    def key(self) -> str:
        """Method and parameters in one line; unique within a run."""
        return f"{self.method} {self.params_text}".strip()

    def cls(self) -> type[Method]:
        if self.source is not None:
            return plugins.from_path("method", self.source, Path("/"), self.method).target
        return plugins.look_up(self.method, plugins.discover("method"), self.method).target

    def build(self) -> Method:
        """The method. Raises ValueError where its own `__post_init__` refuses the parameters."""
        cls = self.cls()
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
            table = tablescene.validated(self.keywords, self.where)
            return tablescene.build(self.label, table, Path(self.base), self.where)
        builder = _builder(self.name, self.source, self.where)
        declared = params.of_builder(builder)
        keywords = {name: declared[name].value(given, f"{self.where}.{name}") for name, given in self.keywords.items()}
        try:
            scene = builder(**keywords)
        except Exception as error:
            raise ValueError(f"{self.where}: the scene cannot be built: {type(error).__name__}: {error}") from error
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
    """A validated study. `method_hashes` is by `Entry.key`."""

    name: str
    path: Path
    run: Run
    reference: ReferenceOptions
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

    Sets the config's variant for this process, since methods may not be imported before. Raises ValueError for what is
    wrong in the config, platform.EnvironmentBroken where the variant cannot be used.
    """
    document = read(path)
    run = _run(document.get("run", {}), f"{path}: [run]")
    platform.use_variant(run.variant)
    from benchharness.reference import ReferenceOptions

    reference = params.options(ReferenceOptions, document.get("reference", {}), f"{path}: [reference]")
    given = distinct([*entries(document.get("methods", {}), path), *(plugged_in(spec) for spec in extra)])
    names = list(dict.fromkeys(entry.method for entry in given))
    for name in only:
        if name not in names:
            raise ValueError(f"--only: method {plugins.unknown(name, names)}")
    kept = [entry for entry in given if not only or entry.method in only]
    if len(kept) > params.MOST_POINTS:
        raise ValueError(f"{path}: there are {len(kept):,} methods with parameters; accepted: at most {params.MOST_POINTS:,}")
    if not kept:
        raise ValueError(f"{path}: there is no method to run; accepted: at least one [methods.NAME] or --plugin FILE")
    hashes = method_hashes(kept, str(path))
    specs = list(_scenes(document.get("scenes", {}), path))
    if not specs:
        raise ValueError(f"{path}: there is no scene; accepted: at least one [scenes.NAME]")
    if len(specs) > MOST_SCENES:
        raise ValueError(f"{path}: there are {len(specs):,} configurations of scenes; accepted: at most {MOST_SCENES}")
    jobs = [_job(spec, run, kept, path) for spec in _slowly(specs, tell)]
    places = Counter((job.facts["scene"], job.facts["detail"]) for job in jobs)
    for place, count in places.items():
        if count > 1:
            raise ValueError(
                f"{path}: two configurations are called scene {place[0]!r}, detail {place[1]!r}; accepted: a builder "
                "that hands its `detail` on to the Scene"
            )
    determines = {k: v for k, v in asdict(run).items() if k in ("variant", "size", "frames", "seed")}
    config_hash = identity.of_options({"run": determines, "reference": asdict(reference)})
    return Config(path.stem, path.resolve(), run, reference, jobs, kept, config_hash, hashes)


def method_hashes(entries: Iterable[Entry], where: str) -> dict[str, str]:
    """Entry.key -> `identity.of_method`. Raises ValueError for parameters that a method refuses."""
    hashes, known = {}, {}
    for entry in entries:
        try:
            method = type(entry.build())
            if method not in known:
                known[method] = identity.of_method(method)
            hashes[entry.key] = known[method]
        except (TypeError, ValueError) as error:
            raise ValueError(f"{where}: [methods.{entry.method}] {entry.params_text}: {error}") from error
    return hashes


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


def entries(section: Mapping[str, Any], path: Path) -> Iterator[Entry]:
    """The entries of the tables [methods.NAME]. Raises ValueError for what is wrong in them."""
    discovered = plugins.discover("method") if section else {}
    for name, content in section.items():
        several = isinstance(content, list)
        for number, table in enumerate(content if several else [content]):
            where = f"{path}: [methods.{name}]" + (f"[{number}]" if several else "")
            if not isinstance(table, dict):
                raise ValueError(f"{where} is {table!r}; accepted: a table of the method's fields")
            source = _source(table, path, where)
            if source is None:
                plugin = plugins.look_up(name, discovered, where)
            else:
                plugin = plugins.from_path("method", source, path.parent, f"{where}.source")
            fields = {key: value for key, value in table.items() if key != "source"}
            for point in params.sweep(fields, params.of_method(plugin.target), where):
                yield Entry(name, source, point)


def plugged_in(spec: str) -> Entry:
    """An entry for `--plugin`: named like its file, with default parameters."""
    plugin = plugins.from_path("method", spec, Path.cwd(), "--plugin")
    declared = params.of_method(plugin.target)
    return Entry(plugin.name, plugins.absolute(spec, Path.cwd()), params.sweep({}, declared, f"--plugin {spec}")[0])


def installed() -> list[Entry]:
    """Every installed method that loads, with default parameters."""
    found = {name: plugin for name, plugin in plugins.discover("method").items() if plugin.error is None}
    return [Entry(name, None, params.sweep({}, params.of_method(p.target), name)[0]) for name, p in found.items()]


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


def _scenes(section: Mapping[str, Any], path: Path) -> Iterator[SceneSpec]:
    discovered = plugins.discover("scene") if section else {}
    base = str(path.parent.resolve())
    for name, table in section.items():
        where = f"{path}: [scenes.{name}]"
        if not isinstance(table, dict):
            raise ValueError(f"{where} is {table!r}; accepted: a table of the builder's keywords")
        source = _source(table, path, where)
        if source is None and name not in discovered and {"objects", "reflectors", "camera"} & set(table):
            tablescene.validated(table, where)
            yield SceneSpec(name, name, None, True, table, base, where)
            continue
        declared = params.of_builder(_builder(name, source, where))
        given = {key: value for key, value in table.items() if key != "source"}
        points = params.sweep(given, declared, where)
        swept = [key for key in given if key != "detail" and len({params.text(p[key]) for p in points}) > 1]
        for point in points:
            label = name + (f"[{params.canonical({key: point[key] for key in swept})}]" if swept else "")
            yield SceneSpec(label, name, source, False, point, base, where)


def _job(spec: SceneSpec, run: Run, entries: list[Entry], path: Path) -> Job:
    """Builds the scene once, to see that it can be rendered as asked, and keeps what the table says about it."""
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
    return Job(spec, frames, images, facts, entries, [str(note) for note in notes if note.remarkable])


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


def _builder(name: str, source: str | None, where: str) -> Any:
    if source is not None:
        return plugins.from_path("scene", source, Path("/"), f"{where}.source").target
    return plugins.look_up(name, plugins.discover("scene"), where).target


def _source(table: Mapping[str, Any], path: Path, where: str) -> str | None:
    """The absolute form of a table's `source`, if it has one."""
    source = table.get("source")
    if source is None:
        return None
    if not isinstance(source, str):
        raise ValueError(f'{where}.source is {source!r}; accepted: "file.py" or "file.py:Name"')
    return plugins.absolute(source, path.parent)
