"""Benchmarks. Run each module from the root of the repository: ``python -m benchmarks.NAME``."""
