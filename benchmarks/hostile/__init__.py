"""Attacks on ringsweep. Nothing may be lost, nothing may change in silence, and nothing may be left behind."""
