"""`python -m benchharness` is the command line."""

from benchharness.cli import main

main()
