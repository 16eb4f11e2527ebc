"""Pictures of a scene as its stand-in: taking them, and rays that meet them."""
