"""Closed-form solutions from the balances of momentum, and functions that run a batch."""

from math import cos, inf, pi, sin
from types import SimpleNamespace

import numpy as np
from scipy.optimize import brentq

from ringsweep.compile import take
from ringsweep.config import load
from ringsweep.models import batch
from ringsweep.models.ring.record import Outcome
from ringsweep.physics import ring
from ringsweep.physics.friction.speeds import hidden_fields
from ringsweep.physics.friction.velocity import EXPRESSIONS
from ringsweep.solvers.automaton import History, Results, integrate


def made(law, surfaces=((0.5, 0.3),), motion=0.0, **parameters):
    """Friction law of one cell, made in the same way as in a sweep; `motion` is the speed of the motion, m/s."""
    columns = {name: np.array([float(value)]) for name, value in parameters.items()}
    pairs = [tuple(np.array([float(mu)]) for mu in pair) for pair in surfaces]
    return take(law(**columns, **hidden_fields(EXPRESSIONS[law], columns, pairs, motion)), 0)


def cell_of(scene):
    """The only cell of a scene: each field is a number, or an array of it."""
    found = load({"scene": scene}).scene
    return take(batch(found.structure, {path: np.array([value]) for path, value in found.values.items()}), 0)


def rod(mass, inertia, radius, xi, sin_beta, cos_beta, gravity):
    """Body with two contacts, with its constants."""
    beta = np.arcsin(sin_beta)
    return ring.completed(ring.TwoContacts(mass, inertia, radius, xi, beta, sin_beta, cos_beta, gravity))


def ball(mass, radius, gravity):
    """Body with one contact, with its constants."""
    return ring.completed(ring.OneContact(mass, radius, gravity))


def solve(method, batch):
    """Outcomes of a batch: one array for each outcome, and the fields of `Result`."""
    result = method.run(batch, Outcome._fields)
    return SimpleNamespace(**vars(result), **dict(zip(Outcome._fields, result.rows.T, strict=True)))


def balances(body, phi):
    """Acceleration of the body without contact forces, and its change by a unit of each contact force.

    Components: radially outwards and along the race at the centre of mass, and angular. The second array has one column
    for each of the forces N1, F1, N2, F2.
    """
    b = body
    free = np.array([b.gravity * cos(phi), -b.gravity * sin(phi), 0.0])
    units = []
    for side in (-1, 1):
        # Normal, tangent and lever arm of the contact in radial and tangential components at the centre of mass.
        out, along = np.array([b.cos_beta, side * b.sin_beta]), np.array([-side * b.sin_beta, b.cos_beta])
        arm = b.radius * out - np.array([b.xi, 0.0])
        for force in (-out, along):
            units.append([*force / b.mass, (arm[0] * force[1] - arm[1] * force[0]) / b.inertia])
    return free, np.array(units).T


def contact_accelerations(body, motion, omega):
    """Acceleration of the gap and of the place along the race, at both contacts."""
    b = body
    radial, tangential, angular = motion
    centre = b.xi / b.cos_beta
    found = []
    for side in (-1, 1):
        half = side * centre * b.sin_beta
        # The ball's centre sits `half` along the tangent from the centre of mass.
        ball = np.array([radial - half * angular, tangential - half * omega**2])
        out, along = np.array([b.cos_beta, side * b.sin_beta]), np.array([-side * b.sin_beta, b.cos_beta])
        gap = -(ball @ out + centre * omega**2)
        found.append((gap, ball @ along + (b.radius - centre) * angular))
    return found


def gap_response(body, K, phi, omega):
    """Accelerations of both gaps without contact forces, and their changes by a unit of each reaction with friction."""
    free, units = balances(body, phi)
    base = np.array(contact_accelerations(body, free, omega))[:, 0]
    columns = [units[:, 2 * i] + K[i] * units[:, 2 * i + 1] for i in (0, 1)]
    return base, np.array([np.array(contact_accelerations(body, free + c, omega))[:, 0] - base for c in columns]).T


def growth(runs, points, names, weight, periods, distance):
    """Logarithms of the growth of a disturbance in each period, of shape ``(periods, cells)``.

    Neighbouring runs are brought together again after each period. `runs` returns the outcomes of columns of values by
    path, and `points` are those of one period; `names` are those of place and velocity. A length counts `weight` times
    as much as a velocity.
    """
    paths = [f"initial.{name}" for name in names]
    state, found = np.array([points[path] for path in paths], dtype=float), []
    cells = state.shape[1]
    apart = np.array([np.full(cells, distance), np.zeros(cells)])
    for _ in range(periods):
        both = {path: np.tile(column, 2) for path, column in points.items()}
        last = runs(both | dict(zip(paths, np.hstack([state, state + apart]), strict=True)))
        both = np.array([last[f"{name}_end"].values for name in names])
        state, apart = both[:, :cells], both[:, cells:] - both[:, :cells]
        length = np.hypot(apart[0] * weight, apart[1])
        found.append(np.log(length / distance))
        apart = apart / length * distance
    return np.array(found)


def period_map(ends, state, distance):
    """Matrix of the derivative of the map of one period at a state, by differences.

    `ends` returns the states of all runs after a period from their states before it.
    """
    steps = distance * np.eye(len(state))
    one, other = np.split(ends(np.reshape(state, (-1, 1)) + np.hstack([steps, -steps])), 2, axis=1)
    return (one - other) / (2.0 * distance)


HISTORY = ("phi", "omega", "epsilon", "normal_1", "normal_2", "ring_omega", "zone_1", "zone_2", "mode")


def trail(method, batch, spacing):
    """History of the first cell: the end of every step, and instants `spacing` apart, s."""
    history = History(spacing, np.empty(2_000_000), np.empty((2_000_000, len(HISTORY))))
    no_results = Results(np.empty((1, 0)), np.empty(1), np.empty((0, 7)))
    count = integrate(take(batch, [0]), method.tolerances(), method.max_steps, no_results, history)
    return SimpleNamespace(t=history.times[:count], **dict(zip(HISTORY, history.table[:count].T, strict=True)))


def motion(body, K1, K2):
    """Coefficients of ``(omega^2, cos phi, sin phi)`` in the angular acceleration and in both reactions."""
    if not hasattr(body, "xi"):
        g, R, M = body.gravity, body.radius, body.mass
        return np.array([[K1, K1 * g / R, -g / R], [M * R, M * g, 0.0], [M * R, M * g, 0.0]])
    M, g, R, xi, s, c = body.mass, body.gravity, body.radius, body.xi, body.sin_beta, body.cos_beta
    balances = np.array(
        [
            [0.0, c - K1 * s, c + K2 * s],
            [M * xi, -s - K1 * c, s - K2 * c],
            [body.inertia + M * xi * xi, -R * K1, -R * K2],
        ]
    )
    loads = M * np.array([[xi, g, 0.0], [0.0, 0.0, -g], [0.0, 0.0, -g * xi]])
    return np.linalg.solve(balances, loads)


#: Nodes and weights of Gaussian quadrature.
NODES, NODE_WEIGHTS = np.polynomial.legendre.leggauss(120)


class Fall:
    """Closed form of the motion under Coulomb friction with stiction, on a ring at rest with one zone.

    Between two edges ``u = omega^2 = C e^(2 p phi) + A cos phi + B sin phi``. The reactions are linear combinations of
    u, cosine and sine.
    """

    def __init__(self, body, center, half_angle, rough, rest):
        self.body, self.rough, self.rest = body, rough, rest
        self.start, self.width = center - half_angle, 2 * half_angle
        self.offset = getattr(body, "beta", 0.0)

    def friction(self, angle, kind):
        return (self.rough if (angle - self.start) % (2 * pi) < self.width else self.rest)[kind]

    def coefficients(self, phi, kind):
        return self.friction(phi - self.offset, kind), self.friction(phi + self.offset, kind)

    def edge(self, phi, sense):
        """Next angle of the body at which a contact meets an edge."""
        ahead = []
        for side in (-1, 1):
            for edge in (self.start, self.start + self.width):
                way = (sense * (edge - side * self.offset - phi)) % (2 * pi)
                ahead.append(way if way > 1e-9 else 2 * pi)
        return phi + sense * min(ahead)

    def holds(self, phi):
        """Whether the body sticks at rest: static friction can balance its weight."""
        m1, m2 = self.coefficients(phi, 0)
        place = np.array([0.0, cos(phi), sin(phi)])
        return motion(self.body, -m1, -m2)[0] @ place <= 0.0 <= motion(self.body, m1, m2)[0] @ place

    def run(self, phi, omega):
        """Angle at which the body stops for good or loses a contact; that contact, or 0; and the time, s."""
        sense, u, t = (1 if omega > 0 else -1), omega * omega, 0.0
        for _ in range(200):
            end = self.edge(phi, sense)
            m1, m2 = self.coefficients(0.5 * (phi + end), 1)
            rows = motion(self.body, -sense * m1, -sense * m2)
            p, q, r = rows[0]
            A = -(4 * p * q + 2 * r) / (1 + 4 * p * p)
            B = 2 * p * A + 2 * q
            C = u - A * cos(phi) - B * sin(phi)

            def square(x, p=p, A=A, B=B, C=C, origin=phi):
                return C * np.exp(2 * p * (x - origin)) + A * np.cos(x) + B * np.sin(x)

            def gain(x, way, p=p, A=A, B=B, C=C, origin=phi):
                """Increase of `square` over the last `way` before x, without cancellation."""
                middle, half = x - 0.5 * way, np.sin(0.5 * way)
                exponential = C * np.exp(2 * p * (x - way - origin)) * np.expm1(2 * p * way)
                return exponential + 2.0 * half * (B * np.cos(middle) - A * np.sin(middle))

            def reaction(x, k, rows=rows, square=square):
                return rows[k] @ (square(x), np.cos(x), np.sin(x))

            ends = [(self.first(square, phi, end, 1e-9 if u == 0.0 else 0.0), "rest")]
            ends += [(self.first(lambda x, k=k: reaction(x, k), phi, end), k) for k in (1, 2)]
            at, what = min(ends, key=lambda pair: abs(pair[0] - phi))
            stop = min(at, end, key=lambda x: abs(x - phi))
            t += self.duration(square, gain, phi, stop, at == stop and what == "rest", u == 0.0)
            if at != stop:
                phi, u = end, square(end)
            elif what != "rest":
                return stop, what, t
            elif self.holds(stop):
                return stop, 0, t
            else:
                phi, u, sense = stop, 0.0, -sense
        raise AssertionError("the motion does not end")

    @staticmethod
    def first(f, start, end, skip=0.0):
        """First zero of a function that is positive at `start`, or infinity."""
        x = np.linspace(start + skip * np.sign(end - start), end, 4001)
        below = np.flatnonzero(f(x) <= 0.0)
        if not len(below):
            return inf
        k = below[0]
        return brentq(f, x[k - 1], x[k], xtol=1e-15, rtol=1e-15) if k else start

    @staticmethod
    def duration(square, gain, start, end, rests, rested):
        """Time between two angles by quadrature, s."""
        middle, sense = 0.5 * (start + end), np.sign(end - start)
        total = 0.0
        for place, still in ((start, rested), (end, rests)):
            way = middle - place
            fraction = 0.5 * (NODES + 1)
            # At rest u has a zero; the substitution phi = place + way z^2 removes the singularity of 1/omega.
            part, rate = (way * fraction**2, 2 * fraction) if still else (way * fraction, 1.0)
            speed = np.sqrt(gain(place + part, part) if still else square(place + part))
            total += 0.5 * abs(way) * (NODE_WEIGHTS * rate / speed).sum()
        return total if sense else 0.0
