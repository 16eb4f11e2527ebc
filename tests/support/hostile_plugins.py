"""Methods that do what no method should, generated: each is (name, source, what is said of it).

`MISDEEDS` happen where a plugin is imported and where it is built; `DEFECTS` are declarations that cannot be used.
"""

from __future__ import annotations

from typing import NamedTuple

METHOD = '''"""A method."""
import os, signal, sys, time
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar
from benchharness.api import Method
{imported}

@dataclass(frozen=True)
class Evil(Method):
    """`size`: nothing."""
    paper: ClassVar[str] = "none"
    size: int = 3
{fields}
    def prepare(self, scene): return None
    def shade(self, state, frame): return None, state
'''

RAISING = """class Own(BaseException): pass
class Mute(Exception):
    def __str__(self): raise RuntimeError("mute")
"""

MISDEEDS = {
    "leaves": ("os._exit(0)", "exit code 0, without an answer"),
    "leaves_with_a_code": ("os._exit(7)", "exit code 7"),
    "aborts": ("print('LLVM ERROR: no such instruction', file=sys.stderr); os.abort()", "SIGABRT.*LLVM ERROR: no such"),
    "segfaults": ("import ctypes; ctypes.string_at(0)", "SIGSEGV"),
    "kills_itself": ("os.kill(os.getpid(), signal.SIGKILL)", "SIGKILL"),
    "turns_into_another": ("os.execv('/bin/true', ['true'])", "exit code 0, without an answer"),
    "closes_everything": ("os.closerange(3, 256)", "without an answer|did not end"),
    "loops": ("while True: pass", "did not end within"),
    "sleeps": ("time.sleep(1000)", "did not end within"),
    "writes_on_the_channel": ("[os.write(fd, b'{\"value\": 3\\n') for fd in range(3, 9) if channel(fd)]", "nobody understands"),
    "raises_its_own": ("raise Own('no root')", "Own: no root"),
    "presses_ctrl_c": ("raise KeyboardInterrupt", "KeyboardInterrupt"),
    "exits": ("sys.exit(0)", "SystemExit: 0"),
    "raises": ("raise RuntimeError('no device')", "RuntimeError: no device"),
    "is_mute": ("raise Mute", "Mute: it cannot say why"),
    "recurses": ("f = lambda: f(); f()", "RecursionError"),
    "says_two_megabytes": ("raise ValueError('long' * 500_000)", r"long \.\.\. \(2,000,0\d\d characters\)|longlong"),
    "says_surrogates": ("raise ValueError('half \\ud800 pair')", "half \ufffd pair"),
    "says_controls": ("raise ValueError('\\x1b[31mred\\x00\\x07 \\u202egnol')", "\ufffd\\[31mred\ufffd\ufffd \ufffdgnol"),
    "prints_a_lot": ("print('x' * 10_000_000); raise ValueError('enough')", "enough"),
    "is_out_of_memory": ("raise MemoryError", "MemoryError"),
}

CHANNEL = """import stat
def channel(fd):
    try: return stat.S_ISFIFO(os.fstat(fd).st_mode)
    except OSError: return False
"""

DEFECTS = {
    "unresolvable": ("    other: 'Nowhere' = 3", "annotations of Evil cannot be read: NameError.*Nowhere"),
    "dies_of_its_annotation": ("    other: 'os._exit(0)' = 3", "exit code 0, without an answer"),
    "no_type": ("    other: Own = None", "is no type of a parameter"),
    "a_set": ("    other: Any = frozenset({1})", "default of 'other' is frozenset.*accepted: a number, text"),
    "an_object": ("    other: Any = field(default_factory=object)", "default of 'other' is <object"),
    "bytes": ("    other: Any = b'abc'", "default of 'other' is b'abc'"),
    "unshowable": ("    other: Any = field(default_factory=lambda: Unshowable())", "a Unshowable that cannot be shown"),
    "a_nested_one": ("    other: Any = (1, (2, {3}))", "default of 'other' is"),
    "of_another_type": ("    other: int = 'three'", r'other is "three"; accepted: int'),
    "a_failing_default": ("    other: int = field(default_factory=lambda: 1 // 0)", "ZeroDivisionError"),
    "a_long_one": ("    other: str = 'x' * 3000", "parameters are 3,0.. characters long; accepted: at most 2,000"),
    "a_control": ("    other: str = 'a\\x07b'", "holds control characters"),
    "out_of_bounds": (
        "    other: Annotated[int, __import__('pydantic').Field(ge=5)] = 3",
        "other is 3; accepted: int, at least 5",
    ),
}

GOOD = METHOD.format(imported="", fields="")

WHOLE = {
    "no_python": ("def (", "SyntaxError"),
    "empty": ("", "no method class"),
    "null_bytes": ("a = 1\0", "null bytes"),
    "no_method": ("x = 1", "no method class"),
    "thawed": (GOOD.replace("frozen=True", "frozen=False"), "Evil is no frozen dataclass"),
    "abstract": (GOOD.partition("    def prepare")[0], "no method class"),
    "imports_nothing": ("import nothing_of_that_name", "ModuleNotFoundError: No module named 'nothing_of_that_name'"),
    "from_nowhere": (GOOD + "Evil.__module__ = 'elsewhere'\n", "no method class"),
    "a_hiding_name": ("import colorsys\n" + GOOD, "'colorsys', which is both"),
    "many_at_once": ("raise ExceptionGroup('all', [ValueError('a')])", "ExceptionGroup: all"),
}


class Plugin(NamedTuple):
    name: str
    source: str
    says: str
    deadly: bool


def plugins() -> list[Plugin]:
    helpers = RAISING + CHANNEL + "class Unshowable:\n    def __repr__(self): raise Own('never')\n"
    deadly = {name for name in MISDEEDS if MISDEEDS[name][1].startswith(("exit", "SIG", "did", "without", "nobody"))}
    found = []
    for name, (code, says) in MISDEEDS.items():
        found.append(Plugin(f"{name}_on_import", METHOD.format(imported=helpers + code, fields=""), says, name in deadly))
        built = f"    def __post_init__(self):\n        {code}\n"
        found.append(Plugin(f"{name}_when_built", METHOD.format(imported=helpers, fields=built), says, name in deadly))
    for name, (declared, says) in DEFECTS.items():
        source = METHOD.format(imported=helpers, fields=declared)
        found.append(Plugin(f"declares_{name}", source, says, "exit code" in says))
    return [*found, *(Plugin(name, source, says, False) for name, (source, says) in WHOLE.items())]
