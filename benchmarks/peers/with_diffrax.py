"""diffrax: all cells in one vmapped solve; separation is a terminating event with a root find.

To run in one thread, set XLA_FLAGS before JAX is imported, as the command does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import optimistix

from benchmarks.peers import physics
from benchmarks.peers.physics import BELT_SPAN, BETA, RADIUS, REST, ROUGH, SIGMA, SPAN, Cell, Found, Law

jax.config.update("jax_enable_x64", True)

#: Lanes of an explicit solve. Many lanes share the cost of an iteration, though all wait for the longest run.
LANES = 256
#: Steps after which a lane gives up and counts as failed, because all lanes wait for the last one.
_MOST_STEPS = {"ring": 20_000, "belt": 100_000}


def _solve(method: str, slopes: Any, y: Any, args: Any, rtol: Any, atol: Any, **options: Any) -> Any:
    return diffrax.diffeqsolve(
        diffrax.ODETerm(slopes), getattr(diffrax, method)(), t0=0.0, dt0=1e-6, y0=y, args=args,
        stepsize_controller=diffrax.PIDController(rtol=rtol, atol=atol), throw=False, adjoint=diffrax.ForwardMode(),
        **options,
    )  # fmt: skip


#: False: compiled ahead of time, once for all tolerances.
LAZY = False


def lanes_of(method: str, cells: int) -> int:
    """Number of lanes of one solve of `cells` cells."""
    return max(cells, LANES) if method == "Tsit5" else cells


def _compiled(solve: Callable[..., Any], lanes: Any) -> Callable[..., Any]:
    """A function of one lane and the tolerance, compiled for many lanes."""
    return jax.jit(jax.vmap(solve, in_axes=(0, None))).lower(lanes, 1.0).compile()


@cache
def _ring(law: Law, method: str, lanes: int) -> Callable[..., Any]:
    """(cells, rtol) -> angles at the end, times of separation."""
    f = physics.formulas(jnp, law)
    v0 = law.v0

    def friction(rho: Any, u: Any, half_angle: Any) -> Any:
        rough = jnp.mod(rho + half_angle, 2.0 * jnp.pi) < 2.0 * half_angle
        mu_s, mu_k = (jnp.where(rough, *pair) for pair in zip(ROUGH, REST, strict=True))
        sign = jnp.where(u > 0.0, 1.0, -1.0)
        # `where` computes both branches, and both must stay finite.
        fast = sign * jnp.maximum(jnp.abs(u), v0 / RADIUS)
        return jnp.where(jnp.abs(u) * RADIUS < v0, f.band(u, sign, mu_s, mu_k), f.slip(fast, sign, mu_s, mu_k))

    def motion(t: Any, y: Any, cell: Any) -> Any:
        rho, u = y
        theta, rate, epsilon = f.ring(t, cell[0])
        K1, K2 = friction(rho - BETA, u, cell[1]), friction(rho + BETA, u, cell[1])
        acceleration, first, second = f.balance(rho + theta, u + rate, K1, K2)
        return acceleration - epsilon, jnp.minimum(first, second)

    def slopes(t: Any, y: Any, cell: Any) -> Any:
        return jnp.stack([y[1], motion(t, y, cell)[0]])

    def reaction(t: Any, y: Any, args: Any, **_: Any) -> Any:
        return motion(t, y, args)[1]

    # Reactions jump where mu jumps, and Newton's method fails there. Lanes without an event bisect to the end.
    finder = optimistix.Bisection(rtol=1e-13, atol=1e-13, flip=True)
    scale = jnp.array([1.0, min(1.0, v0 / RADIUS)])

    def solve(cell: Any, rtol: Any) -> Any:
        run = _solve(
            method, slopes, jnp.zeros(2), cell, rtol, rtol * scale, t1=SPAN, event=diffrax.Event(reaction, finder),
            max_steps=_MOST_STEPS["ring"],
        )  # fmt: skip
        t, y = run.ts[-1], run.ys[-1]
        # Not `is_successful`: a bisection of a jump ends with a small interval, but not with a small value.
        good = run.result != diffrax.RESULTS.max_steps_reached
        end = y[0] + f.ring(t, cell[0])[0]
        return jnp.where(good, end, jnp.nan), jnp.where(good & run.event_mask, t, jnp.nan)

    return _compiled(solve, jnp.zeros((lanes, 2)))


@cache
def _belt(method: str, lanes: int) -> Callable[..., Any]:
    """(speeds, rtol) -> displacements at the end."""
    rates = physics.lugre(jnp)

    def slopes(t: Any, y: Any, v_b: Any) -> Any:
        # The state holds the force of the bristles in place of their deflection.
        dx, dw, dz = rates(y[0], y[1], y[2] / SIGMA[0], v_b, jnp.where(y[1] > v_b, 1.0, -1.0))
        return jnp.stack([dx, dw, SIGMA[0] * dz])

    def solve(v_b: Any, rtol: Any) -> Any:
        start = jnp.stack([0.0 * v_b, v_b, 0.0 * v_b])
        run = _solve(method, slopes, start, v_b, rtol, rtol, t1=BELT_SPAN, max_steps=_MOST_STEPS["belt"])
        return jnp.where(diffrax.is_successful(run.result), run.ys[-1, 0], jnp.nan)

    return _compiled(solve, jnp.zeros(lanes))


def ring(law: Law, cells: Sequence[Cell], method: str, rtol: float) -> Callable[[], Found]:
    """Function that runs cells of the ring; cells are repeated to fill the lanes."""
    count = lanes_of(method, len(cells))
    solve, lanes = _ring(law, method, count), jnp.asarray(np.resize(np.array(cells), (count, 2)))
    return lambda: Found(*(np.asarray(column)[: len(cells)] for column in solve(lanes, rtol)))


def belt(speeds: Sequence[float], method: str, rtol: float) -> Callable[[], Found]:
    """Function that runs velocities of the belt."""
    solve, lanes = _belt(method, len(speeds)), jnp.asarray(speeds)
    return lambda: Found(np.asarray(solve(lanes, rtol)), np.full(len(speeds), np.nan))
