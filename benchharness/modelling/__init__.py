"""What scenes are made with: subdivision, winding, creases, panoramas. NumPy alone."""
