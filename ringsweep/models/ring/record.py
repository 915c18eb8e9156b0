"""Record and outcome of runs on the ring: reversals, turns, extremes, motion, regime.

Solvers call what this file implements through :mod:`ringsweep.models.interface.recorder`. Numbers may be vector
lanes, so conditions are written with `select`. `epsilon_omega` is the angular velocity that a reversal must pass,
rad/s.
"""

from __future__ import annotations

from math import isfinite, nan, pi
from typing import Any, NamedTuple

import numpy as np

from ringsweep.compile import inlined, replacing
from ringsweep.models.interface import recorder, shock
from ringsweep.models.interface.status import BROKEN, JAM, SEPARATED_1, SEPARATED_2, SEPARATED_BOTH
from ringsweep.models.ring import long_run
from ringsweep.numerics.functions import any_of, select
from ringsweep.physics.friction import family
from ringsweep.physics.ring import BristleRing, Ring
from ringsweep.quantities.flags import FAILED, JAMMED, OSCILLATORY, RESTING, REVOLVING, SEPARATING

#: Largest number of turns, since datasets store an int32. A diverging run of constant step exceeds it.
MOST_TURNS = 2.0**31 - 1.0


class Record(NamedTuple):
    """Record of a run on the ring; angles in rad, angular velocities in rad/s, times in s, forces in N.

    Attributes
    ----------
    sense : float
        Sign of the last angular velocity beyond the threshold of a reversal; 0 before the first.
    reversals : float
        Number of reversals.
    lowest, highest : float
        Bounds of the angle since the last reversal, or since the start.
    phi_min, phi_max : float
        Bounds of the angle before the last reversal.
    omega_min, omega_max, stick_time, normal_min_1, normal_min_2, normal_max_1, normal_max_2 : float
        As in :class:`Outcome`.
    shocks : Shocks
        Jumps of the angular acceleration; an empty tuple if the method does not locate events.
    long_run : LongRun
        What the motion settles to; an empty tuple if this is not asked for.
    """

    sense: float
    reversals: float
    lowest: float
    highest: float
    phi_min: float
    phi_max: float
    omega_min: float
    omega_max: float
    stick_time: float
    normal_min_1: float
    normal_min_2: float
    normal_max_1: float
    normal_max_2: float
    shocks: Any
    long_run: Any


class Outcome(NamedTuple):
    """Outcomes of a run on the ring, in the order of their columns."""

    regime: float
    motion: float
    separating_contact: float
    t_separation: float
    t_end: float
    phi_end: float
    omega_end: float
    phi_min: float
    phi_max: float
    omega_min: float
    omega_max: float
    reversals: float
    turns: float
    stick_time: float
    normal_min_1: float
    normal_min_2: float
    normal_max_1: float
    normal_max_2: float
    jump_max: float
    t_jump_max: float


@inlined
def record_at_launch(seen, epsilon_omega):
    """Record at the beginning of a run; `seen` is described at :func:`_observe_on_ring`."""
    phi, omega, normal_1, normal_2, acceleration = seen[0], seen[1], seen[2], seen[3], seen[4]
    sense = 1.0 if omega > epsilon_omega else -1.0 if omega < -epsilon_omega else 0.0
    reactions, shocks = (normal_1, normal_2), shock.at_launch(acceleration)
    return Record(sense, 0.0, phi, phi, phi, phi, omega, omega, 0.0, *reactions, *reactions, shocks, ())


@inlined
def record_after(record, shocks, stuck_for, seen, epsilon_omega):
    """Record after one more state; `stuck_for` is the time for which the body has stuck since the last state, s.

    At a reversal the angular velocity passes from beyond one threshold to beyond the other, so that chatter about zero
    does not count.
    """
    r, phi, omega, normal_1, normal_2 = record, seen[0], seen[1], seen[2], seen[3]
    sense, reversals = r.sense, r.reversals
    lowest, highest, phi_min, phi_max = min(r.lowest, phi), max(r.highest, phi), r.phi_min, r.phi_max
    # Some lane passes a threshold other than the last one.
    if any_of(max(omega * sense, epsilon_omega - abs(omega)) <= 0.0):
        forth, back = omega > epsilon_omega, omega < -epsilon_omega
        turned_forth, turned_back = forth & (sense < 0.0), back & (sense > 0.0)
        phi_min, phi_max = min(phi_min, lowest), max(phi_max, highest)
        lowest, highest = select(turned_back, phi, lowest), select(turned_forth, phi, highest)
        reversals = reversals + select(turned_forth | turned_back, 1.0, 0.0)
        sense = select(forth, 1.0, select(back, -1.0, sense))
    return Record(
        sense,
        reversals,
        lowest,
        highest,
        phi_min,
        phi_max,
        min(r.omega_min, omega),
        max(r.omega_max, omega),
        r.stick_time + stuck_for,
        min(r.normal_min_1, normal_1),
        min(r.normal_min_2, normal_2),
        max(r.normal_max_1, normal_1),
        max(r.normal_max_2, normal_2),
        shocks,
        r.long_run,
    )


@inlined
def extremes_of(record, phi, omega, normal_1, normal_2):
    """``(value, least, greatest)`` of phi, omega, N1 and N2, as :func:`implicit.sought` returns them."""
    r = record
    return (
        (phi, min(r.phi_min, r.lowest), max(r.phi_max, r.highest)),
        (omega, r.omega_min, r.omega_max),
        (normal_1, r.normal_min_1, r.normal_max_1),
        (normal_2, r.normal_min_2, r.normal_max_2),
    )


@inlined
def turns_of(record):
    """Number of full turns since the last reversal, or since the start."""
    return min(np.floor((record.highest - record.lowest) / (2.0 * pi)), MOST_TURNS)


@inlined
def word_of_motion(record):
    """Motion up to now: REVOLVING, OSCILLATORY or RESTING."""
    return REVOLVING if turns_of(record) >= 1 else OSCILLATORY if record.reversals > 0 else RESTING


@inlined
def outcome_of(record, status, t, phi, omega):
    """Outcome of a run that ended with `status` at time `t` in the state `(phi, omega)`."""
    r, motion = record, word_of_motion(record)
    if status == BROKEN or not (isfinite(phi + omega) and isfinite(r.normal_min_1 + r.normal_min_2)):
        regime, motion = FAILED, FAILED
    elif status == JAM:
        regime = JAMMED
    elif status in (SEPARATED_1, SEPARATED_2, SEPARATED_BOTH):
        regime = SEPARATING
    else:
        regime = motion
    separated = regime == SEPARATING
    return Outcome(
        float(regime),
        float(motion),
        float(status - SEPARATED_1 + 1 if separated else 0),
        t if separated else nan,
        t,
        phi,
        omega,
        min(r.phi_min, r.lowest),
        max(r.phi_max, r.highest),
        r.omega_min,
        r.omega_max,
        r.reversals,
        turns_of(r),
        r.stick_time,
        # The last step ends after the reaction has vanished, and a reaction may jump below zero at the edge of a zone.
        0.0 if status in (SEPARATED_1, SEPARATED_BOTH) else max(r.normal_min_1, 0.0),
        0.0 if status in (SEPARATED_2, SEPARATED_BOTH) else max(r.normal_min_2, 0.0),
        # A contact that is lost at launch has had no reaction.
        max(r.normal_max_1, 0.0),
        max(r.normal_max_2, 0.0),
        *shock.largest_jump(r.shocks),
    )


#: Record with other extremes of the velocity, and other greatest reactions.
with_peaks = replacing("omega_min", "omega_max", "normal_max_1", "normal_max_2")

#: Record with other extremes of the reactions.
with_reactions = replacing("normal_min_1", "normal_min_2", "normal_max_1", "normal_max_2")

#: Record with another long run.
with_long_run, _with_shocks = replacing("long_run"), replacing("shocks")


@recorder.begin.implements(Ring, BristleRing)
def _begin_record_on_ring(scene, t, seen):
    """Implement :func:`recorder.begin`; the record of a long run stays empty unless the scene asks for one."""
    begun = record_at_launch(seen, scene.epsilon_omega)
    return with_long_run(begun, long_run.launched(scene.long_run, scene, t, seen))


@recorder.lend.implements(Ring, BristleRing)
def _lend_on_ring(scene, record, row):
    """Implement :func:`recorder.lend`: points of the section are stored in the row of the run."""
    return with_long_run(record, long_run.with_room(record.long_run, scene, row))


@recorder.observe.implements(Ring, BristleRing)
def _observe_on_ring(scene, record, t, duration, stuck, seen):
    """Implement :func:`recorder.observe`.

    `seen` is phi (rad), omega (rad/s), both reactions (N), ``shock.Located`` or an empty tuple, and the deflections of
    bristles (m) if there are any.
    """
    shocks = shock.without_event(record.shocks, seen[4])
    r = record_after(record, shocks, select(stuck, duration, 0.0), seen, scene.epsilon_omega)
    return with_long_run(r, long_run.continued(r.long_run, scene, r.stick_time, t, duration, seen))


@recorder.enter.implements(Ring, BristleRing)
def _enter_record_on_ring(scene, record, t, seen):
    """Implement :func:`recorder.enter`: an instant without duration, at which the acceleration may have jumped."""
    return record_after(record, shock.with_jump(record.shocks, t, seen[4]), 0.0, seen, scene.epsilon_omega)


@recorder.after_event.implements(Ring)
def _after_event_on_ring(scene, record, before, mode, t):
    """Implement :func:`recorder.after_event`: under a smooth law the acceleration jumps at the edge of a zone alone."""
    if before.place_1 != mode.place_1 or before.place_2 != mode.place_2:
        return record
    return _with_shocks(record, shock.without_jump(family(scene.law), record.shocks))


@recorder.conclude.implements(Ring, BristleRing)
def _conclude_on_ring(scene, record, status, t, place, velocity):
    """Implement :func:`recorder.conclude`: the numbers of :class:`Outcome`, and those of a long run if there is one."""
    outcome = outcome_of(record, status, t, place, velocity)
    return long_run.followed(record.long_run, outcome, scene, status)
