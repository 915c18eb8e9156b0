"""Configurations: from YAML text to a validated scene, axes and solver in SI units."""

from ringsweep.compile.cache import OWN_FILES
from ringsweep.config.axes import Axes
from ringsweep.config.configuration import Config, Setting, load, tell_unit, with_values
from ringsweep.config.own import load_own_files
from ringsweep.config.scene import as_named, sweepable

__all__ = ["Axes", "Config", "Setting", "as_named", "load", "sweepable", "tell_unit", "with_values"]

# These files may use everything that is imported above.
load_own_files(OWN_FILES)
