/* Runge-Kutta 4 with a constant step for the paper's Fig. 29, as one would write it by hand for this scene alone:
 * two contacts, one rough arc centred on the ring's origin, Bengisu-Akay friction, arctan drive, body at rest at t = 0.
 *
 * It keeps the same account of a run as the package does (extremes, reversals, turns, stick time, least reactions,
 * separation placed within its step), except for the stiffness, which a hand-written code would not have.
 *
 *     cc -O3 -march=native -ffast-math -shared -fPIC rk4.c -o rk4.so -lm
 */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

enum { T_END, PHI_END, OMEGA_END, CONTACT, PHI_MIN, PHI_MAX, OMEGA_MIN, OMEGA_MAX, REVERSALS, TURNS, STICK_TIME,
       NORMAL_MIN_1, NORMAL_MIN_2, STEPS, COLUMNS };

typedef struct {
    double mass, inertia, half_distance, ball_radius, radius, gravity;
    double rough_s, rough_k, rest_s, rest_k, alpha, v0, epsilon_omega;
} scene_t;

typedef struct {
    double mass, radius, gravity, xi, beta, sin_beta, cos_beta, sin_2beta, cos_2beta, about_axis;
    double rough_s, rough_k, rest_s, rest_k, alpha, v0, amplitude, half_angle;
} cell_t;

typedef struct { double v, K1, K2, sin_phi, cos_phi, epsilon, D, inertia; } view_t;

static inline int on_arc(double angle, double half_angle)
{
    const double x = angle + half_angle;
    return x - 2.0 * M_PI * floor(x * (0.5 / M_PI)) < 2.0 * half_angle;
}

static inline view_t look(const cell_t *c, double phi, double omega, const double *drive)
{
    view_t w;
    w.v = (omega - c->amplitude * drive[1]) * c->radius;
    const double speed = fabs(w.v), sign = (w.v > 0.0) - (w.v < 0.0), rho = phi - c->amplitude * drive[0];
    double w_s, w_k;
    if (speed < c->v0) {
        const double rest = 1.0 - speed / c->v0;
        w_s = 1.0 - rest * rest;
        w_k = 0.0;
    } else {
        const double excess = c->alpha * (speed - c->v0);
        w_s = excess < 40.0 ? exp(-excess) : 0.0;
        w_k = 1.0 - w_s;
    }
    const double rough = -sign * (w_s * c->rough_s + w_k * c->rough_k);
    const double rest = -sign * (w_s * c->rest_s + w_k * c->rest_k);
    w.K1 = on_arc(rho - c->beta, c->half_angle) ? rough : rest;
    w.K2 = on_arc(rho + c->beta, c->half_angle) ? rough : rest;
    w.sin_phi = sin(phi);
    w.cos_phi = cos(phi);
    const double P = w.K1 * w.K2, RM = c->radius * c->mass;
    const double T = (w.K1 - w.K2) * c->cos_beta + 2.0 * P * c->sin_beta;
    w.D = (w.K1 - w.K2) * c->cos_2beta + (1.0 + P) * c->sin_2beta;
    w.inertia = c->about_axis * w.D - RM * c->xi * T;
    const double lift = (c->gravity * w.cos_phi + c->xi * omega * omega) * c->sin_beta;
    w.epsilon = (c->gravity * w.sin_phi * (RM * T - c->mass * c->xi * w.D) + RM * lift * (w.K1 + w.K2)) / w.inertia;
    return w;
}

static inline void reactions(const cell_t *c, const view_t *w, double omega, double *normal_1, double *normal_2)
{
    const double sb = c->sin_beta, cb = c->cos_beta, g = c->gravity;
    const double centripetal = c->xi * omega * omega, inertial = c->xi * w->epsilon, scale = c->mass / w->D;
    *normal_1 = scale * (g * (w->sin_phi * cb + w->cos_phi * sb) + centripetal * sb + inertial * cb
                         - w->K2 * (g * (w->cos_phi * cb - w->sin_phi * sb) + centripetal * cb - inertial * sb));
    *normal_2 = scale * (centripetal * sb - g * (w->sin_phi * cb - w->cos_phi * sb) - inertial * cb
                         + w->K1 * (g * (w->cos_phi * cb + w->sin_phi * sb) + centripetal * cb + inertial * sb));
}

static inline double hermite(double y, double rate, double y_next, double rate_next, double h, double x)
{
    return (1.0 + 2.0 * x) * (1.0 - x) * (1.0 - x) * y + x * x * (3.0 - 2.0 * x) * y_next
           + h * x * (1.0 - x) * (1.0 - x) * rate + h * x * x * (x - 1.0) * rate_next;
}

static void integrate(const cell_t *c, double epsilon_omega, const double *table, int64_t steps, double h, double *out)
{
    double phi = 0.0, omega = 0.0, n1, n2, t = steps * h;
    view_t now = look(c, phi, omega, table);
    reactions(c, &now, omega, &n1, &n2);
    double phi_min = phi, phi_max = phi, omega_min = omega, omega_max = omega, lowest = phi, highest = phi;
    double least_1 = n1, least_2 = n2, stuck = 0.0;
    int sense = 0, reversals = 0, contact = 0;
    int64_t k;
    for (k = 0; k < steps && !contact; k++) {
        const double *drive = table + 4 * k;
        const double a1 = omega, b1 = now.epsilon;
        const double a2 = omega + 0.5 * h * b1, b2 = look(c, phi + 0.5 * h * a1, a2, drive + 2).epsilon;
        const double a3 = omega + 0.5 * h * b2, b3 = look(c, phi + 0.5 * h * a2, a3, drive + 2).epsilon;
        const double a4 = omega + h * b3, b4 = look(c, phi + h * a3, a4, drive + 4).epsilon;
        double phi_next = phi + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4);
        double omega_next = omega + h / 6.0 * (b1 + 2.0 * (b2 + b3) + b4);
        const view_t after = look(c, phi_next, omega_next, drive + 4);
        double after_1, after_2, fraction = 1.0;
        reactions(c, &after, omega_next, &after_1, &after_2);
        if (!(after.D > 0.0 && after.inertia > 0.0))
            contact = -1;
        else {
            if (after_1 <= 0.0) {
                contact = 1;
                fraction = n1 > after_1 ? n1 / (n1 - after_1) : 0.0;
            }
            if (after_2 <= 0.0) {
                const double second = n2 > after_2 ? n2 / (n2 - after_2) : 0.0;
                if (!contact || second < fraction) {
                    contact = 2;
                    fraction = second;
                }
            }
        }
        if (contact) {
            const double end = hermite(phi, a1, phi_next, omega_next, h, fraction);
            omega_next = hermite(omega, b1, omega_next, after.epsilon, h, fraction);
            phi_next = end;
            t = (k + fraction) * h;
        }
        if (fabs(now.v) < c->v0 || now.v * after.v < 0.0)
            stuck += fraction * h;
        phi = phi_next;
        omega = omega_next;
        now = after;
        n1 = after_1;
        n2 = after_2;
        lowest = fmin(lowest, phi);
        highest = fmax(highest, phi);
        if (omega > epsilon_omega && sense < 1) {
            if (sense == -1) {
                reversals++;
                highest = fmax(lowest, phi);
            }
            sense = 1;
        } else if (omega < -epsilon_omega && sense > -1) {
            if (sense == 1) {
                reversals++;
                lowest = fmin(highest, phi);
            }
            sense = -1;
        }
        phi_min = fmin(phi_min, phi);
        phi_max = fmax(phi_max, phi);
        omega_min = fmin(omega_min, omega);
        omega_max = fmax(omega_max, omega);
        least_1 = fmin(least_1, n1);
        least_2 = fmin(least_2, n2);
    }
    out[T_END] = t;
    out[PHI_END] = phi;
    out[OMEGA_END] = omega;
    out[CONTACT] = contact;
    out[PHI_MIN] = phi_min;
    out[PHI_MAX] = phi_max;
    out[OMEGA_MIN] = omega_min;
    out[OMEGA_MAX] = omega_max;
    out[REVERSALS] = reversals;
    out[TURNS] = floor((highest - lowest) / (2.0 * M_PI));
    out[STICK_TIME] = stuck;
    out[NORMAL_MIN_1] = fmax(least_1, 0.0);
    out[NORMAL_MIN_2] = fmax(least_2, 0.0);
    out[STEPS] = k;
}

/* Run cells that share span and steps, hence one table of the drive's shape at whole and half steps.
 * Returns the number of columns of `out`, or -1 if there is no memory. */
int64_t run(int64_t cells, const double *amplitude, const double *half_angle, const scene_t *s, int64_t steps,
            double span, double *out)
{
    const double h = span / steps, sin_beta = s->half_distance / (s->radius - s->ball_radius);
    const double cos_beta = sqrt(1.0 - sin_beta * sin_beta), xi = (s->radius - s->ball_radius) * cos_beta;
    double *table = malloc((2 * steps + 1) * 2 * sizeof(double));
    if (!table)
        return -1;
    for (int64_t k = 0; k <= 2 * steps; k++) {
        const double t = 0.5 * k * h, rate = atan(t);
        table[2 * k] = t * rate - 0.5 * log1p(t * t);
        table[2 * k + 1] = rate;
    }
    for (int64_t i = 0; i < cells; i++) {
        const cell_t c = {s->mass, s->radius, s->gravity, xi, asin(sin_beta), sin_beta, cos_beta,
                          2.0 * sin_beta * cos_beta, cos_beta * cos_beta - sin_beta * sin_beta,
                          s->inertia + s->mass * xi * xi, s->rough_s, s->rough_k, s->rest_s, s->rest_k,
                          s->alpha, s->v0, amplitude[i], half_angle[i]};
        integrate(&c, s->epsilon_omega, table, steps, h, out + i * COLUMNS);
    }
    free(table);
    return COLUMNS;
}
