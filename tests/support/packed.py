"""Meshes as the rasterizer takes them, and which triangles it drew."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import raster


def packed(vertices, faces, tag=0):
    points = np.hstack([vertices, np.zeros((len(vertices), 1))]).astype(np.float32)
    indices = np.hstack([faces, np.full((len(faces), 1), tag)]).astype(np.uint32)
    return mi.Float(points.ravel()), mi.UInt32(indices.ravel())


def numbers(visibility, view):
    lane = dr.arange(mi.UInt32, view.width * view.height)
    return np.array(raster.winner_at(visibility, view, lane, mi.Bool(True)), np.int64)
