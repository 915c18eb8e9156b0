"""Files: NetCDF written whole or not at all, finished cells of a sweep under way, and where a result comes from."""
