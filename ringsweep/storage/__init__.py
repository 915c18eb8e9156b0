"""Files: NetCDF results, the checkpoint of a running sweep, and the provenance of results."""
