"""Compares ways to render what a curved mirror shows: speed against accuracy, and where each breaks."""

__version__ = "0.1.0"
