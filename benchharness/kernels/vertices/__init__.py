"""Moving vertices: where a mirror shows them, and drawing what moved."""
