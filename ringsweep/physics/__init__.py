#: The paper that ring and belt, the laws of its figures, and "the paper" in docstrings come from.
PAPER = (
    "S. Alaci et al., Some Aspects of the Effects of Dry Friction Discontinuities on the Behaviour of Dynamic Systems, "
    "Computation 2024, 12(9), 181, https://doi.org/10.3390/computation12090181"
)
