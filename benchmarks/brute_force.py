"""Regimes of 500 random scenes by brute force: the data of ``tests/test_brute_force.py``.

    python -m benchmarks.brute_force tests/data/brute_force.csv

takes about six minutes on one core. Nothing of the package is used: the balances of momentum are
solved anew, and every scene is integrated twice, the second time at twice the step or a hundred
times the tolerance.

- ``rk4``: Runge-Kutta 4 at a step that resolves the stiction band, 0.2 relaxation times of a stuck
  contact and never above 1 us; blind to edges, as at that step it may be.
- ``lsoda``: where that would take too many steps, SciPy's LSODA in the coordinates of the ring's
  frame, begun anew at every edge of the rough arc that a contact crosses.

Columns: the scene (SI units, on the rig of the paper); regime, motion, contact and time of
separation; smallest reaction of either contact in weights of the body; whether the second run
agrees in kind.
"""

import argparse
import csv
import math

import numpy as np
from numba import njit
from scipy.integrate import LSODA
from tqdm import tqdm

COUNT, SEED = 500, 181

MASS, INERTIA, HALF_DISTANCE, BALL_RADIUS, RADIUS, GRAVITY = 0.076, 4.47e-5, 0.025, 0.010, 0.043378, 9.81
BETA = math.asin(HALF_DISTANCE / (RADIUS - BALL_RADIUS))
SB, CB = math.sin(BETA), math.cos(BETA)
XI = (RADIUS - BALL_RADIUS) * CB
ABOUT_AXIS = INERTIA + MASS * XI * XI
TURN = 2.0 * math.pi
EPSILON = 1e-3

PARAMETERS = ["amplitude", "exponent", "center", "half_angle", "rough_s", "rough_k", "rest_s", "rest_k", "alpha", "v0"]
SCENE = ["drive", *PARAMETERS, "omega", "span"]
OUTCOME = ["method", "regime", "motion", "contact", "t_separation", "normal_min", "agrees"]
# Positions in the vector of parameters that the compiled functions take.
(POWER, AMPLITUDE, EXPONENT, CENTER, HALF, ROUGH_S, ROUGH_K, REST_S, REST_K, ALPHA, V0) = range(11)

MOST_STEPS = 30_000_000
HELD, LOST_1, LOST_2, JAMMED, UNRESOLVED = range(5)


def draw(rng):
    """A random scene, rounded to what the file holds."""

    def coefficients():
        mu_k = rng.uniform(0.02, 0.4) * grip
        return mu_k + rng.choice([0.0, rng.uniform(0.0, 0.4)], p=[0.1, 0.9]) * grip, mu_k

    # Some on ice, where the body revolves; some so rough that they can jam.
    grip = rng.choice([0.1, 1.0, 3.0], p=[0.15, 0.8, 0.05])
    rough, rest = coefficients(), coefficients()
    scene = {
        "amplitude": rng.choice([-1, 1]) * 10.0 ** rng.uniform(-1, 1.3),
        "exponent": rng.uniform(1.1, 3.0),
        "center": rng.choice([0.0, rng.uniform(-math.pi, math.pi)]),
        "half_angle": rng.choice([0.0, math.pi, rng.uniform(0, math.pi)], p=[0.04, 0.04, 0.92]),
        "rough_s": rough[0],
        "rough_k": rough[1],
        "rest_s": rest[0],
        "rest_k": rest[1],
        "alpha": 10.0 ** rng.uniform(0, 7),
        "v0": 10.0 ** rng.uniform(-9, 0),
        "omega": rng.choice([0.0, rng.uniform(-30, 30), rng.uniform(-120, 120)], p=[0.5, 0.35, 0.15]),
        "span": rng.uniform(0.5, 3.0),
    }
    scene = {name: value if value == math.pi else float(f"{value:.6g}") for name, value in scene.items()}
    return {"drive": str(rng.choice(["arctan", "power"]))} | scene


@njit(error_model="numpy")
def ring(p, t):
    """Angle of the ring and its first two derivatives."""
    a, n = p[AMPLITUDE], p[EXPONENT]
    if p[POWER]:
        return a * t**n, a * n * t ** (n - 1.0), a * n * (n - 1.0) * t ** (n - 2.0)
    return a * (t * math.atan(t) - 0.5 * math.log1p(t * t)), a * math.atan(t), a / (1.0 + t * t)


@njit(error_model="numpy")
def mu(p, rough, speed):
    """Bengisu-Akay, rough or not."""
    mu_s, mu_k = (p[ROUGH_S], p[ROUGH_K]) if rough else (p[REST_S], p[REST_K])
    if speed < p[V0]:
        return mu_s * (1.0 - (1.0 - speed / p[V0]) ** 2)
    return mu_k + (mu_s - mu_k) * math.exp(-p[ALPHA] * (speed - p[V0]))


@njit(error_model="numpy")
def balances(phi, omega, K1, K2):
    """Angular acceleration and both reactions from the three balances; whether they are jammed."""
    s, c = math.sin(phi), math.cos(phi)
    lever = MASS * XI * RADIUS / ABOUT_AXIS - CB
    a11, a12, b1 = CB - K1 * SB, CB + K2 * SB, MASS * (GRAVITY * c + XI * omega * omega)
    a21, a22, b2 = K1 * lever - SB, K2 * lever + SB, -MASS * GRAVITY * s * (1.0 - MASS * XI * XI / ABOUT_AXIS)
    determinant = a11 * a22 - a12 * a21
    N1, N2 = (b1 * a22 - a12 * b2) / determinant, (a11 * b2 - a21 * b1) / determinant
    epsilon = (RADIUS * (K1 * N1 + K2 * N2) - MASS * GRAVITY * XI * s) / ABOUT_AXIS
    # At a given acceleration the first two balances alone must be soluble too.
    jammed = not (determinant > 0.0 and a11 * (SB - K2 * CB) + a12 * (SB + K1 * CB) > 0.0)
    return epsilon, N1, N2, jammed


@njit(error_model="numpy")
def sliding(p, phi, omega, v, rough_1, rough_2):
    """The balances under friction."""
    sign = 1.0 if v > 0.0 else -1.0
    return balances(phi, omega, -sign * mu(p, rough_1, abs(v)), -sign * mu(p, rough_2, abs(v)))


@njit(error_model="numpy")
def is_rough(p, angle):
    x = angle - p[CENTER] + p[HALF]
    return x - TURN * math.floor(x / TURN) < 2.0 * p[HALF]


@njit(error_model="numpy")
def state(p, theta, ring_omega, phi, omega):
    rho = phi - theta
    return sliding(p, phi, omega, (omega - ring_omega) * RADIUS, is_rough(p, rho - BETA), is_rough(p, rho + BETA))


@njit
def classify(track, phi, omega):
    """Sense of the motion, reversals, least and greatest angle since the last one, most turned since then."""
    sense, reversals, low, high = track
    low, high = min(low, phi), max(high, phi)
    if omega > EPSILON and sense <= 0.0:
        if sense < 0.0:
            reversals, high = reversals + 1.0, phi
        sense = 1.0
    elif omega < -EPSILON and sense >= 0.0:
        if sense > 0.0:
            reversals, low = reversals + 1.0, phi
        sense = -1.0
    return sense, reversals, low, high


def motion(track):
    _, reversals, low, high = track
    return "revolving" if high - low >= TURN else "oscillatory" if reversals else "resting"


@njit(error_model="numpy")
def runge_kutta(p, omega, span, steps):
    """End, its time, the track of the motion and the smallest reaction."""
    h = span / steps
    phi = 0.0
    theta, ring_omega, _ = ring(p, 0.0)
    k1, N1, N2, jammed = state(p, theta, ring_omega, phi, omega)
    track = classify((0.0, 0.0, phi, phi), phi, omega)
    least = min(N1, N2)
    if jammed or least <= 0.0:
        return (JAMMED if jammed else LOST_1 if N1 <= N2 else LOST_2), 0.0, track, least
    for step in range(steps):
        theta, ring_omega, _ = ring(p, (step + 0.5) * h)
        w2 = omega + 0.5 * h * k1
        k2 = state(p, theta, ring_omega, phi + 0.5 * h * omega, w2)[0]
        w3 = omega + 0.5 * h * k2
        k3 = state(p, theta, ring_omega, phi + 0.5 * h * w2, w3)[0]
        theta, ring_omega, _ = ring(p, (step + 1.0) * h)
        w4 = omega + h * k3
        k4 = state(p, theta, ring_omega, phi + h * w3, w4)[0]
        phi += h / 6.0 * (omega + 2.0 * w2 + 2.0 * w3 + w4)
        omega += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        before_1, before_2 = N1, N2
        k1, N1, N2, jammed = state(p, theta, ring_omega, phi, omega)
        track = classify(track, phi, omega)
        if jammed:
            return JAMMED, (step + 1.0) * h, track, least
        least = min(least, N1, N2)
        if not least > 0.0:
            at_1 = before_1 / (before_1 - N1) if N1 <= 0.0 else 2.0
            at_2 = before_2 / (before_2 - N2) if N2 <= 0.0 else 2.0
            return (LOST_1 if at_1 < at_2 else LOST_2), (step + min(at_1, at_2)) * h, track, least
    return HELD, span, track, least


class Place:
    """A contact's segment of the ring: even ones are rough, as many turns on as half their number."""

    def __init__(self, p, offset, rho):
        self.offset, self.start, self.width = offset, p[CENTER] - p[HALF], 2.0 * p[HALF]
        turns, rest = divmod(rho + offset - self.start, TURN)
        self.number = 2 * int(turns) + (0 if rest < self.width else 1)

    def bound(self, number):
        return self.start + TURN * (number // 2) + (self.width if number % 2 else 0.0) - self.offset

    @property
    def rough(self):
        return self.number % 2 == 0

    def reserve(self, rho, v):
        """How far the contact has yet to go to the edge that it moves towards."""
        return self.bound(self.number + 1) - rho if v > 0.0 else rho - self.bound(self.number)


@njit(error_model="numpy")
def view(p, t, rho, v, rough_1, rough_2):
    """Angle, its rate, the ring's acceleration and the balances in the ring's frame."""
    theta, ring_omega, ring_epsilon = ring(p, t)
    phi, omega = rho + theta, v / RADIUS + ring_omega
    return phi, omega, ring_epsilon, sliding(p, phi, omega, v, rough_1, rough_2)


def lsoda(p, omega, span, rtol):
    """As :func:`runge_kutta`; each step is looked at in quarters."""
    # The drive may have an infinite acceleration at 0; what it does before 1e-13 s is below rounding.
    t = 1e-13
    theta, ring_omega, _ = ring(p, t)
    y = np.array([-theta, (omega - ring_omega) * RADIUS])
    places = [Place(p, side * BETA, y[0]) for side in (-1, 1)]
    track, least = (0.0, 0.0, 0.0, 0.0), math.inf
    for _ in range(20000):
        rough_1, rough_2 = (place.rough for place in places)

        def rates(t, y, rough_1=rough_1, rough_2=rough_2):
            _, _, ring_epsilon, (epsilon, _, _, _) = view(p, t, y[0], y[1], rough_1, rough_2)
            return y[1] / RADIUS, RADIUS * (epsilon - ring_epsilon)

        def guards(t, y, rough_1=rough_1, rough_2=rough_2):
            phi, omega, _, (_, N1, N2, jammed) = view(p, t, y[0], y[1], rough_1, rough_2)
            values = N1, N2, -1.0 if jammed else 1.0, *(place.reserve(y[0], y[1]) for place in places)
            return phi, omega, values

        solver = LSODA(
            rates, t, y, span, rtol=rtol, atol=[1e-2 * rtol, 1e2 * rtol * p[V0]], first_step=min(1e-13, span)
        )
        phi, omega, values = guards(t, y)
        dense, low = None, t
        while min(values) > 0.0 and solver.status == "running":
            message = solver.step()
            if solver.status == "failed":
                return UNRESOLVED, solver.t, track, message
            dense, low = solver.dense_output(), solver.t_old
            for part in (0.25, 0.5, 0.75, 1.0):
                high = solver.t_old + part * (solver.t - solver.t_old)
                y = dense(high) if part < 1.0 else solver.y
                phi, omega, values = guards(high, y)
                if min(values) <= 0.0:
                    break
                track = classify(track, phi, omega)
                least = min(least, *values[:2])
                low = high
            t = high
        if min(values) > 0.0:
            return HELD, span, track, least
        if dense is not None:
            # The earliest guard to reach zero, by bisection.
            while t - low > 4e-16 * t:
                middle = 0.5 * (low + t)
                if not low < middle < t:
                    break
                if min(guards(middle, dense(middle))[2]) <= 0.0:
                    t = middle
                else:
                    low = middle
            y = np.array(dense(t))
            phi, omega, values = guards(t, y)
        which = [k for k, value in enumerate(values) if value <= 0.0]
        if 2 in which:
            return JAMMED, t, track, least
        if min(which) < 2:
            return (LOST_1 if values[0] <= values[1] else LOST_2), t, track, least
        for k in which:
            places[k - 3].number += 1 if y[1] > 0.0 else -1
    return UNRESOLVED, t, track, "too many crossings"


def stuck_rate(p, span):
    """Rate at which the sliding velocity of a stuck contact relaxes."""
    mu_s = max(p[ROUGH_S], p[REST_S])
    omega = max(abs(ring(p, span)[1]), 1.0)
    return max(
        abs(balances(phi, omega, 1e-6, 1e-6)[0] - balances(phi, omega, -1e-6, -1e-6)[0]) / 2e-6
        for phi in np.linspace(-math.pi, math.pi, 25)
    ) * RADIUS * 2.0 * mu_s / p[V0]  # fmt: skip


def resolve(scene):
    """Outcome of a scene by brute force."""
    p = np.array([float(scene["drive"] == "power"), *(scene[name] for name in PARAMETERS)])
    steps = math.ceil(scene["span"] * max(1e6, stuck_rate(p, scene["span"]) / 0.2))
    if steps <= MOST_STEPS:
        runs = [runge_kutta(p, scene["omega"], scene["span"], n) for n in (steps, steps // 2)]
    else:
        runs = [lsoda(p, scene["omega"], scene["span"], rtol) for rtol in (1e-10, 1e-8)]
    kinds = [(run[0], motion(run[2])) for run in runs]
    end, t, track, least = runs[0]
    regime = [motion(track), "separating", "separating", "jammed", "unresolved"][end]
    return {
        "method": "rk4" if steps <= MOST_STEPS else "lsoda",
        "regime": regime,
        "motion": motion(track),
        "contact": end if end in (LOST_1, LOST_2) else 0,
        "t_separation": f"{t:.8g}" if end in (LOST_1, LOST_2) else "",
        "normal_min": f"{least / (MASS * GRAVITY):.2g}" if end == HELD else least if end == UNRESOLVED else "",
        "agrees": int(kinds[0] == kinds[1]),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", help="CSV file to write")
    parser.add_argument("--count", type=int, default=COUNT, help="scenes (default %(default)s)")
    arguments = parser.parse_args()
    rng = np.random.default_rng(SEED)
    with open(arguments.out, "w", newline="") as file:
        writer = csv.DictWriter(file, SCENE + OUTCOME, lineterminator="\n")
        writer.writeheader()
        for _ in tqdm(range(arguments.count)):
            scene = draw(rng)
            writer.writerow(scene | resolve(scene))
            file.flush()


if __name__ == "__main__":
    main()
