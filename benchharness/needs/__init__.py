"""How little model is enough: every knob that says how much model there is, turned from the least to the most."""
