"""Files of meshes as users have them -> parts, each right, or a refusal by name. NumPy alone."""
