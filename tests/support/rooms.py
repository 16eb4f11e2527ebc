"""The rooms of the code, and which others each may import."""

from __future__ import annotations

MAY = {
    "kernels": "cache",
    "modelling": "",
    "scene": "modelling kernels",
    "assets": "modelling",
    "regime": "scene",
    "api": "kernels scene",
    "platform": "",
    "cache": "",
    "processes": "",
    "exits": "",
    "tables": "exits",
    "render": "api scene modelling kernels cache",
    "study": "api scene modelling assets render platform processes tables",
    "measure": "api scene regime modelling render kernels study tables",
    "execution": "exits api scene modelling render study measure tables platform cache processes",
    "stability": "exits api scene regime modelling kernels render study measure execution tables platform cache processes",
    "needs": "api scene kernels render study measure tables platform",
    "inspection": "assets scene modelling render study measure tables platform",
    "speed": "api scene modelling kernels render study measure tables platform",
    "report": "tables",
    "__main__": "cli",
    "cli": "exits execution inspection needs platform report speed stability study tables",
    "methods": "api scene kernels",
    "scenes": "scene modelling regime",
    "scenes.stress": "scene modelling regime scenes",
}
"""What each room may import beside itself: rooms, or single modules of them. `benchharness` alone is for everybody."""
