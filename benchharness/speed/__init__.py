"""What the kernels cost beside others that draw the same: Embree, software OpenGL. `python -m benchharness.speed`."""
