/* Runge-Kutta 4 with a constant step for the paper's Fig. 29, vectorised by hand: how fast the method can be.
 *
 * Two contacts, one rough arc centred on the ring's origin, Bengisu-Akay friction, arctan drive, body at rest at t = 0.
 * The account of a run: end angle and velocity, least reactions, reversals. No run ends at separation.
 *
 * A vector holds eight runs. GROUPS vectors advance together, so that one group computes while another waits. A stage
 * has one division. Sine and cosine are rotated from stage to stage, and computed anew every REFRESH steps. Powers are
 * skipped where every run is within the band |v| < v0 or far outside.
 *
 *     c++ -O3 -march=native -fno-math-errno -fno-trapping-math -fno-signed-zeros -ffinite-math-only
 *         -fschedule-insns -fsched-pressure -shared -fPIC vector.cpp -o vector.so
 */
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>
#ifdef __AVX512DQ__
#include <immintrin.h>
#endif

typedef double pack __attribute__((vector_size(64)));
typedef int64_t bits __attribute__((vector_size(64)));

enum { LANES = 8, GROUPS = 4, RUNS = LANES * GROUPS, REFRESH = 64 };
enum { PHI_END, OMEGA_END, NORMAL_MIN_1, NORMAL_MIN_2, REVERSALS, COLUMNS };

#define INLINE static inline __attribute__((always_inline))
#define EACH for (int i = 0; i < GROUPS; i++)

static const double TURN = 2.0 * M_PI;
/* Half the powers of 1/2 that count beside 1. */
static const double FEW = 30.0;
/* A sum with this has an integer in its low bits; this taken away again leaves the integer. */
static const double ROUND = 6755399441055744.0;

struct scene_t {
    double mass, inertia, half_distance, ball_radius, radius, gravity;
    double rough_s, rough_k, rest_s, rest_k, alpha, v0;
};

/* With K = -sign(v) mu(v), S = K1 + K2, T = K1 - K2, P = K1 K2 and L = cos phi + xi omega^2 / g,
 *     epsilon = (sin phi (s0 + sT T + sP P) + L S) / (q0 + qT T + qP P),
 *     N1 = (sin phi (a + b K2) + L (c - d K2)) / (q0 + qT T + qP P),
 *     N2 = (L (c + d K1) - sin phi (a - b K1)) / (q0 + qT T + qP P). */
struct constants_t {
    double s0, sT, sP, q0, qT, qP, xi_g, a, b, c, d;
    double rough_s, rough_k, rest_s, rest_k, band, per_band, decay, lift, place;
};

struct angle_t { pack sine, cosine; };

INLINE pack all(double x) { return x - pack{}; }
INLINE pack magnitude(pack x) { return (pack)((bits)x & INT64_MAX); }
INLINE pack least(pack x, pack y) { return x < y ? x : y; }
INLINE pack rounded(pack x) { return (x + ROUND) - ROUND; }
INLINE bool any(bits mask)
{
#ifdef __AVX512DQ__
    return _mm512_movepi64_mask((__m512i)mask);
#else
    int64_t sum = 0;
    for (int j = 0; j < LANES; j++)
        sum |= mask[j];
    return sum;
#endif
}

/* Taylor polynomial of x; coefficients from the last to the first. */
INLINE pack polynomial(pack, pack sum) { return sum; }
template <class... Rest> INLINE pack polynomial(pack x, pack sum, double next, Rest... rest)
{
    return polynomial(x, sum * x + next, rest...);
}

/* 2^-(x + FEW) for -FEW <= x < 900: sixteenths from a table, and a polynomial for the rest. */
INLINE pack halved(pack x)
{
    const pack low = {1.0000000000000000, 1.0442737824274138, 1.0905077326652577, 1.1387886347566916,
                      1.1892071150027210, 1.2418578120734840, 1.2968395546510096, 1.3542555469368927};
    const pack high = {1.4142135623730951, 1.4768261459394993, 1.5422108254079407, 1.6104903319492543,
                       1.6817928305074290, 1.7562521603732995, 1.8340080864093424, 1.9152065613971474};
    const pack shifted = (ROUND / 16.0 - FEW) - x, r = ((ROUND / 16.0 - FEW) - shifted) - x;
    const pack root = __builtin_shuffle(low, high, (bits)shifted);
    const pack z = r * r;
    const pack even = polynomial(z, all(1.5403530393381606e-04), 9.6181291076284769e-03, 2.4022650695910069e-01);
    const pack odd = polynomial(z, all(1.3333558146428441e-03), 5.5504108664821576e-02, 6.9314718055994529e-01);
    const pack p = even * z + odd * r;
    return (pack)((bits)(root * p + root) + ((bits)shifted >> 4 << 52));
}

INLINE angle_t angle(pack x)
{
    const pack shifted = x * (4.0 / TURN) + ROUND, k = shifted - ROUND;
    const pack r = (x - k * 1.5707963267948966) - k * 6.1232339957367659e-17, z = r * r;
    const pack s = r * polynomial(z, all(-1.0 / 1307674368000), 1.0 / 6227020800, -1.0 / 39916800, 1.0 / 362880,
                                  -1.0 / 5040, 1.0 / 120, -1.0 / 6, 1.0);
    const pack c = polynomial(z, all(1.0 / 20922789888000), -1.0 / 87178291200, 1.0 / 479001600, -1.0 / 3628800,
                              1.0 / 40320, -1.0 / 720, 1.0 / 24, -0.5, 1.0);
    const bits quarters = (bits)shifted;
    const pack sine = quarters & 1 ? c : s, cosine = quarters & 1 ? s : c;
    return {(pack)((bits)sine ^ (quarters & 2) << 62), (pack)((bits)cosine ^ ((quarters + 1) & 2) << 62)};
}

INLINE angle_t sum(angle_t from, pack s, pack c)
{
    return {from.sine * c + from.cosine * s, from.cosine * c - from.sine * s};
}

/* The angle d further, to d^8. */
INLINE angle_t turned(angle_t from, pack d)
{
    const pack z = d * d;
    return sum(from, d + d * z * polynomial(z, all(-1.0 / 5040), 1.0 / 120, -1.0 / 6),
               polynomial(z, all(-1.0 / 720), 1.0 / 24, -0.5, 1.0));
}

/* The angle d further, to d^4; d is of the order of the squared step. */
INLINE angle_t nudged(angle_t from, pack d)
{
    const pack z = d * d;
    return sum(from, d - d * z * (1.0 / 6), 1.0 - 0.5 * z);
}

/* Whether a contact is on the rough arc; x in turns, between -3/2 and 3/2. */
INLINE bits on_arc(pack x, pack smooth_half) { return magnitude(magnitude(x) - 0.5) > smooth_half; }

/* Friction over reaction; beyond the band the friction coefficient is `outside`. */
INLINE pack friction(const constants_t &c, pack slip, pack speed, double mu_s, pack outside)
{
    const pack x = 1.0 - speed * c.per_band;
    const pack mu = speed < c.band ? (1.0 - x * x) * mu_s : outside;
    return (pack)((bits)mu ^ (~(bits)slip & INT64_MIN));
}

/* `turns` are whole turns of a body about the ring, so that places stay within a turn. */
struct runs_t {
    pack amplitude, per_turn, smooth_half, phi, omega, turns, least_1, least_2, reversals;
    angle_t angle;
};

/* Angular accelerations. At the first stage of a step (FIRST) also least reactions. */
template <bool FIRST>
INLINE void stage(const constants_t &c, runs_t *runs, const pack *phi, const pack *omega, const angle_t *at,
                  const double *drive, pack *epsilon)
{
    pack slip[GROUPS], speed[GROUPS], excess[GROUPS], rough[GROUPS], rest[GROUPS];
    pack nearest = all(FEW);
    EACH {
        slip[i] = omega[i] - runs[i].amplitude * drive[1];
        speed[i] = magnitude(slip[i]);
        excess[i] = speed[i] * c.decay - (c.lift + FEW);
        nearest = least(magnitude(excess[i]), nearest);
    }
    if (any(nearest < FEW))
        EACH {
            const pack power = halved(least(excess[i], all(100.0)));
            rough[i] = friction(c, slip[i], speed[i], c.rough_s, (c.rough_s - c.rough_k) * power + c.rough_k);
            rest[i] = friction(c, slip[i], speed[i], c.rest_s, (c.rest_s - c.rest_k) * power + c.rest_k);
        }
    else
        EACH {
            rough[i] = friction(c, slip[i], speed[i], c.rough_s, all(c.rough_k));
            rest[i] = friction(c, slip[i], speed[i], c.rest_s, all(c.rest_k));
        }
    EACH {
        const pack place = phi[i] * (1.0 / TURN) - (runs[i].per_turn * drive[0] + runs[i].turns);
        const pack K1 = on_arc(place - c.place, runs[i].smooth_half) ? rough[i] : rest[i];
        const pack K2 = on_arc(place + c.place, runs[i].smooth_half) ? rough[i] : rest[i];
        const pack T = K1 - K2, P = K1 * K2, L = omega[i] * omega[i] * c.xi_g + at[i].cosine;
        const pack q = T * c.qT + (P * c.qP + c.q0);
        const pack torque = at[i].sine * (T * c.sT + (P * c.sP + c.s0)) + L * (K1 + K2);
        if (!FIRST) {
            epsilon[i] = torque / q;
            continue;
        }
        const pack inverse = 1.0 / q;
        epsilon[i] = torque * inverse;
        const pack N1 = (at[i].sine * (K2 * c.b + c.a) + L * (c.c - K2 * c.d)) * inverse;
        const pack N2 = (L * (K1 * c.d + c.c) - at[i].sine * (c.a - K1 * c.b)) * inverse;
        runs[i].least_1 = least(N1, runs[i].least_1);
        runs[i].least_2 = least(N2, runs[i].least_2);
    }
}

static void integrate(const constants_t &c, runs_t *runs, const double *table, int64_t steps, double h)
{
    const double half = 0.5 * h;
    for (int64_t k = 0; k < steps; k++) {
        const double *drive = table + 4 * k;
        pack x1[GROUPS], x2[GROUPS], x3[GROUPS], x4[GROUPS], u1[GROUPS], u2[GROUPS], u3[GROUPS], u4[GROUPS];
        pack a1[GROUPS], a2[GROUPS], a3[GROUPS], a4[GROUPS];
        angle_t at[GROUPS];
        EACH {
            x1[i] = runs[i].phi;
            u1[i] = runs[i].omega;
            at[i] = k % REFRESH ? runs[i].angle : angle(x1[i]);
        }
        stage<true>(c, runs, x1, u1, at, drive, a1);
        EACH {
            at[i] = turned(at[i], half * u1[i]);
            x2[i] = x1[i] + half * u1[i];
            u2[i] = u1[i] + half * a1[i];
        }
        stage<false>(c, runs, x2, u2, at, drive + 2, a2);
        EACH {
            at[i] = nudged(at[i], half * half * a1[i]);
            x3[i] = x1[i] + half * u2[i];
            u3[i] = u1[i] + half * a2[i];
        }
        stage<false>(c, runs, x3, u3, at, drive + 2, a3);
        EACH {
            at[i] = turned(at[i], h * u3[i] - half * u2[i]);
            x4[i] = x1[i] + h * u3[i];
            u4[i] = u1[i] + h * a3[i];
        }
        stage<false>(c, runs, x4, u4, at, drive + 4, a4);
        EACH {
            const pack three = a1[i] + (a2[i] + a3[i]), way = h * u1[i] + (h * h / 6.0) * three;
            const pack omega = u1[i] + (h / 6.0) * (three + (a2[i] + a3[i] + a4[i]));
            runs[i].angle = nudged(at[i], way - h * u3[i]);
            runs[i].phi = x1[i] + way;
            runs[i].reversals += omega * u1[i] < 0.0 ? all(1.0) : all(0.0);
            runs[i].omega = omega;
            runs[i].turns = rounded(runs[i].phi * (1.0 / TURN) - runs[i].per_turn * drive[4]);
        }
    }
}

/* Run cells that share span and steps, hence one table of the drive's shape at whole and half steps. */
extern "C" void run(int64_t cells, const double *amplitude, const double *half_angle, const scene_t *s, int64_t steps,
                    double span, double *out)
{
    const double h = span / steps, sb = s->half_distance / (s->radius - s->ball_radius), cb = std::sqrt(1.0 - sb * sb);
    const double xi = (s->radius - s->ball_radius) * cb, about_axis = s->inertia + s->mass * xi * xi;
    const double arm = s->mass * xi / about_axis, torque = s->radius * s->mass * s->gravity * sb;
    const double share = 1.0 - arm * xi, far = arm * s->radius, normal = about_axis / (s->radius * sb);
    const constants_t c = {
        -s->mass * s->gravity * xi * 2.0 * sb * cb / torque,
        s->mass * s->gravity * (s->radius * cb - xi * (cb * cb - sb * sb)) / torque,
        s->mass * s->gravity * 2.0 * sb * (s->radius - xi * cb) / torque,
        about_axis * 2.0 * sb * cb / torque,
        about_axis * (cb * cb - sb * sb - far * cb) / torque,
        about_axis * 2.0 * sb * (cb - far) / torque,
        xi / s->gravity, normal * share * cb, normal * share * sb, normal * sb, normal * (cb - far),
        s->rough_s, s->rough_k, s->rest_s, s->rest_k, s->v0 / s->radius, s->radius / s->v0,
        s->alpha * s->radius * M_LOG2E, s->alpha * s->v0 * M_LOG2E, std::asin(sb) / TURN,
    };
    std::vector<double> table(4 * steps + 2);
    for (int64_t k = 0; k <= 2 * steps; k++) {
        const double t = 0.5 * k * h, rate = std::atan(t);
        table[2 * k] = t * rate - 0.5 * std::log1p(t * t);
        table[2 * k + 1] = rate;
    }
    for (int64_t first = 0; first < cells; first += RUNS) {
        runs_t runs[GROUPS] = {};
        EACH {
            runs[i].least_1 = runs[i].least_2 = all(1e300);
            for (int j = 0; j < LANES; j++) {
                const int64_t cell = std::min(first + LANES * i + j, cells - 1);
                runs[i].amplitude[j] = amplitude[cell];
                runs[i].per_turn[j] = amplitude[cell] / TURN;
                runs[i].smooth_half[j] = 0.5 - half_angle[cell] / TURN;
            }
        }
        integrate(c, runs, table.data(), steps, h);
        for (int64_t cell = first; cell < std::min(first + RUNS, cells); cell++) {
            const int i = (cell - first) / LANES, j = (cell - first) % LANES;
            double *to = out + cell * COLUMNS;
            to[PHI_END] = runs[i].phi[j];
            to[OMEGA_END] = runs[i].omega[j];
            to[NORMAL_MIN_1] = runs[i].least_1[j];
            to[NORMAL_MIN_2] = runs[i].least_2[j];
            to[REVERSALS] = runs[i].reversals[j];
        }
    }
}
