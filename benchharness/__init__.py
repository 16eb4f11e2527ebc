"""Compares ways to render what a curved mirror shows: speed against accuracy, and where each breaks."""

from benchharness.platform import use_llvm
from benchharness.study import shipped

__version__ = "0.1.0"

shipped.reach()
use_llvm()  # here, since whichever module comes first runs this before it can import Dr.Jit, which looks for LLVM but once
