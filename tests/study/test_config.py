"""Configs: what a study becomes, and what is said about one that is wrong."""

from __future__ import annotations

import json
import re
import time
from dataclasses import replace
from pathlib import Path

import mitsuba as mi  # noqa: F401  (so that the variant is set)
import numpy as np
import pytest
from support import study
from support.tiers import first

from benchharness.execution import estimate
from benchharness.modelling import subdivision
from benchharness.stability import plan
from benchharness.study import config, identity, params, plugins, run, scenes

pytestmark = pytest.mark.usefixtures("plugins_here")

GOOD = """
[run]
frames = 3
size = [32, 16]

[scenes.place]
source = "place.py"

[methods.actor]
source = "actor.py"
size = [1, 2]
behaviour = ["a", "b"]
"""


@pytest.fixture
def write(tmp_path):
    (tmp_path / "place.py").write_text(study.SCENE)
    (tmp_path / "actor.py").write_text(study.METHOD)

    def write(text=GOOD, **replaced):
        for old, new in replaced.items():
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "study.toml"
        path.write_text(text)
        return path

    return write


def test_a_study_becomes_one_job_per_scene_configuration_with_every_combination_of_a_sweep(write):
    loaded = config.load(write(GOOD.replace('"place.py"', '"place.py"\nsize = [1.0, 2.0]\ndetail = ["lean", "paper"]')))
    assert (loaded.name, loaded.run.size, loaded.run.variant) == ("study", (32, 16), "llvm_ad_rgb")
    assert [(job.facts["scene"], job.facts["detail"]) for job in loaded.jobs] == [
        ("place[size=1.0]", "lean"),
        ("place[size=1.0]", "paper"),
        ("place[size=2.0]", "lean"),
        ("place[size=2.0]", "paper"),
    ]
    assert loaded.jobs[0].frames == loaded.jobs[0].images == [0, 2, 4]
    params = [(e.params["size"], e.params["behaviour"]) for e in loaded.entries]
    assert params == [(1, "a"), (1, "b"), (2, "a"), (2, "b")]
    assert loaded.entries[0].key == "actor behaviour=a; size=1"
    assert [job.scene.build().name for job in loaded.jobs[1:3]] == ["place[size=1.0]", "place[size=2.0]"]
    assert type(loaded.entries[3].build()).__name__ == "Actor"


def test_an_array_of_tables_is_several_sweeps_without_repetitions(write):
    tables = '[[methods.actor]]\nsource = "actor.py"\nsize = [1, 2]\n[[methods.actor]]\nsource = "actor.py"\nsize = [2, 3]\n'
    loaded = config.load(write(GOOD[: GOOD.index("[methods")] + tables))
    assert [e.params["size"] for e in loaded.entries] == [1, 2, 3]


def test_a_scene_may_be_a_table_of_mesh_files_beside_the_config(write, tmp_path):
    (tmp_path / "box.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    table = """[scenes.mine]
frames = 2
h_max = 10.0
background = [1.0, 1.0, 1.0]
objects = [{name = "box", mesh = "box.obj", shows = "an edge"}]
reflectors = [{name = "sheet", mesh = "box.obj", translate = [0, 0, 1]}]
camera = {path = [[0, -4, 1], [1, -4, 1]], target = [0, 0, 0], fov_deg = 40}

"""
    text = table + GOOD[GOOD.index("[methods") :]
    loaded = config.load(write(text))
    assert [(job.facts["scene"], job.frames, job.facts["triangles"]) for job in loaded.jobs] == [("mine", [0, 1], 2)]
    assert loaded.jobs[0].scene.build().reflectors[0].name == "sheet"
    for old, new, reason in [
        (
            "translate",
            "tranlate",
            r"\[scenes.mine\].reflectors\[0\]: key 'tranlate' is unknown, did you mean 'translate'",
        ),
        ("fov_deg = 40", "fov_deg = 400", r"\[scenes.mine\].camera.fov_deg is 400; accepted: .*less than 180"),
        ('shows = "an edge"', "albedo = [0, 0, 2]", r"objects\[0\]"),
        ("objects = [{", "objects = [] #", r"\[scenes.mine\].objects is \[\]"),
    ]:
        with pytest.raises(ValueError, match=reason):
            config.load(write(text.replace(old, new)))


@pytest.mark.parametrize(
    ("asked", "available", "frames"),
    [
        (1, 9, [0]),
        (2, 9, [0, 8]),
        (3, 250, [0, 124, 249]),
        (4, 4, [0, 1, 2, 3]),
        ([5, 2], 9, [2, 5]),
        (None, 2, [0, 1]),
    ],
)
def test_frames_are_spread_evenly_with_the_first_and_the_last(asked, available, frames):
    assert run.pick_frames(asked, available, "k") == frames


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("[run]", "[run", r"not valid TOML: .*line 2"),
        ("[run]", "[runs]", r"section 'runs' is unknown, did you mean 'run'\?; accepted: run, scenes, "),
        ("[run]", "run = 3\n[reference]", r"run is 3; accepted: a table \[run\]"),
        ("frames", "frame", r"\[run\]: key 'frame' is unknown, did you mean 'frames'\?"),
        ("frames = 3", "frames = 0", r"\[run\].frames is 0; accepted: int, at least 1"),
        ("frames = 3", "frames = 6", r"\[run\].frames, for scene place, is 6; accepted: 1 to 5"),
        ("frames = 3", "frames = [0, 5]", r"asks for frame 5; accepted: 0 to 4"),
        ("frames = 3", "frames = [1, 1]", r"asks for frame 1 more than once; accepted: every frame once"),
        ("frames = 3", "frames = []", r"\[run\].frames is \[\]"),
        ("frames = 3", "images = [3]", r"\[run\].images asks for frame 3; accepted: of \[0, 2, 4\]"),
        ("frames = 3", "min_rounds = 9\nmax_rounds = 3", r"min_rounds is 9; accepted: at most max_rounds, 3"),
        ("frames = 3", "variant = 'lvm_ad_rgb'", r'variant is "lvm_ad_rgb"; accepted: "llvm_ad_rgb" or "cuda_ad_rgb"'),
        ("[32, 16]", "[-32, 16]", r"\[run\].size is \[-32, 16\]; accepted: \[int, at least 1, at most 16384"),
        ("[32, 16]", "32", r"\[run\].size is 32"),
        ("[32, 16]", "[32, 16]\n[reference]\nlighting = 'bakd'", r"\[reference\]: .*lighting is 'bakd'; accepted"),
        ("[32, 16]", "[32, 16]\n[reference]\nssp = 3", r"\[reference\]: key 'ssp' is unknown, did you mean 'spp'\?"),
        ('source = "place.py"', "size = 1", r"\[scenes.place\]: 'place' is unknown"),
        ("place.py", "plaze.py", r"\[scenes.place\].source: there is no file .*, did you mean 'place.py'\?"),
        ('"place.py"', "3", r"\[scenes.place\].source is 3; accepted"),
        ('"place.py"', '"place.py"\nsize = "big"', r'\[scenes.place\].size is "big"; accepted: float'),
        ('"place.py"', '"place.py"\ndetial = "lean"', r"key 'detial' is unknown, did you mean 'detail'\?"),
        ('"place.py"', '"place.py"\nframes = -1', r"\[scenes.place\]: the scene has -1 frames; accepted"),
        ('"place.py"', '"place.py"\nsize = 100.0', r"frame 0, eye \[0, -9, 0\], is inside reflector 'mirror'"),
        ('"actor.py"', '"actor.py:Actr"', r"\[methods.actor\].source: .*no method class 'Actr'.*Actor"),
        ("behaviour =", "behavior =", r"\[methods.actor\]: key 'behavior' is unknown, did you mean 'behaviour'\?"),
        ("[1, 2]", '[1, "2"]', r'\[methods.actor\].size\[1\] is "2"; accepted: int'),
        ("[1, 2]", "[]", r"\[methods.actor\].size is an empty list"),
        ("[1, 2]", "1979-05-27", r"\[methods.actor\].size is 1979-05-27 \(a TOML date"),
        ('source = "actor.py"\n', "", r"\[methods.actor\]: 'actor' is unknown"),
        ("[methods.actor]", "[methods]\nactor = 3\n[methods.act]", r"\[methods.actor\] is 3; accepted: a table"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_with_its_file_key_and_what_would_be_accepted(write, tmp_path, old, new, says):
    assert old in GOOD
    path = write(GOOD.replace(old, new, 1))
    with pytest.raises(ValueError, match=says) as error:
        config.load(path)
    assert str(path) in str(error.value)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("frames = 3", "frames = 1_000_000_000", r"\[run\].frames is 1000000000; accepted: int, at least 1, at most 100000"),
        ("frames = 3", "timeout_s = inf", r"\[run\].timeout_s is inf; accepted: a finite number"),
        ("frames = 3", "timeout_s = 1e9", r"\[run\].timeout_s is 1000000000.0; accepted: float, more than 0, at most 86400"),
        ("frames = 3", "max_rounds = 1_000_000_000", r"\[run\].max_rounds is 1000000000; accepted: .*at most 10000"),
        ("frames = 3", "seed = 4294967296", r"\[run\].seed is 4294967296; accepted: .*less than 4294967296"),
        ("frames = 3", f"seed = 1{40 * '0'}", r"\[run\].seed is a number of 133 bits; accepted: at most 64"),
        ("frames = 3", f"seed = 1{5000 * '0'}", "not valid TOML: .*digits"),
        ("[32, 16]", "[16384, 16384]", r"\[run\].size is \[16384, 16384\]; accepted: at most 33,554,432 pixels"),
        ("[32, 16]", "[32, 16]\n[reference]\nspp = 100_000_000_000", r"spp is 100000000000; accepted: .*from 1 to 1048576"),
        ("[32, 16]", "[32, 16]\n[reference]\nspp = 1e20", r"\[reference\].spp is 1e\+20; accepted: int"),
        ("[32, 16]", "[32, 16]\n[reference]\nmax_depth = 5_000", r"max_depth is 5000; accepted: .*from 1 to 1024"),
        ('"place.py"', '"place.py"\nframes = 1_000_000_000', r"the scene has 1,000,000,000 frames; accepted: at most 100,000"),
        ('"place.py"', '"place.py"\nsize = nan', r"\[scenes\].place.size is nan; accepted: a finite number"),
        ('"place.py"', f'"place.py"\nframes = [{", ".join(map(str, range(1, 300)))}]', "299 config.* of scenes; .*at most 256"),
        (
            "[1, 2]",
            f"[{', '.join(map(str, range(30_000)))}]",
            r"\[methods.actor\].size has 30,000 values; accepted: at most 4,096",
        ),
        ("[1, 2]", f"{3000 * '['}{3000 * ']'}", "lie too deep within each other; accepted: at most 16"),
        ("[1, 2]", f"{100 * '['}{100 * ']'}", "lie too deep within each other; accepted: at most 16"),
        ("[1, 2]", f"1\n{'a.' * 3000}a = 1", "lie too deep within each other; accepted: at most 16"),
        (
            '[1, 2]\nbehaviour = ["a", "b"]',
            f"{[*range(1000)]}\nbehaviour = {[str(n) for n in range(1000)]}",
            r"\[methods.actor\] sweeps over 1,000,000 combinations; accepted: at most 4,096",
        ),
    ],
)
def test_what_has_no_bound_of_its_own_is_given_one(write, old, new, says):
    assert old in GOOD
    began = time.monotonic()
    with pytest.raises(ValueError, match=says) as error:
        config.load(write(GOOD.replace(old, new, 1)))
    assert len(str(error.value)) < 1000
    assert time.monotonic() - began < 10


def test_edges_are_not_split_until_memory_is_full(write, tmp_path, monkeypatch):
    monkeypatch.setattr(subdivision, "MOST_FACES", 1000)
    (tmp_path / "sheet.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    table = """[scenes.mine]
h_max = 1e-6
background = [1.0, 1.0, 1.0]
objects = [{name = "sheet", mesh = "sheet.obj", shows = "an edge"}]
reflectors = [{name = "mirror", mesh = "sheet.obj", translate = [0, 0, 1]}]
camera = {path = [[0, -4, 1]], target = [0, 0, 0], fov_deg = 40}

"""
    with pytest.raises(ValueError, match=r"\[scenes.mine\].objects: h_max is 1e-06: over 1,000 triangles; accepted: a greater"):
        config.load(write(table + GOOD[GOOD.index("[methods") :]))


def test_numbers_of_the_methods_have_upper_bounds():
    """Whatever a method hands on to a kernel fits into 32 bits, and is finite."""
    for name, plugin in plugins.discover("method").items():
        for parameter in params.of_method(plugin.target).values():
            for number in (5_000_000_000, 1e39):
                if {"int": int, "float": float}.get(parameter.accepted().partition(",")[0]) is type(number):
                    with pytest.raises(ValueError, match="at most"):
                        parameter.value(number, f"{name}.{parameter.name}")


@pytest.mark.exhaustive
def test_a_sweep_of_many_values_is_read_in_seconds(write):
    began = time.monotonic()
    loaded = config.load(write(GOOD.replace("[1, 2]", f"{[*range(500)]}")))
    assert (len(loaded.entries), time.monotonic() - began < 10) == (1000, True)


def test_scenes_that_take_long_to_build_are_told_of(write, monkeypatch):
    monkeypatch.setattr(config, "SAID_EVERY_S", 0.0)
    told = []
    config.load(write(GOOD.replace('"place.py"', '"place.py"\nsize = [1.0, 2.0]')), tell=told.append)
    assert told == ["scene place[size=1.0]: building 1 of 2", "scene place[size=2.0]: building 2 of 2"]


def test_no_scene_no_method_and_no_file_are_refused(write, tmp_path):
    with pytest.raises(ValueError, match=r"accepted: at least one \[scenes.NAME\]"):
        config.load(write(GOOD[GOOD.index("[methods") :]))
    path = write(GOOD[: GOOD.index("[methods")])
    with pytest.raises(ValueError, match=r"accepted: at least one \[methods.NAME\] or --plugin"):
        config.load(path)
    loaded = config.load(path, extra=[str(tmp_path / "actor.py")])
    assert [entry.key for entry in loaded.entries] == ["actor behaviour=returns; size=1"]
    with pytest.raises(ValueError, match=r"studi.toml: there is no such config, did you mean 'study.toml'\?"):
        config.load(tmp_path / "studi.toml")


def test_only_keeps_the_named_methods_and_the_hash_of_the_others(write, tmp_path):
    path = write(GOOD + '[methods.other]\nsource = "actor.py"\n')
    whole, part = config.load(path), config.load(path, only=["other"])
    assert [entry.method for entry in part.entries] == ["other"]
    assert part.config_hash == whole.config_hash
    with pytest.raises(ValueError, match=r"--only: method 'othr' is unknown, did you mean 'other'\?"):
        config.load(path, only=["othr"])


def test_two_files_may_not_share_one_name(write, tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "far" / "actor.py").write_text(study.METHOD)
    with pytest.raises(ValueError, match="method 'actor' is given twice"):
        config.load(write(), extra=[str(tmp_path / "far" / "actor.py")])


def test_a_method_that_refuses_its_parameters_is_the_users_to_mend(write, tmp_path):
    check = "\n    def __post_init__(self):\n        if self.size > 1: raise ValueError('size too large')\n"
    (tmp_path / "actor.py").write_text(study.METHOD + check)
    with pytest.raises(ValueError, match=r"\[methods.actor\] behaviour=a; size=2: size too large"):
        config.load(write())


@pytest.mark.parametrize(
    ("old", "new", "changes"),
    [
        ("[32, 16]", "[32, 17]", True),
        ("frames = 3", "frames = 2", True),
        ("frames = 3", "frames = 3\nseed = 1", True),
        ("[32, 16]", "[32, 16]\n[reference]\nspp = 3", True),
        ("frames = 3", "frames = 3\nmax_rounds = 99", False),
        ("frames = 3", "frames = 3\nimages = []", False),
        ("frames = 3", "frames = 3\ntimeout_s = 7", False),
        ("frames = 3\nsize = [32, 16]", "size = [ 32, 16 ]\nframes = 3\nvariant = 'llvm_ad_rgb'", False),
    ],
)  # fmt: skip
def test_the_config_hash_follows_what_determines_results_and_nothing_else(write, old, new, changes):
    before = config.load(write()).config_hash
    assert (config.load(write(GOOD.replace(old, new))).config_hash != before) == changes


def test_the_scene_hash_follows_content_over_the_whole_animation(write, tmp_path):
    def scene_hash(**keywords):
        text = json.dumps(keywords)
        scene = scenes.SceneSpec("s", "place", str(tmp_path / "place.py"), False, json.loads(text), str(tmp_path), "w")
        return identity.of_scene(scene.build())

    write()
    hashes = [scene_hash(size=1.0), scene_hash(size=1.5), scene_hash(frames=6), scene_hash(height=0.1)]
    assert len(set(hashes)) == 4
    assert scene_hash(detail="paper") == hashes[0]  # the builder makes the same of it


def test_the_scene_hash_is_the_same_on_processors_that_differ_in_the_last_digit(write, tmp_path):
    write()
    scene = scenes.SceneSpec("s", "place", str(tmp_path / "place.py"), False, {}, str(tmp_path), "w").build()

    def moved(shift) -> str:
        objects = [replace(o, mesh=replace(o.mesh, vertices=shift(o.mesh.vertices))) for o in scene.objects]
        camera = scene.camera(0.0)
        eye = tuple(shift(np.array(camera.eye)).tolist())
        return identity.of_scene(replace(scene, objects=tuple(objects), camera=lambda time: replace(camera, eye=eye)))

    same = moved(lambda values: values)
    rng = np.random.default_rng(0)
    assert moved(lambda values: np.nextafter(values, rng.choice([-np.inf, np.inf], values.shape))) == same
    assert moved(lambda values: values + 1e-17) == same
    assert moved(lambda values: values + 1e-5 * np.abs(values).max()) != same


def test_the_method_hash_follows_the_source_file(write, tmp_path):
    first = config.load(write()).method_hashes
    assert len(set(first.values())) == 1
    (tmp_path / "actor.py").write_text(study.METHOD + "# another thought\n")
    second = config.load(write()).method_hashes
    assert list(first) == list(second)
    assert set(first.values()) != set(second.values())
    assert all(re.fullmatch("[0-9a-f]{16}", value) for value in second.values())


CONFIGS = sorted((Path(__file__).parents[2] / "configs").glob("*.toml"))
QUICK = [path for path in CONFIGS if path.stem in ("kitchen", "kitchen-quick", "stability")]  # the others build larger scenes


@pytest.mark.parametrize("path", first(CONFIGS, QUICK), ids=lambda path: path.stem)
def test_a_config_that_comes_with_it_is_valid_and_says_what_it_is_about(path):
    if path.stem == "stability":
        assert plan.load(path).studies
    else:
        loaded = config.load(path)
        _, seconds = estimate.of_run(loaded, [len(job.frames) for job in loaded.jobs])
        assert loaded.jobs and 30 < seconds < estimate.TOO_LONG_S
    assert path.read_text().startswith("# ")


def test_a_scene_in_which_nothing_shines_is_refused(write):
    scene = config.load(write(GOOD)).jobs[0].scene.build()
    with pytest.raises(ValueError, match=r"here: nothing shines; accepted: an object with emission"):
        scenes._check_light(replace(scene, background=(0.0, 0.0, 0.0)), "here")


def test_fewer_rounds_at_most_than_there_are_at_least_by_default_are_all_there_are(tmp_path):
    made = config.load(study.write(tmp_path, '["a"]', run="max_rounds = 3")).run
    assert (made.min_rounds, made.max_rounds) == (3, 3)
