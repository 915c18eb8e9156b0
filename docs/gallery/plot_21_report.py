"""
A report for a colleague
========================

One page with the map, the values at which regimes begin and end, shocks, certificates, and what to cite.
``ringsweep report my-sweep.nc`` writes the same page.
"""

# sphinx_gallery_thumbnail_path = 'docs/regime_map.png'
import ringsweep

ringsweep.run("my-sweep.yaml", progress=False).ringsweep.report("my-report.html")
