"""A frame and a method -> a record: clocks, errors, completeness."""
