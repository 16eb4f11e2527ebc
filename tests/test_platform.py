from __future__ import annotations

import os
import select
import subprocess
import sys

import pytest

from benchharness import platform


def test_the_environments_own_llvm_is_used_unless_the_user_named_one(tmp_path, monkeypatch):
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "libLLVM.so").touch()
    monkeypatch.setattr(platform, "bundled_llvm", lambda: tmp_path / "lib" / "libLLVM.so")
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    assert platform.use_llvm() == str(tmp_path / "lib" / "libLLVM.so")
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/opt/mine/libLLVM.so")
    assert platform.use_llvm() == "/opt/mine/libLLVM.so"


def test_bundled_llvm_is_none_where_the_environment_has_none(tmp_path):
    assert platform.bundled_llvm(tmp_path) is None


def test_importing_platform_imports_neither_drjit_nor_mitsuba():
    code = "import sys, benchharness.platform as p; p.use_llvm(); print('drjit' in sys.modules, 'mitsuba' in sys.modules)"
    seen = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert seen.stdout.split() == ["False", "False"]


def test_a_variant_that_cannot_be_set_says_how_to_mend_it():
    code = (
        "from benchharness import platform\n"
        "try: platform.use_variant('llvm_ad_rgb')\n"
        "except platform.EnvironmentBroken as error: print(error)"
    )
    env = {**os.environ, "DRJIT_LIBLLVM_PATH": "/nowhere/libLLVM.so"}
    seen = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=env)
    assert "llvm_ad_rgb cannot be used" in seen.stdout
    assert "benchharness doctor" in seen.stdout


@pytest.fixture
def lock(tmp_path, monkeypatch):
    """The machine's lock, for tests that would else wait for each other."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return platform.machine_lock()


unix = pytest.mark.skipif(sys.platform == "win32", reason="flock is a Unix call")


@unix
def test_two_runs_are_never_timed_at_once_whatever_their_folder_of_temporary_files(tmp_path, lock):
    code = (
        "from benchharness import platform\n"
        "with platform.alone(lambda text: print('waits', flush=True)): print('alone', flush=True)"
    )
    (tmp_path / "other").mkdir()
    with platform.alone(lambda text: pytest.fail("nobody else holds the lock")):
        env = {**os.environ, "TMPDIR": str(tmp_path / "other")}
        other = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env=env)
        assert other.stdout is not None
        assert other.stdout.readline() == "waits\n"
        assert select.select([other.stdout], [], [], 0.3)[0] == []
    assert other.stdout.readline() == "alone\n"
    assert other.wait() == 0
    other.stdout.close()


@unix
@pytest.mark.parametrize("kind", ["link", "dangling link", "folder", "pipe"])
def test_the_lock_is_a_plain_file_and_no_link_is_followed(tmp_path, lock, kind):
    lock.parent.mkdir(parents=True)
    target = tmp_path / "thesis.tex"
    if kind == "link":
        target.write_text("all of it")
    if kind.endswith("link"):
        lock.symlink_to(target)
    elif kind == "folder":
        lock.mkdir()
    else:
        os.mkfifo(lock)
    with pytest.raises(platform.EnvironmentBroken, match=r"timing-.*cannot be held.*\nmend: "), platform.alone(print):
        pass
    assert (target.read_text() == "all of it") if kind == "link" else not target.exists()


@unix
def test_the_lock_leaves_what_is_in_the_file(lock):
    lock.parent.mkdir(parents=True)
    lock.write_text("a hard link may lead here")
    with platform.alone(print):
        assert lock.read_text() == "a hard link may lead here"
