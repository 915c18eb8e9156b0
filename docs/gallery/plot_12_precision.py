"""
Error against run time
======================

``precision`` measures the error and the run time of several settings on some cells of your sweep.
"""

import ringsweep

found = ringsweep.precision("my-sweep.yaml", progress=False)
figure = ringsweep.plots.work_precision(found)
