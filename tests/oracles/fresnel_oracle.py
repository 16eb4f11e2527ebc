"""Fresnel's equations of a conductor by complex amplitudes, in float64."""

from __future__ import annotations

import numpy as np


def fresnel_by_amplitudes(cos_theta, eta, k):
    """From the complex amplitudes: |r_s|^2 and |r_p|^2 averaged."""
    m = eta + 1j * k
    cos_t = np.sqrt(1 - (1 - cos_theta**2) / m**2 + 0j)
    r_s = (cos_theta - m * cos_t) / (cos_theta + m * cos_t)
    r_p = (m * cos_theta - cos_t) / (m * cos_theta + cos_t)
    return 0.5 * (abs(r_s) ** 2 + abs(r_p) ** 2)
