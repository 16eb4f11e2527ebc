"""The gate on times, with real runs on this machine, which has to be as quiet as one that is gated on."""

from __future__ import annotations

import pytest
from support import gate_power


@pytest.mark.claims
def test_unchanged_code_passes_and_a_kernel_that_is_a_tenth_slower_is_found(tmp_path):
    gate_power.make(tmp_path, 10)
    found = gate_power.power(gate_power.read(tmp_path), 10)
    assert found.false == 0 and found.beside == 0 and found.found >= 9
