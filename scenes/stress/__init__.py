"""Regimes of failure: minimal scenes, each with one severity that grows (`benchharness.regime`)."""
