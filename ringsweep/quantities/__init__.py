"""Physical quantities: parameters of scenes, variables of datasets, units."""
