"""`list`: what there is to run, and with which parameters."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from pathlib import Path

from benchharness import params, plugins

CONFIGS = Path("configs")


def methods() -> Iterator[str]:
    """A method's name and paper, then a line per field; or why it is broken."""
    for plugin in plugins.discover("method").values():
        yield _broken(plugin) if plugin.error else f"{plugin.name}  ({getattr(plugin.target, 'paper', 'no paper')})"
        if not plugin.error:
            yield from _parameters(params.of_method(plugin.target))


def scenes() -> Iterator[str]:
    """A scene's name and first line of docstring, then a line per keyword; or why it is broken."""
    for plugin in plugins.discover("scene").values():
        if plugin.error:
            yield _broken(plugin)
            continue
        said = inspect.getdoc(plugin.target) or inspect.getdoc(inspect.getmodule(plugin.target)) or ""
        yield f"{plugin.name}  {said.partition(chr(10))[0]}".rstrip()
        try:
            yield from _parameters(params.of_builder(plugin.target))
        except ValueError as error:
            yield f"  BROKEN: {error}"


def configs(folder: Path = CONFIGS) -> Iterator[str]:
    """The configs of a folder with the first line of comment of each."""
    for path in sorted(folder.glob("*.toml")):
        first = path.read_text(encoding="utf-8", errors="replace").partition("\n")[0]
        yield f"{path}  {first.lstrip('# ')}".rstrip() if first.startswith("#") else str(path)


KINDS = {"methods": methods, "scenes": scenes, "configs": configs}


def _parameters(declared: Mapping[str, params.Parameter]) -> Iterator[str]:
    for name, parameter in declared.items():
        required = parameter.default is params.Parameter.required
        default = "required" if required else f"= {params.text(parameter.default)}"
        yield f"  {name} {default}  ({parameter.accepted()})"


def _broken(plugin: plugins.Plugin) -> str:
    return f"{plugin.name}  BROKEN ({plugin.origin}): {plugin.error}"
