/* Runge-Kutta 4 with a constant step for the paper's Fig. 29, written down as the paper has it: the unit of the speed.
 *
 * Nothing is shared between stages, and nothing is computed before the run. See vector.cpp for the same method made
 * fast, and rk4.c for a code with the account of the package.
 */
#include <math.h>
#include <stdint.h>

enum { PHI_END, OMEGA_END, NORMAL_MIN_1, NORMAL_MIN_2, REVERSALS, COLUMNS };

typedef struct {
    double mass, inertia, half_distance, ball_radius, radius, gravity;
    double rough_s, rough_k, rest_s, rest_k, alpha, v0;
} scene_t;

typedef struct { double half_angle, beta, xi, about_axis; } cell_t;

static inline double friction(const scene_t *s, double v, double mu_s, double mu_k)
{
    const double speed = fabs(v), rest = 1.0 - speed / s->v0;
    const double mu = speed < s->v0 ? mu_s * (1.0 - rest * rest)
                                    : mu_k + (mu_s - mu_k) * exp(-s->alpha * (speed - s->v0));
    return v > 0.0 ? -mu : v < 0.0 ? mu : 0.0;
}

/* Friction over reaction, at a contact whose place on the ring is `angle`. */
static inline double ratio(const scene_t *s, const cell_t *c, double angle, double v)
{
    const double x = angle + c->half_angle;
    if (x - 2.0 * M_PI * floor(x / (2.0 * M_PI)) < 2.0 * c->half_angle)
        return friction(s, v, s->rough_s, s->rough_k);
    return friction(s, v, s->rest_s, s->rest_k);
}

/* Angular acceleration and both reactions, from the two balances of forces and the balance of moments. */
static inline double balance(const scene_t *s, const cell_t *c, const double *ring, double phi, double omega,
                             double *normal_1, double *normal_2)
{
    const double sb = sin(c->beta), cb = cos(c->beta), xi = c->xi, arm = s->mass * xi / c->about_axis;
    const double v = (omega - ring[1]) * s->radius, rho = phi - ring[0];
    const double K1 = ratio(s, c, rho - c->beta, v), K2 = ratio(s, c, rho + c->beta, v);
    const double a11 = cb - K1 * sb, a12 = cb + K2 * sb;
    const double a21 = sb + K1 * cb - arm * s->radius * K1, a22 = K2 * cb - sb - arm * s->radius * K2;
    const double radial = s->mass * (s->gravity * cos(phi) + xi * omega * omega);
    const double tangential = s->mass * s->gravity * sin(phi) * (1.0 - arm * xi), D = a11 * a22 - a12 * a21;
    *normal_1 = (radial * a22 - a12 * tangential) / D;
    *normal_2 = (a11 * tangential - a21 * radial) / D;
    const double moment = s->radius * (K1 * *normal_1 + K2 * *normal_2) - s->mass * s->gravity * xi * sin(phi);
    return moment / c->about_axis;
}

/* Angle and angular velocity of the ring. */
static inline void drive(double t, double amplitude, double *ring)
{
    ring[1] = amplitude * atan(t);
    ring[0] = ring[1] * t - amplitude * 0.5 * log(1.0 + t * t);
}

void run(int64_t cells, const double *amplitude, const double *half_angle, const scene_t *s, int64_t steps,
         double span, double *out)
{
    const double h = span / steps, beta = asin(s->half_distance / (s->radius - s->ball_radius));
    const double xi = (s->radius - s->ball_radius) * cos(beta);
    for (int64_t i = 0; i < cells; i++) {
        const cell_t c = {half_angle[i], beta, xi, s->inertia + s->mass * xi * xi};
        double phi = 0.0, omega = 0.0, least_1 = INFINITY, least_2 = INFINITY, n1, n2, x, y;
        int64_t reversals = 0;
        for (int64_t k = 0; k < steps; k++) {
            double start[2], middle[2], end[2];
            drive(k * h, amplitude[i], start);
            drive((k + 0.5) * h, amplitude[i], middle);
            drive((k + 1) * h, amplitude[i], end);
            const double a1 = omega, b1 = balance(s, &c, start, phi, omega, &n1, &n2);
            const double a2 = omega + 0.5 * h * b1, b2 = balance(s, &c, middle, phi + 0.5 * h * a1, a2, &x, &y);
            const double a3 = omega + 0.5 * h * b2, b3 = balance(s, &c, middle, phi + 0.5 * h * a2, a3, &x, &y);
            const double a4 = omega + h * b3, b4 = balance(s, &c, end, phi + h * a3, a4, &x, &y);
            const double next = omega + h / 6.0 * (b1 + 2.0 * (b2 + b3) + b4);
            phi += h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4);
            least_1 = fmin(least_1, n1);
            least_2 = fmin(least_2, n2);
            reversals += next * omega < 0.0;
            omega = next;
        }
        double *to = out + i * COLUMNS;
        to[PHI_END] = phi;
        to[OMEGA_END] = omega;
        to[NORMAL_MIN_1] = least_1;
        to[NORMAL_MIN_2] = least_2;
        to[REVERSALS] = (double)reversals;
    }
}
