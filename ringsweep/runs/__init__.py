"""Runs: sweeps over many cells, single runs with their history, measurements of error against run time."""
