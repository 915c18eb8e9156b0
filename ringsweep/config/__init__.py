"""Configurations: from YAML text to a validated scene, axes and solver in SI units."""

from ringsweep.compile.cache import OWN_FILES
from ringsweep.config.axes import Axes
from ringsweep.config.configuration import (
    Config,
    Setting,
    as_written,
    assembled,
    load,
    read_axes,
    read_scene,
    tell_unit,
    with_refine,
    with_values,
)
from ringsweep.config.own_files import load_own_files
from ringsweep.config.scene import sweepable
from ringsweep.config.solver import read_solver

__all__ = [
    "Axes",
    "Config",
    "Setting",
    "as_written",
    "assembled",
    "load",
    "read_axes",
    "read_scene",
    "read_solver",
    "sweepable",
    "tell_unit",
    "with_refine",
    "with_values",
]

# These files may use everything that is imported above.
load_own_files(OWN_FILES)
