"""heyoka: a Taylor integrator for each kind of piece, with terminal events and a restart after each event."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import heyoka as hy
import numpy as np

from benchmarks.peers import physics
from benchmarks.peers.physics import BELT_SPAN, FLOATS, GUARDS, SIGMA, SPAN, STICK, Automaton, Cell, Found, Law, Piece

#: False: an integrator is compiled when it is constructed.
LAZY = False


def ring(law: Law, cells: Sequence[Cell], rtol: float) -> Callable[[], Found]:
    """Function that runs cells of the ring."""
    automaton = Automaton(law, physics.pieces(physics.formulas(FLOATS, law), law))
    smooth = physics.pieces(physics.formulas(hy, law), law)
    rho, u, angle = hy.make_vars("rho", "u", "angle")
    held = [hy.par[k] for k in range(len(Piece._fields))]
    integrators = {}
    for kind, piece in smooth.items():
        rates = piece.rates(hy.time, rho, u, *held)
        system = [(rho, hy.expression(rates[0])), (u, hy.expression(rates[1]))]
        if kind == STICK:
            # The state is constant in stick, so heyoka needs the angle of the ring to choose its step for the guards.
            system.append((angle, held[0] * hy.atan(hy.time)))
        events = [
            hy.t_event(guard, direction=hy.event_direction.negative) for guard in piece.guards(hy.time, rho, u, *held)
        ]
        integrators[kind] = hy.taylor_adaptive(system, [0.0] * len(system), t_events=events, tol=rtol)

    def advance(kind: int, piece: Piece, t: float, y: Any) -> tuple[float, Any, str | None]:
        integrator = integrators[kind]
        # An integrator has only the parameters that its formulas use.
        held = piece[: len(integrator.pars)]
        integrator.time, integrator.state[:2], integrator.pars[:] = t, y[:2], held
        integrator.reset_cooldowns()
        code = int(integrator.propagate_until(SPAN)[0])
        # heyoka reports terminal event number k as -1 - k.
        event = GUARDS[kind][-1 - code] if -1 - code in range(len(GUARDS[kind])) else None
        return integrator.time, integrator.state[:2].copy(), event

    return lambda: Found(*np.array([automaton.run(cell, advance) for cell in cells]).T)


def belt(speeds: Sequence[float], rtol: float) -> Callable[[], Found]:
    """Function that runs velocities of the belt; the sign of the sliding velocity is constant between events."""
    # The tolerance is relative to the largest variable, so the state holds the force of the bristles.
    x, w, push = hy.make_vars("x", "w", "push")
    v_b, way = hy.par[0], hy.par[1]
    rates = physics.lugre(hy)(x, w, push / SIGMA[0], v_b, way)
    rates = *rates[:2], SIGMA[0] * rates[2]
    turned = hy.t_event(way * (w - v_b), direction=hy.event_direction.negative)
    integrator = hy.taylor_adaptive(list(zip((x, w, push), rates, strict=True)), [0.0] * 3, t_events=[turned], tol=rtol)

    def one(speed: float) -> float:
        integrator.time, integrator.state[:], integrator.pars[:] = 0.0, (0.0, speed, 0.0), (speed, -1.0)
        integrator.reset_cooldowns()
        while int(integrator.propagate_until(BELT_SPAN)[0]) == -1:
            integrator.pars[1] = -integrator.pars[1]
        return float(integrator.state[0])

    return lambda: Found(np.array([one(speed) for speed in speeds]), np.full(len(speeds), np.nan))
