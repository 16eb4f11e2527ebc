"""A run folder -> charts and one HTML page. Reads the run's files alone; never renders.

`write(run)` is all that the rest of the program calls.
"""

from benchharness.report.page import write

__all__ = ["write"]
