"""What formulas and solvers compute with: vector lanes, and power series."""
