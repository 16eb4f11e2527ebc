"""The packages of a wheel: those of `benchharness` and, under names that nobody else's packages have, the checkout's folders
`methods`, `scenes` and `configs` (see `benchharness.study.shipped`). pyproject.toml cannot say this; all else is there."""

from setuptools import find_packages, setup

setup(
    packages=[
        *find_packages(include=["benchharness*"]),
        *(f"benchharness_{name}" for name in find_packages(include=["methods*", "scenes*"])),
        "benchharness_configs",
    ],
    package_dir={f"benchharness_{folder}": folder for folder in ("methods", "scenes", "configs")},
)
