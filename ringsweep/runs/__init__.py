"""Runs: sweeps over many cells, single runs with their history, error against run time."""
