"""Device code: Dr.Jit kernels that know nothing of scenes, files or time."""
