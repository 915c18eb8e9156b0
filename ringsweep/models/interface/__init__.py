"""What a solver needs of a model: families of functions, chosen by the type of the scene."""
