"""Finds methods and scenes: nothing registers itself, and the harness knows none of them by name.

A method is a module of the package `methods` (whatever that is called here: `benchharness.study.shipped`), an entry point
of the group `benchharness.methods`, or a path `file.py` or `file.py:Name`. Its name is the module's (or the entry point's)
name; its class is the one concrete subclass of `benchharness.api.Method` that the module defines, or the one whose name is
the module's name in CamelCase.

A scene is found the same way (package `scenes`, group `benchharness.scenes`, a path); its builder is the function with
the module's name, which returns a `benchharness.scene.Scene`. A module of `scenes` without one is a helper, no scene.

Whatever is wrong with a plugin is kept in its `error`: one broken plugin never stops the rest. What ends the process that
imports it can: where results are kept, nothing is imported (`benchharness.study.apart`), and `sites` alone says what there is.
"""

from __future__ import annotations

import difflib
import hashlib
import importlib
import importlib.util
import inspect
import modulefinder
import pkgutil
import re
import reprlib
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from benchharness.study import shipped

if TYPE_CHECKING:
    from benchharness.api import Method

_PREFIX = "benchharness_plugin_"  # of the modules that are files


@dataclass(frozen=True)
class Site:
    """Where a plugin is said to be, before anything of it is imported.

    name       as in configs, on the command line, in tables and figures
    kind       "method" or "scene"
    origin     "package methods", or "entry point ..."
    module     what to import
    attribute  the class or the builder in it; None: the one that its name says
    file       the module's, where that can be known without an import
    error      why it is none; None if it may be one
    """

    name: str
    kind: str
    origin: str
    module: str
    attribute: str | None = None
    file: str | None = None
    error: str | None = None

    @property
    def offers(self) -> bool:
        """Whether a user may name it; a module of `scenes` without a builder of its name is a helper."""
        if self.error is not None or self.kind == "method" or self.file is None:
            return self.error is None
        text = Path(self.file).read_text(encoding="utf-8", errors="replace")
        return (
            re.search(rf"^(def {self.name}\(|(from|import) .*\b{self.name}\b|{self.name} *=)", text, re.MULTILINE) is not None
        )


@dataclass(frozen=True)
class Plugin:
    """A method or a scene, or what is left of one that does not load.

    name    as in configs, on the command line, in tables and figures
    kind    "method" or "scene"
    origin  where it was found: "package methods", "entry point ...", or the path given
    target  the class or the builder; None if broken
    error   why it is broken; None if it is not
    """

    name: str
    kind: str
    origin: str
    target: Any = None
    error: str | None = None

    @property
    def file(self) -> Path | None:
        """The file that defines it, where there is one."""
        source = None if self.target is None else inspect.getsourcefile(self.target)
        return None if source is None else Path(source)


def sites(kind: str) -> dict[str, Site]:
    """Where plugins of a kind ("method" or "scene") may be, by name: the package's, in alphabetical order, then the entry
    points. Nothing of them is imported.

    A name that is taken stays with its first owner; the other is listed as broken under `name (origin)`.
    """
    found: dict[str, Site] = {}
    for site in (*_in_package(kind), *_entry_points(kind)):
        if site.name in found:
            label = f"{site.name} ({site.origin})"
            error = f"the name {site.name!r} is taken by {found[site.name].origin}"
            found[label] = replace(site, name=label, error=error)
        else:
            found[site.name] = site
    return found


def site(kind: str, name: str, what: str) -> Site:
    """The site of that name. Raises ValueError if there is none; `what` names the place."""
    found = sites(kind)
    if name not in found:
        raise ValueError(f"{what}: {unknown(name, [key for key, site in found.items() if site.offers])}")
    return found[name]


def discover(kind: str) -> dict[str, Plugin]:
    """All plugins of a kind by name, imported in this process."""
    found = {name: load(site) for name, site in sites(kind).items()}
    return {name: plugin for name, plugin in found.items() if plugin is not None}


def find(kind: str, name: str, what: str) -> Plugin:
    """The plugin of that name, which alone is imported. Raises ValueError if there is none, or it is broken; `what`
    names the place."""
    where = site(kind, name, what)
    plugin = load(where)
    if plugin is None:
        raise ValueError(f"{what}: {where.module} has no builder {name!r}; accepted: a module with a function of its name")
    if plugin.error is not None:
        raise ValueError(f"{what}: {name} ({plugin.origin}) does not load: {plugin.error}")
    return plugin


def given(kind: str, name: str, source: str | None, what: str) -> Plugin:
    """The plugin of a `source`, an absolute path, or the installed one of that name. Raises ValueError as `find` does."""
    return find(kind, name, what) if source is None else from_path(kind, source, Path("/"), what)


def load(site: Site) -> Plugin | None:
    """Imports what is at a site; None for a helper: a module of the package `scenes` without a builder."""
    if site.error is not None:
        return Plugin(site.name, site.kind, site.origin, error=site.error)
    plugin = _loaded(site.kind, site.name, site.origin, lambda: importlib.import_module(site.module), site.attribute)
    if plugin is None and site.file is None:
        error = f"module {site.module} has no builder {site.name!r}"
        return Plugin(site.name, site.kind, site.origin, error=error)
    return plugin


def check_free(kind: str, name: str, source: str, what: str) -> None:
    """Raises ValueError where a file goes by the name of a plugin that is installed: two rows of a table would look alike."""
    taken = sites(kind).get(name)
    if taken is None or not taken.offers or taken.file == _split(source)[0]:
        return
    raise ValueError(
        f"{what}: the name {name!r} is taken by {taken.origin}; accepted: a name of its own, by that of the file or as "
        f"[{kind}s.NAME] with `source`"
    )


def from_path(kind: str, spec: str, base: Path, what: str) -> Plugin:
    """The plugin of a path `file.py` or `file.py:Name`, relative to `base`. `what` names the key that gave the path.

    Raises ValueError if there is no such file, or it does not load: who names a file means it.
    """
    path_text, name = _split(spec)
    path = (base / path_text).resolve()
    if not path.is_file():
        near = close(path.name, [p.name for p in path.parent.glob("*.py")])
        raise ValueError(
            f"{what}: there is no file {path}{did_you_mean(near)}; accepted: file.py or file.py:Name, "
            f"relative to {base.resolve()}"
        )
    plugin = _loaded(kind, path.stem, str(path), lambda: _import_file(path), name)
    if plugin is None:
        raise ValueError(
            f"{what}: {path} has no function {name or path.stem!r}; accepted: a builder of that name, or file.py:Name"
        )
    if plugin.error is not None:
        raise ValueError(f"{what}: {path} cannot be used: {plugin.error}")
    return plugin


def unknown(value: object, accepted: Iterable[object]) -> str:
    """'"colour" is unknown, did you mean "color"?; accepted: ...': the one way in which we refuse a name."""
    names = [str(a) for a in accepted]
    near = close(str(value), names)
    return f"{str(value)!r} is unknown{did_you_mean(near)}; accepted: {', '.join(names) or 'none'}"


def did_you_mean(near: list[str]) -> str:
    return f", did you mean {near[0]!r}?" if near else ""


def close(value: str, accepted: Iterable[str]) -> list[str]:
    """The one name that is most like `value`, or none."""
    return difflib.get_close_matches(value, list(accepted), 1)


def absolute(spec: str, base: Path) -> str:
    """`file.py:Name` relative to `base` -> the same as an absolute path."""
    path, name = _split(spec)
    return str((base / path).resolve()) + (f":{name}" if name else "")


def file_of(spec: str) -> Path:
    """The file of a plugin that is given as `file.py` or `file.py:Name`."""
    return Path(_split(spec)[0])


def name_of(spec: str) -> str:
    """What a plugin is called that is given as `file.py` or `file.py:Name`."""
    return file_of(spec).stem


def _split(spec: str) -> tuple[str, str | None]:
    """`file.py:Name` -> (file.py, Name); a drive letter's colon is none of ours."""
    path, colon, name = spec.rpartition(":")
    return (path, name) if colon and path.endswith(".py") else (spec, None)


def _in_package(kind: str) -> Iterator[Site]:
    package = shipped.package(f"{kind}s")
    spec = importlib.util.find_spec(package)
    if spec is None:  # the harness alone, without the methods and scenes that come with it
        return
    for folder in spec.submodule_search_locations or ():
        for name, packed in sorted((module.name, module.ispkg) for module in pkgutil.iter_modules([folder])):
            file = Path(folder).resolve() / (f"{name}/__init__.py" if packed else f"{name}.py")
            yield Site(name, kind, f"package {package}", f"{package}.{name}", file=str(file))


def _entry_points(kind: str) -> Iterator[Site]:
    for entry in sorted(entry_points(group=f"benchharness.{kind}s"), key=lambda e: (e.name, e.value)):
        yield Site(entry.name, kind, f"entry point {entry.value}", entry.module, entry.attr or None)


def _loaded(kind: str, name: str, origin: str, load: Callable[[], ModuleType], attribute: str | None) -> Plugin | None:
    """Imports and picks the target; None for a module without a builder. Whatever is raised ends up in the plugin."""
    try:
        module = load()
        target = _class_of(module, name, attribute) if kind == "method" else _builder_of(module, name, attribute)
    except BaseException as error:  # plugins raise what they like; see `benchharness.study.apart` for who presses Ctrl-C
        return Plugin(name, kind, origin, error=said(error))
    return None if target is None else Plugin(name, kind, origin, target)


def said(error: BaseException) -> str:
    """'ValueError: no root', whatever the exception's own `__str__` does."""
    try:
        return f"{type(error).__name__}: {error}".strip().removesuffix(":")
    except BaseException as second:
        return f"{type(error).__name__}: it cannot say why ({type(second).__name__})"


def _class_of(module: ModuleType, name: str, attribute: str | None) -> type[Method]:
    """The method class that `attribute` names or, without one, the module's only one or its namesake."""
    from benchharness.api import Method

    concrete = {
        key: value
        for key, value in vars(module).items()
        if inspect.isclass(value)
        and issubclass(value, Method)
        and not inspect.isabstract(value)
        and (value.__module__ == module.__name__ or key == attribute)
    }
    wanted = attribute or (next(iter(concrete)) if len(concrete) == 1 else camel_case(name))
    if wanted not in concrete:
        names = ", ".join(concrete) or "none"
        raise ValueError(f"there is no method class {wanted!r}; concrete subclasses of benchharness.api.Method in it: {names}")
    found = concrete[wanted]
    parameters = vars(found).get("__dataclass_params__")
    if parameters is None or not parameters.frozen:
        raise ValueError(f"{wanted} is no frozen dataclass; accepted: @dataclass(frozen=True)")
    return found


def _builder_of(module: ModuleType, name: str, attribute: str | None) -> Callable | None:
    """The function that `attribute` names or, without one, the namesake of the module or the plugin."""
    for candidate in (attribute,) if attribute else (module.__name__.rpartition(".")[2], name):
        builder = getattr(module, candidate, None)
        if inspect.isfunction(builder):
            return builder
    return None


def shown(value: Any) -> str:
    """Its repr, shortened; whatever the value's own `__repr__` does."""
    try:
        return reprlib.repr(value)
    except BaseException as error:
        return f"a {type(value).__name__} that cannot be shown ({type(error).__name__})"


def camel_case(name: str) -> str:
    return "".join(word.capitalize() for word in name.split("_"))


def _import_file(path: Path) -> ModuleType:
    """Imports a file under a name of its own, once; the file's name stays the last part of the module's.

    What it imports may lie beside it. Raises ValueError where that is not what would be imported.
    """
    name = f"{_PREFIX}{hashlib.sha256(str(path).encode()).hexdigest()[:8]}.{path.stem}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    _reach_beside(path)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _reach_beside(path: Path) -> None:
    """Puts a file's folder last on the path of imports: nobody else's modules are hidden by what lies in it."""
    folder = str(path.parent)
    if folder not in sys.path:
        sys.path.append(folder)
    for name in {name.partition(".")[0] for name, _ in beside(path)}:
        spec = importlib.util.find_spec(name)
        origin = None if spec is None else spec.origin or next(iter(spec.submodule_search_locations or ()), None)
        if origin is None or not Path(origin).resolve().is_relative_to(path.parent):
            raise ValueError(f"it imports {name!r}, which is both beside it and at {origin}; accepted: a name of its own")


def package_of(target: Any) -> str | None:
    """The module of a class or builder; None where a file was given."""
    return None if target.__module__.startswith(_PREFIX) else target.__module__


def beside(path: Path, package: str | None = None) -> list[tuple[str, Path]]:
    """Name and file of each module that a file imports, late or through others, out of its own folder or, where it is the
    module `package`, out of its own package, whose name is left out. Nothing is run: the imports are read from the code."""
    if package is None:
        root, start, own, others = path.parent, path.stem, None, {"benchharness"}
    else:
        levels = package.count(".") + (path.name == "__init__.py")
        root, start, own = path.parents[levels], package, package.partition(".")[0]
        others = {module.name for module in pkgutil.iter_modules([str(root)])} - {own}  # all of site-packages, it may be
    finder = modulefinder.ModuleFinder([str(root)], excludes=sorted(others))
    if package is None:
        finder.run_script(str(path))
    else:
        finder.import_hook(package)
    found = []
    for name, module in finder.modules.items():
        file = getattr(module, "__file__", None)  # none of a module that is built in
        ours = own in (None, name.partition(".")[0]) and not f"{start}.".startswith(f"{name}.") and name != "__main__"
        if file is not None and ours:
            found.append((name if own is None else name.removeprefix(f"{own}."), Path(file)))
    return sorted(found)
