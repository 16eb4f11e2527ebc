"""What stands in scenes: each builds meshes, none is a scene."""
