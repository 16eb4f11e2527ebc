import benchharness  # noqa: F401  (names the LLVM that Dr.Jit is to load, before anything here can load it)
