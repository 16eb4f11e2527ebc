"""A study as its author writes it -> validated jobs: configs, parameters, plugins."""
