/* Moreau and Jean's time stepping for the body of the paper's Fig. 29 with Coulomb friction and impacts.
 *
 * Positions move with the midpoint rule. Where a gap is closed at the midpoint, the impulses of the step satisfy Newton's
 * law of restitution with Moreau's complementarity and Coulomb's law at the end of the step (Acary and Brogliato 2008,
 * chapter 10). A step has at most two contacts, so that Gauss and Seidel's iteration solves one contact after the other
 * by trial of its modes.
 */
#include <math.h>
#include <stdint.h>

enum { PHI_END, T_SEPARATION, COLUMNS };
enum { SWEEPS = 200 };

/* Relative change of the impulses at which the iteration ends, far below the error of a step. */
#define CONVERGED 1e-9

/* A contact is lost if it has no impulse in so many steps in turn: at rest rounding takes single ones away. */
enum { LOST = 3 };

typedef struct {
    double mass, inertia, half_distance, ball_radius, radius, gravity, rough, rest, restitution;
} scene_t;

typedef struct { double normal[3], tangent[3], G[2][2], surface, mu, before, impulse[2]; int closed; } contact_t;

static inline double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* Gap and Jacobians of contact i (0 or 1) at q = (x, y, psi). */
static double geometry(const scene_t *s, const double *q, int i, contact_t *c, double *place)
{
    const double a = i ? s->half_distance : -s->half_distance;
    const double bx = a * cos(q[2]), by = a * sin(q[2]), cx = q[0] + bx, cy = q[1] + by;
    const double distance = sqrt(cx * cx + cy * cy), ux = cx / distance, uy = cy / distance;
    c->normal[0] = -ux, c->normal[1] = -uy, c->normal[2] = -(uy * bx - ux * by);
    c->tangent[0] = -uy, c->tangent[1] = ux, c->tangent[2] = ux * bx + uy * by + s->ball_radius;
    *place = atan2(ux, -uy);
    return s->radius - s->ball_radius - distance;
}

/* Impulses at one contact from its velocities without them: open, stick, or slip either way. */
static void solve(contact_t *c, double e, double un, double ut)
{
    const double target = -e * c->before - un, (*G)[2] = c->G;
    c->impulse[0] = c->impulse[1] = 0.0;
    if (target <= 0.0)
        return;
    const double det = G[0][0] * G[1][1] - G[0][1] * G[1][0];
    const double n = (target * G[1][1] + ut * G[0][1]) / det, t = (-ut * G[0][0] - target * G[1][0]) / det;
    if (fabs(t) <= c->mu * n) {
        c->impulse[0] = n, c->impulse[1] = t;
        return;
    }
    const double side = t > 0.0 ? c->mu : -c->mu;
    c->impulse[0] = target / (G[0][0] + side * G[0][1]);
    c->impulse[1] = side * c->impulse[0];
}

void run(int64_t cells, const double *amplitude, const double *half_angle, const scene_t *s, int64_t steps,
         double span, double *out)
{
    const double h = span / steps, turn = 2.0 * M_PI;
    const double reach = s->radius - s->ball_radius, beta = asin(s->half_distance / reach);
    const double weight[3] = {1.0 / s->mass, 1.0 / s->mass, 1.0 / s->inertia};
    for (int64_t k = 0; k < cells; k++) {
        double q[3] = {0.0, -reach * cos(beta), 0.0}, v[3] = {0.0, 0.0, 0.0}, separation = NAN;
        int without[2] = {0, 0};
        for (int64_t n = 0; n < steps; n++) {
            const double t = (n + 0.5) * h, end = (n + 1) * h, rate = amplitude[k] * atan(end);
            const double theta = amplitude[k] * (t * atan(t) - 0.5 * log1p(t * t));
            contact_t c[2];
            for (int j = 0; j < 3; j++)
                q[j] += 0.5 * h * v[j];
            for (int i = 0; i < 2; i++) {
                double place;
                c[i].closed = geometry(s, q, i, &c[i], &place) <= 0.0;
                c[i].impulse[0] = c[i].impulse[1] = 0.0;
                if (!c[i].closed)
                    continue;
                const double x = place - theta;
                c[i].mu = fabs(x - turn * nearbyint(x / turn)) < half_angle[k] ? s->rough : s->rest;
                c[i].before = dot(c[i].normal, v);
                const double *rows[2] = {c[i].normal, c[i].tangent};
                for (int a = 0; a < 2; a++)
                    for (int b = 0; b < 2; b++) {
                        c[i].G[a][b] = 0.0;
                        for (int j = 0; j < 3; j++)
                            c[i].G[a][b] += rows[a][j] * rows[b][j] * weight[j];
                    }
            }
            v[1] -= h * s->gravity;
            if (c[0].closed || c[1].closed) {
                double change = 1.0, size = 0.0;
                for (int m = 0; m < SWEEPS && change > CONVERGED * size; m++) {
                    change = size = 0.0;
                    for (int i = 0; i < 2; i++) {
                        if (!c[i].closed)
                            continue;
                        const double old[2] = {c[i].impulse[0], c[i].impulse[1]};
                        for (int j = 0; j < 3; j++)
                            v[j] -= weight[j] * (c[i].normal[j] * old[0] + c[i].tangent[j] * old[1]);
                        solve(&c[i], s->restitution, dot(c[i].normal, v), dot(c[i].tangent, v) - s->radius * rate);
                        for (int j = 0; j < 3; j++)
                            v[j] += weight[j] * (c[i].normal[j] * c[i].impulse[0] + c[i].tangent[j] * c[i].impulse[1]);
                        change = fmax(change, fabs(c[i].impulse[0] - old[0]) + fabs(c[i].impulse[1] - old[1]));
                        size = fmax(size, fabs(c[i].impulse[0]) + fabs(c[i].impulse[1]));
                    }
                }
            }
            for (int i = 0; i < 2; i++) {
                without[i] = c[i].impulse[0] > 0.0 ? 0 : without[i] + 1;
                if (isnan(separation) && without[i] == LOST)
                    separation = end - (LOST - 1) * h;
            }
            for (int j = 0; j < 3; j++)
                q[j] += 0.5 * h * v[j];
        }
        out[k * COLUMNS + PHI_END] = q[2];
        out[k * COLUMNS + T_SEPARATION] = separation;
    }
}
