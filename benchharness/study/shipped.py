"""What comes with the harness, and what it is called: in a checkout, where it is at home, and in a wheel, which shares its
folder with everybody else's packages.

    in a checkout    in a wheel
    methods          benchharness_methods
    scenes           benchharness_scenes
    configs/         benchharness_configs/

Each lies beside the package `benchharness`. Names in tables, hashes and caches have nothing of this in them.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

HOME = Path(__file__).absolute().parents[2]
"""The folder that `benchharness` lies in: a checkout's root, or site-packages."""
HERE = Path("configs")
"""Where configs are looked for in the working folder."""


def package(name: str) -> str:
    """What the package "methods" or "scenes" is imported as, or the folder "configs" is called, in this installation."""
    return f"benchharness_{name}" if (HOME / f"benchharness_{name}").is_dir() else name


def reach() -> None:
    """Puts a checkout's root last on the path of imports, where its packages cannot be found otherwise: an editable install
    offers them under the names of the wheel."""
    for name in ("methods", "scenes"):
        if package(name) != name or not (HOME / name / "__init__.py").is_file():
            continue
        spec = importlib.util.find_spec(name)
        if spec is None or spec.origin is None:  # without an __init__.py it is nobody's package, and yields to ours
            sys.path.append(str(HOME))
            return


def configs() -> dict[str, Path]:
    """The configs by name: those in `configs/` of the working folder, and those that come with the harness."""
    found = {}
    for folder in (HERE, HOME / package("configs")):
        for path in sorted(folder.glob("*.toml"), key=lambda path: path.stem):
            found.setdefault(path.stem, path)
    return found


def config(given: Path) -> Path:
    """The config of a path or else of a name, see `configs`; `given` itself where there is none."""
    return given if given.is_file() else configs().get(str(given), given)
