"""What the kernels cost beside others that draw the same: Embree, software OpenGL. `benchharness speed`; see `sitting`."""
