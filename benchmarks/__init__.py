"""Benchmarks. Run all of them from the root of the repository: ``python -m benchmarks``."""
