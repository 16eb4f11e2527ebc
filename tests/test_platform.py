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


@pytest.mark.skipif(sys.platform == "win32", reason="flock is a Unix call")
def test_two_runs_are_never_timed_at_once(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    code = (
        "from benchharness import platform\n"
        "with platform.alone(lambda text: print('waits', flush=True)): print('alone', flush=True)"
    )
    with platform.alone(lambda text: pytest.fail("nobody else holds the lock")):
        other = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
        assert other.stdout is not None
        assert other.stdout.readline() == "waits\n"
        assert select.select([other.stdout], [], [], 0.3)[0] == []
    assert other.stdout.readline() == "alone\n"
    assert other.wait() == 0
    other.stdout.close()
