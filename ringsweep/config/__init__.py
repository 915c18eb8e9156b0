"""Configurations: from YAML text to a validated scene, axes and solver in SI units."""

from ringsweep.compile.cache import OWN_FILES
from ringsweep.config.axes import Axes as Axes
from ringsweep.config.configuration import Config as Config
from ringsweep.config.configuration import Setting as Setting
from ringsweep.config.configuration import load as load
from ringsweep.config.configuration import tell_unit as tell_unit
from ringsweep.config.configuration import with_values as with_values
from ringsweep.config.own import load_own_files
from ringsweep.config.scene import as_named as as_named
from ringsweep.config.scene import sweepable as sweepable

# These files may use everything that is imported above.
load_own_files(OWN_FILES)
