"""What the documentation says about files, entries and code is so."""

from __future__ import annotations

import re
from dataclasses import asdict
from pathlib import Path

import pytest
from support.rooms import MAY

from benchharness import platform
from benchharness.report import columns
from benchharness.study import run, scenes

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def anchors(page: Path) -> set[str]:
    """The anchors that GitHub gives to the headings of a page."""
    titles = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        if "://" in link:
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.is_file(), f"{page.name}: {link}"
        assert not anchor or anchor in anchors(target), f"{page.name}: {link}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_are_named_exist(page):
    named = set(re.findall(r"`((?:benchharness|methods|scenes|configs|tests|results|docs)/[\w./-]*)`", page.read_text()))
    missing = sorted(name for name in named if not (ROOT / name).exists() and "NAME" not in name and "/runs/" not in name)
    assert not missing


def test_the_table_of_rooms_is_what_the_layers_are_held_to():
    page = (ROOT / "docs" / "architecture.md").read_text()
    rooms = page[: page.index("## Where would you put")]
    said = {name: may for name, may in re.findall(r"^\| `([\w.]+)` \|.*\|([^|]*)\|$", rooms, re.MULTILINE)}
    assert {name: set(re.findall(r"`([\w.]+)`", may)) for name, may in said.items()} == {
        name: set(may.split()) for name, may in MAY.items()
    }


def test_entries_that_regimes_cite_are_in_the_catalogue():
    said = set(re.findall(r"\b[TFIPM]-?\d+\b", (ROOT / "docs" / "failures.md").read_text()))
    cited = {
        entry
        for path in (ROOT / "scenes" / "stress").glob("*.py")
        for entry in re.findall(r"\b[FIPM]-\d\d\b", path.read_text())
    }
    assert len(cited) > 40
    assert sorted(cited - said) == []


def test_the_page_of_columns_is_what_the_table_says():
    assert (ROOT / "docs" / "columns.md").read_text() == columns.markdown()


def test_the_readme_is_read_in_five_minutes():
    assert len((ROOT / "README.md").read_text().splitlines()) <= 150


def shown(what: str) -> str:
    """The block of Python in extending.md that has `what` in it."""
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "extending.md").read_text(), re.DOTALL)
    (code,) = (block for block in blocks if what in block)
    return code


def test_the_method_that_is_shown_is_one():
    platform.use_variant("llvm_ad_rgb")
    from benchharness.api import Method

    names: dict = {}
    exec(compile(shown("class Dome"), "extending.md", "exec"), names)
    dome = names["Dome"]()
    assert isinstance(dome, Method) and dome.brightness == 1.0


def test_the_scene_that_is_shown_can_be_rendered(tmp_path):
    file = tmp_path / "marbles.py"
    file.write_text(shown("def marbles"))
    for number, detail in enumerate(["lean", "paper"]):
        spec = scenes.SceneSpec("marbles", "marbles", str(file), False, {"gap": 0.0, "detail": detail}, str(tmp_path), "here")
        said = scenes.examined(asdict(spec), asdict(run.Run()), "study.toml")
        assert (said["facts"]["detail"], said["facts"]["reflectors"], said["notes"]) == (detail, 1, [])
        assert said["facts"]["vertices"] == 3 * (10 * 4 ** (4 + number) + 2), "an icosphere's, three times"
