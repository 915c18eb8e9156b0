"""Modes of two masses on a belt: which of them stick, which mode follows another, and when.

The state is ``(x_1, v_1, x_2, v_2)``: displacements in space, and velocities relative to the belt. `signs` has the sign
of the sliding velocity of each contact, 0 if it is stuck. `motion` is that of :mod:`ringsweep.physics.pair`.

At an event all contacts that are at rest on the belt are asked for their modes anew, together: :func:`_mode_at_rest`.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from ringsweep.compile import inlined
from ringsweep.models.belt.force import breakaway_force, length_scale, speed_scale
from ringsweep.models.interface import modes
from ringsweep.models.interface.status import RUNNING
from ringsweep.numerics.clock import Instant
from ringsweep.physics import drives, pair, ring

# Rounding of forces and accelerations, as a share of their largest terms.
_ROUNDING = 2.0**-50

#: Modes of a contact at rest, in the order in which they are tried: what is stuck stays stuck.
_AT_REST = 0, 1, -1


class Mode(NamedTuple):
    """Mode of two masses on a belt.

    Attributes
    ----------
    signs : tuple of int
        Sign of the sliding velocity of each mass; 0 if it is stuck.
    entry_guard : int
        Always -1: guards that are zero as a mode begins are divided by a power of the time.
    """

    signs: tuple[int, int]
    entry_guard: int


@inlined
def motion_of(y, forcing):
    """What the balances have of the motion."""
    return y[0], y[1] + forcing[1], y[2], y[3] + forcing[1], forcing[2]


@inlined
def kind_of(signs):
    """Index of the kind of mode in :data:`pair.KINDS`."""
    return (1 if signs[0] == 0 else 0) + (2 if signs[1] == 0 else 0)


@inlined
def friction_of(scene, signs):
    """Friction on each mass per unit of its reaction, if it slips."""
    return -signs[0] * scene.first.mu_k, -signs[1] * scene.second.mu_k


@inlined
def scales_of(mass, x, u, forcing):
    """Length, m, speed, m/s, and force, N, in units of which errors of a mass are measured."""
    velocity = abs(u) + abs(forcing[1])
    length = abs(x) + length_scale(mass, velocity)
    force = breakaway_force(mass, 0.0, x) + ring.size(mass.body, (length, 0.0, 0.0)) + mass.body.mass * abs(forcing[2])
    return length, speed_scale(mass, length, velocity), force + 1e-300


@inlined
def forces_of(scene, y, forcing):
    """Size of the forces on each mass, N."""
    x_1, u_1, x_2, u_2, _ = motion_of(y, forcing)
    body, apart, between = scene.body, abs(x_1) + abs(x_2), abs(u_1) + abs(u_2)
    coupled = body.coupling * apart + body.coupling_damping * between
    first, second = scales_of(scene.first, x_1, u_1, forcing)[2], scales_of(scene.second, x_2, u_2, forcing)[2]
    return first + coupled + body.damping_1 * abs(u_1), second + coupled + body.damping_2 * abs(u_2)


@inlined
def _margin(mu_s, mass, sign, keeps, now, size):
    """Least margin of the inequalities of a contact, as a share of the forces; infinite if it slides on."""
    w, normal, force = now
    if sign == 0:
        return (mu_s * normal - abs(force)) / size
    return inf if keeps else sign * w * mass / size


@inlined
def _may_be(v, sign, released, tried):
    """Whether a contact with the sliding velocity `v` may have the mode `tried`; see :func:`_mode_at_rest`."""
    return tried == (sign if v != 0.0 else released) if v != 0.0 or released != 0 else True


@inlined
def _mode_at_rest(scene, y, forcing, signs, released):
    """Mode in which each contact that is at rest sticks or begins to slip.

    Parameters
    ----------
    scene, y, forcing
        As for :func:`modes.row`.
    signs : tuple of int
        Of the contacts; those with a sliding velocity keep theirs.
    released : tuple of int
        Direction in which the stick of a contact has just ended, else 0.

    Returns
    -------
    Mode
        The first whose inequalities hold but for rounding; where none does, the nearest.
    """
    body, motion, sizes = scene.body, motion_of(y, forcing), forces_of(scene, y, forcing)
    keeps = y[1] != 0.0 or released[0] != 0, y[3] != 0.0 or released[1] != 0
    best, found = -inf, signs
    for first in _AT_REST:
        for second in _AT_REST:
            tried = first, second
            if _may_be(y[1], signs[0], released[0], first) and _may_be(y[3], signs[1], released[1], second):
                w, N, F = pair.solved(body, kind_of(tried), friction_of(scene, tried), motion)
                margin = min(
                    _margin(scene.first.mu_s, body.mass_1, first, keeps[0], (w[0], N[0], F[0]), sizes[0]),
                    _margin(scene.second.mu_s, body.mass_2, second, keeps[1], (w[1], N[1], F[1]), sizes[1]),
                )
                if best < -_ROUNDING and margin > best:
                    best, found = margin, tried
    return Mode(found, -1)


@inlined
def _sign(v):
    """Sign of a sliding velocity; 0 at rest."""
    return 1 if v > 0.0 else -1 if v < 0.0 else 0


@inlined
def _mode_at(scene, t, y):
    """Mode in a state."""
    return _mode_at_rest(scene, y, drives.turn(scene.drive, t), (_sign(y[1]), _sign(y[3])), (0, 0))


@modes.begin.implements(pair.BeltPair)
def _begin_of_pair(scene):
    """Implement :func:`modes.begin`."""
    t = drives.beginning(scene.drive)
    v_1, v_2 = (
        drives.velocity_at_beginning(scene.drive, scene.first.initial_v),
        drives.velocity_at_beginning(scene.drive, scene.second.initial_v),
    )
    y = scene.first.initial_x, v_1, scene.second.initial_x, v_2
    return t, y, RUNNING, _mode_at(scene, Instant(t, 0.0), y)


@modes.after_jump.implements(pair.BeltPair)
def _after_jump_of_pair(scene, mode, t, y, jump):
    """Implement :func:`modes.after_jump`."""
    y = y[0], y[1] - jump, y[2], y[3] - jump
    return RUNNING, _mode_at(scene, t, y), y


#: Guards of each contact: in slip its speed, and none; in stick what is left of friction before slip forwards, and
#: before slip backwards.
LOW, HIGH = range(2)


@inlined
def after_guard(scene, mode, i, which, t, y):
    """What follows a guard of contact `i`, LOW or HIGH; see :func:`modes.switch`."""
    released = (1 if which == LOW else -1) if mode.signs[i] == 0 else 0
    y = y[0], 0.0 if i == 0 else y[1], y[2], 0.0 if i == 1 else y[3]
    both = (released, 0) if i == 0 else (0, released)
    return RUNNING, _mode_at_rest(scene, y, drives.turn(scene.drive, t), mode.signs, both), y


@modes.sticks.implements(pair.BeltPair)
def _sticks_of_pair(scene, mode):
    """Implement :func:`modes.sticks`: never both as one; the recorder is shown which contact sticks."""
    return False


@modes.in_space.implements(pair.BeltPair)
def _in_space_of_pair(scene, t, y):
    """Implement :func:`modes.in_space`: both places, then both velocities."""
    x_1, u_1, x_2, u_2, _ = motion_of(y, drives.turn(scene.drive, t))
    return (x_1, x_2), (u_1, u_2)


@modes.row.implements(pair.BeltPair)
def _row_of_pair(scene, mode, forcing, y, seen):
    """Implement :func:`modes.row`: displacement, velocity, friction and mode of each mass."""
    first, second = seen[0], seen[1]
    return first[0], first[1], first[2], float(mode.signs[0]), second[0], second[1], second[2], float(mode.signs[1])
