"""Vector lanes and power series."""
