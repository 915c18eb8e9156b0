"""What a number is: its unit, its meaning, its admissible interval; and how people write it."""
