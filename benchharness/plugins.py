"""Finds methods and scenes: nothing registers itself, and the harness knows none of them by name.

A method is a module of the package `methods`, an entry point of the group `benchharness.methods`, or a path `file.py`
or `file.py:Name`. Its name is the module's (or the entry point's) name; its class is the one concrete subclass of
`benchharness.api.Method` that the module defines, or the one whose name is the module's name in CamelCase.

A scene is found the same way (package `scenes`, group `benchharness.scenes`, a path); its builder is the function with
the module's name, which returns a `benchharness.scene.Scene`. A module of `scenes` without one is a helper, no scene.

Whatever is wrong with a plugin is kept in its `error`: one broken plugin never stops the rest.
"""

from __future__ import annotations

import difflib
import hashlib
import importlib
import importlib.util
import inspect
import pkgutil
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from benchharness.api import Method


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


def discover(kind: str) -> dict[str, Plugin]:
    """All plugins of a kind ("method" or "scene") by name: the package's, in alphabetical order, then the entry points.

    A name that is taken stays with its first owner; the other is listed as broken under `name (origin)`.
    """
    found: dict[str, Plugin] = {}
    for plugin in (*_in_package(kind), *_entry_points(kind)):
        if plugin.name in found:
            error = f"the name {plugin.name!r} is taken by {found[plugin.name].origin}"
            label = f"{plugin.name} ({plugin.origin})"
            found[label] = Plugin(label, kind, plugin.origin, error=error)
        else:
            found[plugin.name] = plugin
    return found


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


def look_up(name: str, found: dict[str, Plugin], what: str) -> Plugin:
    """The plugin of that name. Raises ValueError if there is none, or it is broken; `what` names the place."""
    if name not in found:
        usable = [key for key, plugin in found.items() if plugin.error is None]
        raise ValueError(f"{what}: {unknown(name, usable)}")
    plugin = found[name]
    if plugin.error is not None:
        raise ValueError(f"{what}: {name} ({plugin.origin}) does not load: {plugin.error}")
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


def _split(spec: str) -> tuple[str, str | None]:
    """`file.py:Name` -> (file.py, Name); a drive letter's colon is none of ours."""
    path, colon, name = spec.rpartition(":")
    return (path, name) if colon and path.endswith(".py") else (spec, None)


def _in_package(kind: str) -> Iterator[Plugin]:
    package = f"{kind}s"
    try:
        home = importlib.import_module(package)
    except ModuleNotFoundError:  # the harness alone, without the methods and scenes that come with it
        return
    for module in sorted(m.name for m in pkgutil.iter_modules(home.__path__)):
        plugin = _loaded(kind, module, f"package {package}", lambda m=module: importlib.import_module(f"{package}.{m}"), None)
        if plugin is not None:
            yield plugin


def _entry_points(kind: str) -> Iterator[Plugin]:
    for entry in sorted(entry_points(group=f"benchharness.{kind}s"), key=lambda e: (e.name, e.value)):
        origin = f"entry point {entry.value}"
        plugin = _loaded(kind, entry.name, origin, lambda e=entry: importlib.import_module(e.module), entry.attr or None)
        yield plugin or Plugin(entry.name, kind, origin, error=f"module {entry.module} has no builder {entry.name!r}")


def _loaded(kind: str, name: str, origin: str, load: Callable[[], ModuleType], attribute: str | None) -> Plugin | None:
    """Imports and picks the target; None for a module without a builder. Errors of any kind end up in the plugin."""
    try:
        module = load()
        target = _class_of(module, name, attribute) if kind == "method" else _builder_of(module, name, attribute)
    except (Exception, SystemExit) as error:
        return Plugin(name, kind, origin, error=f"{type(error).__name__}: {error}".strip())
    return None if target is None else Plugin(name, kind, origin, target)


def _class_of(module: ModuleType, name: str, attribute: str | None) -> type[Method]:
    """The method class that `attribute` names or, without one, the module's only one or its namesake."""
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


def camel_case(name: str) -> str:
    return "".join(word.capitalize() for word in name.split("_"))


def _import_file(path: Path) -> ModuleType:
    """Imports a file under a name of its own, once; the file's name stays the last part of the module's."""
    name = f"benchharness_plugin_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}.{path.stem}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
