"""Scenes some of whose modes are those of a simpler scene, with fewer components of the state and fewer series."""

from __future__ import annotations

from typing import NamedTuple

from ringsweep.compile import hook


class Whole(NamedTuple):
    """Scenes all of whose modes are of one kind."""


class Parted(NamedTuple):
    """Scenes some of whose modes are those of a simpler scene, which takes the steps there."""


@hook(optional=True)
def kind(scene):
    """Kind of a scene: :class:`Whole` or :class:`Parted`; by default the first. The other hooks are for the second."""
    return Whole()


@hook
def is_simpler(scene, mode):
    """Whether a mode is one of the simpler scene."""


@hook
def first_row(scene):
    """First row of the table of series that belongs to the simpler scene; its table is the rest."""


@hook
def part(scene, mode, y):
    """Simpler scene, and mode and state there."""


@hook
def part_of_record(scene, record, mode):
    """Record of the simpler scene."""


@hook
def begun(scene, part_record):
    """Record at the beginning of a run, from that of the simpler scene."""


@hook
def rejoined(scene, record, mode, guard, part_record, y, c):
    """Guard, record and state after a step of the simpler scene.

    Parameters
    ----------
    scene, record, mode : NamedTuple
        The scene, its record before the step, and its mode.
    guard : int
        Guard that ended the step, a row of the table, or -1.
    part_record : NamedTuple
        Record of the simpler scene after the step.
    y : tuple of float
        State of the simpler scene after the step.
    c : ndarray
        Table of series of the scene. What the step has left there is made that of the scene.

    Returns
    -------
    tuple
        ``(guard, record, state)``
    """
