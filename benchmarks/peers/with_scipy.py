"""`solve_ivp` of SciPy, with right-hand sides and events compiled by Numba; the ring restarts at every event."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from math import atan, cos, exp, log1p, sin
from types import SimpleNamespace
from typing import Any

import numba
import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.peers import physics
from benchmarks.peers.physics import BELT_SPAN, GUARDS, RADIUS, SPAN, STICK, Automaton, Cell, Found, Law, Piece, Smooth

_compiled = numba.njit(error_model="numpy")


@_compiled
def _bounded_exp(x: float) -> float:
    # Trial states of an implicit step can lie far outside the region of the formula.
    return exp(min(x, 1.0))


_LANGUAGE = SimpleNamespace(sin=sin, cos=cos, exp=_bounded_exp, atan=atan, log1p=log1p)
#: Longest step in stick, s: SciPy detects an event only from the signs at the ends of a step.
_LOOK = 0.05


#: True: Numba compiles at the first call.
LAZY = True


@cache
def _smooth(law: Law) -> dict[int, Smooth]:
    return physics.pieces(physics.formulas(_LANGUAGE, law, _compiled), law, _compiled)


@cache
def _belt_slopes() -> Callable[..., Any]:
    rates = physics.lugre(_LANGUAGE, _compiled)

    @_compiled
    def slopes(t: float, y: Any, v_b: float) -> Any:
        return np.array(rates(y[0], y[1], y[2], v_b, 1.0 if y[1] > v_b else -1.0))

    return slopes


def _event(guards: Callable[..., Any], k: int) -> Callable[..., Any]:
    def event(t: float, y: Any, *piece: float) -> float:
        return guards(t, y[0], y[1], *piece)[k]

    event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
    return event


def ring(law: Law, cells: Sequence[Cell], method: str, rtol: float) -> Callable[[], Found]:
    """Function that runs cells of the ring."""
    smooth = _smooth(law)
    scale = law.v0 / RADIUS if law.v0 > 0.0 else 1.0
    slopes = {kind: lambda t, y, *p, f=piece.rates: f(t, y[0], y[1], *p) for kind, piece in smooth.items()}
    events = {kind: [_event(piece.guards, k) for k in range(len(GUARDS[kind]))] for kind, piece in smooth.items()}

    def jacobian(kind: int) -> Callable[..., Any]:
        def differences(t: float, y: Any, *piece: float) -> Any:
            # Differences scaled to the width of the band, which SciPy's own differences do not know.
            rates, (rho, u) = smooth[kind].rates, y
            here = rates(t, rho, u, *piece)[1]
            by_rho = (rates(t, rho + 1e-6, u, *piece)[1] - here) / 1e-6
            by_u = (rates(t, rho, u + 1e-4 * scale, *piece)[1] - here) / (1e-4 * scale)
            return np.array(((0.0, 1.0), (by_rho, by_u)))

        return differences

    def advance(kind: int, piece: Piece, t: float, y: Any) -> tuple[float, Any, str | None]:
        options: dict[str, Any] = {} if method == "DOP853" else {"jac": jacobian(kind)}
        if kind == STICK:
            options["max_step"] = _LOOK
        found = solve_ivp(
            slopes[kind], (t, SPAN), y, method, args=piece, rtol=rtol, atol=(rtol, rtol * scale),
            events=events[kind], **options,
        )  # fmt: skip
        hit = [name for name, times in zip(GUARDS[kind], found.t_events, strict=True) if len(times)]
        end = found.y[:, -1] if found.status >= 0 else np.full(2, np.nan)
        return float(found.t[-1]), end, hit[0] if hit else None

    automaton = Automaton(law, smooth)
    return lambda: Found(*np.array([automaton.run(cell, advance) for cell in cells]).T)


def belt(speeds: Sequence[float], method: str, rtol: float) -> Callable[[], Found]:
    """Function that runs velocities of the belt."""
    slopes = _belt_slopes()

    def one(speed: float) -> float:
        run = solve_ivp(
            slopes, (0.0, BELT_SPAN), [0.0, speed, 0.0], method, rtol=rtol, atol=1e-6 * rtol, args=(speed,)
        )  # fmt: skip
        return float(run.y[0, -1]) if run.success else np.nan

    return lambda: Found(np.array([one(speed) for speed in speeds]), np.full(len(speeds), np.nan))
