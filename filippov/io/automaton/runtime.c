/* ---- method: one step of Dormand and Prince's pair, and roots on it --------------------------------------- */

#define EPS 2.220446049250313e-16
#define DEGREE 8
#define CLEAR 1e-6       /* part of the terms of a rate below which its sign is not trusted */
#define NO_RATE 1e-12    /* and below which it is none */
#define INSTANT 1.42e-14 /* error of the time of an event, over |t| */
#define SAME 1e-12       /* events closer than this part of the time run pile up */
#define SHORTEST 1e-10   /* of t: a flight between impacts that cannot be followed */
#define ONE_STATE 1e-9   /* of their size: states that are one */
#define MOST_ORDERS 6    /* resets of one instant that are tried in every order */
#define NEAR_FOLD 1e-3   /* a slide whose rates differ by less of what they did is near a two-fold */

static const double NODES[5] = {1. / 5, 3. / 10, 4. / 5, 8. / 9, 1.};
static const double STAGES[5][5] = {
    {1. / 5},
    {3. / 40, 9. / 40},
    {44. / 45, -56. / 15, 32. / 9},
    {19372. / 6561, -25360. / 2187, 64448. / 6561, -212. / 729},
    {9017. / 3168, -355. / 33, 46732. / 5247, 49. / 176, -5103. / 18656}};
static const double WEIGHTS[6] = {35. / 384, 0., 500. / 1113, 125. / 192, -2187. / 6784, 11. / 84};
static const double ERROR[7] = {-71. / 57600, 0., 71. / 16695, -71. / 1920, 17253. / 339200, -22. / 525, 1. / 40};
static const double DENSE[7][4] = {
    {1., -8048581381. / 2820520608., 8663915743. / 2820520608., -12715105075. / 11282082432.},
    {0., 0., 0., 0.},
    {0., 131558114200. / 32700410799., -68118460800. / 10900136933., 87487479700. / 32700410799.},
    {0., -1754552775. / 470086768., 14199869525. / 1410260304., -10690763975. / 1880347072.},
    {0., 127303824393. / 49829197408., -318862633887. / 49829197408., 701980252875. / 199316789632.},
    {0., -282668133. / 205662961., 2019193451. / 616988883., -1453857185. / 822651844.},
    {0., 40617522. / 29380423., -110615467. / 29380423., 69997945. / 29380423.}};
static const double PROBES[4] = {0.085, 0.31, 0.63, 0.925};

enum { SUCCESS, CORNER, TANGENCY, TWO_FOLD, NON_UNIQUE, NO_SLIDING, ZENO, NON_LIPSCHITZ, NOT_FINITE, MIN_STEP, MAX_STEPS,
       BAD_ARGUMENT };
static const char *const STATUS[] = {"success", "corner", "tangency", "two-fold", "non_unique", "no_sliding", "zeno",
                                     "non_lipschitz", "not_finite", "min_step", "max_steps", "bad_argument"};
enum { WATCH_H, WATCH_UPPER, WATCH_LOWER };

typedef struct {
    double t, length, x[N], end[N], error[N], powers[N][4];
} Step;

/* What happened on a surface or clock; kind is crossing, sliding entry, sliding exit, reset or time event. */
typedef void (*EventHandler)(double t, const char *surface, const char *kind, const int *before, const int *after,
                             const double *x, void *user);

typedef struct {
    double t, first, x[N], p[P], rtol, atol, length, last, since[M], widest[M], clocks[CLOCKS][TIMES], waiting[CLOCKS];
    int m[M], order[M], crowd, status, surface;
    int still[M]; /* kinks that the state stays on until the next event: h is not watched, and has to stay 0 */
    long room;
    EventHandler handler;
    void *user;
    jmp_buf out;
} Run;

/* Ends the run by name, at a surface: a run never guesses. */
static void refuse(Run *r, int status, int surface) {
    r->status = status;
    r->surface = surface;
    longjmp(r->out, 1);
}

static double binomial(int n, int k) {
    double out = 1;
    for (int i = 1; i <= k; i++) out = out * (n - k + i) / i;
    return out;
}

static double bernstein(int degree, int j, double theta) {
    return binomial(degree, j) * pow(theta, j) * pow(1 - theta, degree - j);
}

static double place(int k) { return 0.5 - 0.5 * cos(3.14159265358979323846 * k / DEGREE); }

/* Coefficients in Bernstein form of the polynomial with nine values at the places: elimination with pivots. */
static void coefficients(const double *values, double *c) {
    double a[DEGREE + 1][DEGREE + 2];
    int n = DEGREE + 1;
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) a[i][j] = bernstein(DEGREE, j, place(i));
        a[i][n] = values[i];
    }
    for (int q = 0; q < n; q++) {
        int best = q;
        for (int i = q + 1; i < n; i++)
            if (fabs(a[i][q]) > fabs(a[best][q])) best = i;
        for (int j = 0; j <= n; j++) {
            double held = a[q][j];
            a[q][j] = a[best][j];
            a[best][j] = held;
        }
        for (int i = 0; i < n; i++) {
            double factor = a[i][q] / a[q][q];
            if (i != q)
                for (int j = q; j <= n; j++) a[i][j] -= factor * a[q][j];
        }
    }
    for (int i = 0; i < n; i++) c[i] = a[i][n] / a[i][i];
}

/* The first theta in [0, 1] where a polynomial that starts above 0 is no longer so, 2 if it stays; c is changed. */
static double first_zero(const double *c, int degree, double low, double high) {
    double left[DEGREE + 1], right[DEGREE + 1], q[DEGREE + 1], found;
    int positive = 1;
    for (int i = 0; i <= degree; i++) positive &= c[i] > 0;
    if (positive) return 2;
    if (c[0] <= 0) return low;
    if (high - low < 1e-9) return c[degree] <= 0 ? high : 2;
    for (int i = 0; i <= degree; i++) q[i] = c[i];
    left[0] = q[0];
    right[degree] = q[degree];
    for (int k = degree; k > 0; k--) {
        for (int i = 0; i < k; i++) q[i] = 0.5 * (q[i] + q[i + 1]);
        left[degree - k + 1] = q[0];
        right[k - 1] = q[k - 1];
    }
    found = first_zero(left, degree, low, 0.5 * (low + high));
    return found <= 1 ? found : first_zero(right, degree, 0.5 * (low + high), high);
}

/* ---- a model at a state ----------------------------------------------------------------------------------- */

/* dh/dt = dh/dx . f + dh/dt along the field f. */
static double rate(const double *row, const double *f) {
    double out = row[N];
    for (int j = 0; j < N; j++) out += row[j] * f[j];
    return out;
}

static double terms(const double *row, const double *f) {
    double out = fabs(row[N]);
    for (int j = 0; j < N; j++) out += fabs(row[j] * f[j]);
    return out;
}

static void signs(const int *m, double other, double *s) {
    for (int i = 0; i < M; i++) s[i] = m[i] ? m[i] : other;
}

/* The field of the mode: while sliding, the combination of the fields of both sides with dh/dt = 0. A status.
   values: the signs of the mode, and the multipliers of surfaces that are slid on. */
static int motion(Run *r, double t, const double *x, double *out, double *values) {
    double g[M][N + 1], s[M], low[N], high[N];
    int sliding = 0;
    for (int i = 0; i < SURFACES; i++) sliding += r->m[i] == 0;
    signs(r->m, -1, s);
    for (int i = 0; i < M; i++) values[i] = r->m[i];
    non_lipschitz = 0;
    (void)sign_of, (void)size_power; /* not every field has one */
    if (sliding > 1 && !AFFINE) return CORNER;
    if (sliding) gradients(t, x, r->p, r->m, g);
    field(t, x, r->p, s, r->m, low);
    memcpy(out, low, sizeof low);
    for (int i = 0; i < SURFACES && sliding; i++) {
        double minus, plus, weight;
        if (r->m[i]) continue;
        s[i] = 1;
        field(t, x, r->p, s, r->m, high);
        s[i] = -1;
        minus = rate(g[i], low);
        plus = rate(g[i], high);
        if (!(minus - plus > 1e-9 * (fabs(minus) + fabs(plus))) && CONTACT[i] == 0) {
            r->surface = i;
            return NO_SLIDING;
        }
        weight = minus / (minus - plus);
        values[i] = 2 * weight - 1;
        for (int j = 0; j < N; j++) out[j] += weight * (high[j] - low[j]);
    }
    return non_lipschitz ? NON_LIPSCHITZ : SUCCESS;
}

static int velocity(Run *r, double t, const double *x, double *out) {
    double values[M];
    return motion(r, t, x, out, values);
}

/* dh_i/dt under the fields at s_i = +1 and -1, and the size of their terms. */
static double sides(Run *r, int i, double t, const double *x, double *plus, double *minus) {
    double g[M][N + 1], s[M], f[N], size;
    int held = r->m[i];
    r->m[i] = 0;
    gradients(t, x, r->p, r->m, g);
    signs(r->m, 1, s);
    field(t, x, r->p, s, r->m, f);
    *plus = rate(g[i], f);
    size = terms(g[i], f);
    s[i] = -1;
    field(t, x, r->p, s, r->m, f);
    *minus = rate(g[i], f);
    size = fmax(size, terms(g[i], f));
    r->m[i] = held;
    return size;
}

/* dh_i/dt at both ends of the set of signs at h_i = 0; a resting contact has one end only. */
static double at_ends(Run *r, int i, double t, const double *x, double *upper, double *lower) {
    double plus, minus, e[M][2], size = sides(r, i, t, x, &plus, &minus);
    ends(t, x, r->p, e);
    *upper = CONTACT[i] < 0 ? -INFINITY : 0.5 * ((1 + e[i][1]) * plus + (1 - e[i][1]) * minus);
    *lower = CONTACT[i] > 0 ? INFINITY : 0.5 * ((1 + e[i][0]) * plus + (1 - e[i][0]) * minus);
    return size;
}

/* What rounding makes of h_i: of its terms, and of its rate over the error of the time. */
static double noise(Run *r, int i, double t, const double *x) {
    double g[M][N + 1], s[M], f[N], out;
    gradients(t, x, r->p, r->m, g);
    signs(r->m, 1, s);
    field(t, x, r->p, s, r->m, f);
    out = fabs(g[i][N] * t);
    for (int j = 0; j < N; j++) out += fabs(g[i][j] * x[j]);
    return 8 * EPS * out + INSTANT * fabs(t * rate(g[i], f));
}

static int coupled(const Run *r, int i) {
    for (int j = 0; j < SURFACES; j++)
        if (j != i && r->m[j] == 0 && COMPONENT[j] == COMPONENT[i]) return 1;
    return 0;
}

/* ---- decisions: what follows where a surface is reached, left or jumped onto ---------------------------------- */

/* Puts the state back on every surface that it slides on, along the gradient. */
static void project(Run *r) {
    double g[M][N + 1], h[M];
    for (int i = 0; i < SURFACES; i++) {
        if (r->m[i]) continue;
        for (int part = CONTACT[i] ? 0 : 1; part < 2; part++) /* off contact the function is h, in it dh/dt */
            for (int again = 0; again < 2; again++) {
                double size = 0;
                r->m[i] = part == 0 ? CONTACT[i] : 0;
                guards(r->t, r->x, r->p, r->m, h);
                gradients(r->t, r->x, r->p, r->m, g);
                r->m[i] = 0;
                for (int j = 0; j < N; j++) size += g[i][j] * g[i][j];
                if (size > 0)
                    for (int j = 0; j < N; j++) r->x[j] -= h[i] / size * g[i][j];
            }
    }
}

static void enter(Run *r, int i) {
    double upper, lower;
    r->m[i] = r->order[i] = 0;
    r->since[i] = r->t;
    project(r);
    at_ends(r, i, r->t, r->x, &upper, &lower);
    r->widest[i] = fabs(lower - upper);
}

static int make_step(Run *r, double t, const double *x, double length, Step *q);

/* Whether h_i = value is that of a kink on which the state stays. */
static int at_rest(Run *r, int i, double t, const double *x, double value) {
    return fabs(value) <= 64 * noise(r, i, t, x) + 1e-3 * r->atol;
}

/* The sign that h_i gets where its rate is 0, and its first power of time: 0 and -1 if it stays 0. */
static int way_off(Run *r, int i, int *order) {
    double length = r->length > 0 ? r->length : 1e-3, part = 1;
    int stays = 1, last = 0; /* the same at two lengths: one that is too long has some power by chance */
    for (int again = 0; again < 5; again++) {
        double h[2][M], power;
        Step q[2];
        int code = 0;
        part *= 0.1;
        for (int k = 0; k < 2 && !code; k++) {
            double step = (k ? 0.5 : 1) * part * length;
            code = make_step(r, r->t, r->x, step, &q[k]);
            if (!code) guards(r->t + step, q[k].end, r->p, r->m, h[k]);
        }
        if (code) { /* too long a step */
            stays = 0;
            continue;
        }
        stays = stays && at_rest(r, i, r->t, q[0].end, h[0][i]);
        if (!(h[0][i] * h[1][i] > 0) || at_rest(r, i, r->t, q[1].end, h[1][i])) continue;
        power = log2(h[0][i] / h[1][i]);
        *order = fabs(power - floor(power + 0.5)) < 0.02 && power > 0.5 && power < 5.5 ? (int)floor(power + 0.5) : 0;
        if (h[0][i] < 0) *order = -*order;
        if (*order && *order == last) {
            *order = abs(*order);
            return last > 0 ? 1 : -1;
        }
        last = *order;
    }
    *order = stays ? -1 : 0;
    return 0;
}

/* The side of a kink on which the solution goes on; or it stays on it, as at rest, until an event. The field is the
   same on both sides. Where it has stayed, the rate that the end of a slide leaves says nothing by itself. */
static void decide_kink(Run *r, int i, int stayed) {
    int held = r->m[i], way[2], order[2];
    for (int k = 0; k < 2; k++) {
        double g[M][N + 1], f[N], here, size;
        int code;
        r->m[i] = k ? -1 : 1;
        gradients(r->t, r->x, r->p, r->m, g);
        code = velocity(r, r->t, r->x, f);
        if (code) refuse(r, code, i);
        here = rate(g[i], f);
        size = terms(g[i], f);
        if (!stayed && fabs(here) > CLEAR * size) {
            way[k] = here > 0 ? 1 : -1;
            order[k] = 1;
        } else if (!stayed && fabs(here) > NO_RATE * size && !at_rest(r, i, r->t, r->x, here)) {
            way[k] = order[k] = 0;
        } else {
            way[k] = way_off(r, i, &order[k]);
        }
    }
    if (way[0] != way[1] || order[0] != order[1] || (!way[0] && !order[0])) refuse(r, TANGENCY, i);
    r->m[i] = way[0] ? way[0] : held ? held : 1;
    r->order[i] = order[0] > 0 ? order[0] : 0;
    r->still[i] = way[0] == 0;
}

/* Behind an event: where the kinks that the solution has stayed on are left to; crossed: those that change sides. */
static void leave_kinks(Run *r, int *crossed) {
    for (int i = 0; i < SURFACES; i++) {
        int before = r->m[i];
        crossed[i] = 0;
        if (!r->still[i]) continue;
        decide_kink(r, i, 1);
        crossed[i] = r->m[i] != before;
    }
}

/* The signs of surfaces that the state lies on, by the rates of h on both sides. */
static void decide_on(Run *r, const int *met) {
    for (int i = 0; i < SURFACES; i++)
        for (int j = 0; j < i; j++)
            if (met[i] && met[j] && COMPONENT[i] == COMPONENT[j]) refuse(r, CORNER, i);
    for (int i = 0; i < SURFACES; i++) {
        double upper, lower, clear;
        if (!met[i] || ROLE[i] == KINK) continue;
        clear = CLEAR * at_ends(r, i, r->t, r->x, &upper, &lower);
        if (ROLE[i] == SWITCHING && WIDTH[i] == 0 && upper < -clear && lower > clear) {
            enter(r, i);
        } else if (fmin(upper, lower) > clear || fmax(upper, lower) < -clear) {
            r->m[i] = upper > 0 ? 1 : -1;
            r->order[i] = 1;
        } else {
            refuse(r, TANGENCY, i);
        }
    }
    for (int i = 0; i < SURFACES; i++) /* what holds the state is known now */
        if (met[i] && ROLE[i] == KINK) decide_kink(r, i, 0);
}

static void start(Run *r) {
    double h[M];
    int met[M] = {0};
    for (int i = 0; i < M; i++) r->m[i] = 1;
    for (int again = 0; again < 2; again++) { /* sizes |h| inside other functions follow the signs found first */
        guards(r->t, r->x, r->p, r->m, h);
        for (int i = 0; i < SURFACES; i++) r->m[i] = h[i] < 0 ? -1 : 1;
    }
    for (int i = 0; i < SURFACES; i++) {
        met[i] = WIDTH[i] == 0 && fabs(h[i]) <= noise(r, i, r->t, r->x);
        if (met[i] && RESET_FROM[i]) refuse(r, CORNER, i);
    }
    decide_on(r, met);
}

/* Signs after the state has jumped; `but` has its own already. */
static void after_jump(Run *r, const int *before, int but) {
    double h[M];
    int held[M], met[M] = {0};
    for (int i = 0; i < M; i++) held[i] = before[i] ? before[i] : 1;
    guards(r->t, r->x, r->p, held, h);
    for (int i = 0; i < SURFACES; i++) {
        if (i == but) continue;
        r->still[i] = 0;
        if (WIDTH[i] == 0 && fabs(h[i]) <= noise(r, i, r->t, r->x)) {
            if (RESET_FROM[i]) refuse(r, CORNER, i);
            met[i] = 1;
        } else if (WIDTH[i] > 0 ? before[i] * h[i] + WIDTH[i] <= 0 : before[i] == 0 || before[i] * h[i] < 0) {
            if (RESET_FROM[i]) refuse(r, CORNER, i);
            r->m[i] = h[i] > 0 ? 1 : -1;
            r->order[i] = 0;
        } else {
            r->order[i] = 0;
        }
    }
    decide_on(r, met);
}

/* The sign of a surface that a reset has left the state on: off it again, through, or at rest on it. */
static void bounce(Run *r, int i, int sign, double size) {
    double g[M][N + 1], s[M], f[N], off, plus, minus, clear = 0, unpushed = 0;
    int contact = CONTACT[i] == sign;
    if (ROLE[i] == SWITCHING) {
        int met[M] = {0};
        met[i] = 1;
        decide_on(r, met);
        return;
    }
    gradients(r->t, r->x, r->p, r->m, g);
    signs(r->m, -1, s);
    field(r->t, r->x, r->p, s, r->m, f);
    off = rate(g[i], f);
    size += terms(g[i], f);
    if (contact) {
        clear = CLEAR * sides(r, i, r->t, r->x, &plus, &minus);
        unpushed = sign * (sign > 0 ? plus : minus);
    }
    if (fabs(off) <= NO_RATE * size) {
        if (contact && unpushed < -clear) {
            enter(r, i);
        } else if (contact && unpushed > clear) {
            r->m[i] = sign;
            r->order[i] = 2;
        } else {
            refuse(r, TANGENCY, i);
        }
        return;
    }
    /* What has come this near by ever shorter flights does not go through: its limit is the surface. */
    if (r->crowd > 0 && sign * off < 0) refuse(r, ZENO, i);
    if (contact && sign * off > 0
        && (off * off <= -2 * unpushed * 1e2 * noise(r, i, r->t, r->x)
            || 2 * fabs(off) <= -unpushed * SHORTEST * fabs(r->t)))
        refuse(r, ZENO, i);
    r->m[i] = off > 0 ? 1 : -1;
    r->order[i] = 1;
}

static void check_finite(Run *r, int surface) {
    for (int j = 0; j < N; j++)
        if (!isfinite(r->x[j])) refuse(r, NOT_FINITE, surface);
}

/* The reset of surface i, and the signs after it. */
static void jump(Run *r, int i) {
    double g[M][N + 1], f[N], h[M], x[N], size;
    int before[M];
    memcpy(before, r->m, sizeof before);
    memcpy(x, r->x, sizeof x);
    gradients(r->t, x, r->p, r->m, g);
    velocity(r, r->t, x, f);
    size = terms(g[i], f);
    reset(i, r->t, x, r->p, r->m, r->x);
    check_finite(r, i);
    guards(r->t, r->x, r->p, r->m, h);
    if (fabs(h[i]) > fmax(8 * noise(r, i, r->t, r->x), 64 * EPS * size)) {
        r->m[i] = h[i] > 0 ? 1 : -1;
        r->order[i] = 0;
    } else {
        bounce(r, i, before[i], size);
    }
    after_jump(r, before, i);
}

/* What follows where h_i = 0 is reached from the side of its sign: the kind of event. */
static const char *reach(Run *r, int i) {
    double plus, minus, upper, lower, size, clear, here, beyond;
    int sign = r->m[i];
    if (RESET_FROM[i] == 2 || RESET_FROM[i] == sign) {
        jump(r, i);
        return "reset";
    }
    if ((ROLE[i] == SWITCHING || ROLE[i] == RESETTING) && coupled(r, i)) refuse(r, CORNER, i);
    if (ROLE[i] != SWITCHING || WIDTH[i] > 0) {
        double g[M][N + 1], f[N];
        gradients(r->t, r->x, r->p, r->m, g);
        velocity(r, r->t, r->x, f);
        if (!(-sign * rate(g[i], f) > CLEAR * terms(g[i], f))) refuse(r, TANGENCY, i);
        r->m[i] = -sign;
        r->order[i] = WIDTH[i] > 0 ? 0 : 1;
        return "crossing";
    }
    sides(r, i, r->t, r->x, &plus, &minus);
    size = at_ends(r, i, r->t, r->x, &upper, &lower);
    here = sign > 0 ? plus : minus;
    beyond = sign > 0 ? minus : plus;
    clear = CLEAR * size;
    if (fabs(plus - minus) <= 1e-15 * size && -sign * here > NO_RATE * size) { /* the sign has no part in it */
        r->m[i] = -sign;
        r->order[i] = 1;
        return "crossing";
    }
    if (!(-sign * here > clear) || !(fmin(fmin(fabs(upper), fabs(lower)), fabs(beyond)) > clear)) refuse(r, TANGENCY, i);
    if (upper < 0 && 0 < lower) {
        enter(r, i);
        return "sliding entry";
    }
    if (sign * beyond >= 0) refuse(r, NON_UNIQUE, i);
    r->m[i] = -sign;
    r->order[i] = 1;
    return "crossing";
}

/* The surface is left where the rate of h_i at an end of its set has come to 0. */
static const char *leave(Run *r, int i, int which, double slope) {
    double upper, lower, e[M][2], other, end;
    int side = which == WATCH_UPPER ? 1 : -1;
    at_ends(r, i, r->t, r->x, &upper, &lower);
    other = side > 0 ? lower : -upper;
    if (CONTACT[i] == 0 && !(other > NEAR_FOLD * r->widest[i] && -slope * (r->t - r->since[i]) > CLEAR * other))
        refuse(r, TWO_FOLD, i);
    ends(r->t, r->x, r->p, e);
    end = side > 0 ? e[i][1] : e[i][0];
    r->m[i] = side;
    r->order[i] = CONTACT[i] ? 3 : fabs(end - side) <= 1e-12 ? 2 : 1;
    return "sliding exit";
}

/* ---- the event loop --------------------------------------------------------------------------------------- */

/* A step of the method; 0, a status, or MIN_STEP where a value is not finite. */
static int make_step(Run *r, double t, const double *x, double length, Step *q) {
    double k[7][N], y[N];
    int code = velocity(r, t, x, k[0]);
    q->t = t;
    q->length = length;
    memcpy(q->x, x, sizeof q->x);
    for (int stage = 0; stage < 6 && !code; stage++) {
        for (int j = 0; j < N; j++) {
            double sum = 0;
            for (int l = 0; l <= stage; l++) sum += (stage < 5 ? STAGES[stage][l] : WEIGHTS[l]) * k[l][j];
            y[j] = x[j] + length * sum;
        }
        code = velocity(r, t + (stage < 5 ? NODES[stage] : 1) * length, y, k[stage + 1]);
    }
    if (code) return code;
    memcpy(q->end, y, sizeof y);
    for (int j = 0; j < N; j++) {
        q->error[j] = 0;
        for (int l = 0; l < 7; l++) q->error[j] += length * ERROR[l] * k[l][j];
        for (int d = 0; d < 4; d++) {
            q->powers[j][d] = 0;
            for (int l = 0; l < 7; l++) q->powers[j][d] += DENSE[l][d] * k[l][j];
        }
        if (!isfinite(q->error[j]) || !isfinite(q->end[j])) return MIN_STEP;
    }
    return SUCCESS;
}

static void at(const Step *q, double theta, double *x) {
    for (int j = 0; j < N; j++) {
        const double *c = q->powers[j];
        x[j] = q->x[j] + q->length * theta * (c[0] + theta * (c[1] + theta * (c[2] + theta * c[3])));
    }
}

/* What is watched, each above 0 in the mode: s h + width, and while sliding the rates at both ends; else NaN. */
static void values(Run *r, double t, const double *x, double out[M][3]) {
    double h[M];
    guards(t, x, r->p, r->m, h);
    for (int i = 0; i < SURFACES; i++) {
        double upper, lower;
        out[i][0] = out[i][1] = out[i][2] = NAN;
        if (r->still[i]) continue;
        if (r->m[i]) {
            out[i][WATCH_H] = r->m[i] * h[i] + WIDTH[i];
            continue;
        }
        at_ends(r, i, t, x, &upper, &lower);
        if (CONTACT[i] >= 0) out[i][WATCH_UPPER] = -upper;
        if (CONTACT[i] <= 0) out[i][WATCH_LOWER] = lower;
    }
}

static int is_watched(const Run *r, int i, int what) {
    if (r->still[i]) return 0;
    if (r->m[i]) return what == WATCH_H;
    return what == WATCH_UPPER ? CONTACT[i] >= 0 : what == WATCH_LOWER && CONTACT[i] <= 0;
}

/* What a watched function is known to. */
static double rounding(Run *r, int i, int what, double t, const double *x) {
    double upper, lower;
    if (what == WATCH_H) return 64 * noise(r, i, t, x);
    return 1e-12 * (isfinite(r->widest[i]) ? r->widest[i] : at_ends(r, i, t, x, &upper, &lower));
}

/* The first event on a step: 1, 0 for none, -1 where a polynomial does not meet a watched function. */
static int first_event(Run *r, const Step *q, int *surface, int *what, double *where, double *slope) {
    static const int n = DEGREE;
    double at_places[DEGREE + 1][M][3], at_probes[4][M][3], x[N];
    int found = 0;
    for (int k = 0; k <= n; k++) {
        at(q, place(k), x);
        values(r, q->t + place(k) * q->length, x, at_places[k]);
    }
    for (int k = 0; k < 4; k++) {
        at(q, PROBES[k], x);
        values(r, q->t + PROBES[k] * q->length, x, at_probes[k]);
    }
    *where = 2;
    for (int i = 0; i < SURFACES; i++)
        for (int w = 0; w < 3; w++) {
            double v[DEGREE + 1], c[DEGREE + 1], d[DEGREE + 1], size = 0, theta, room;
            int degree = n;
            if (!is_watched(r, i, w)) continue;
            for (int k = 0; k <= n; k++) {
                v[k] = at_places[k][i][w];
                size = fmax(size, fabs(v[k]));
            }
            coefficients(v, c);
            room = 1e-9 * size + rounding(r, i, w, q->t, q->x);
            for (int k = 0; k < 4; k++) {
                double sum = 0;
                for (int j = 0; j <= n; j++) sum += bernstein(n, j, PROBES[k]) * c[j];
                if (!(fabs(sum - at_probes[k][i][w]) <= room)) return -1;
            }
            memcpy(d, c, sizeof c);
            for (int o = 0; w == WATCH_H && o < r->order[i]; o++, degree--) /* zeros at the start divided out */
                for (int j = 1; j <= degree; j++) d[j - 1] = d[j] / j;
            theta = first_zero(d, degree, 0, 1);
            if (theta > 1 || theta >= *where) continue;
            *surface = i;
            *what = w;
            *where = theta;
            *slope = 0;
            for (int j = 0; j < n; j++) *slope += n * bernstein(n - 1, j, theta) * (c[j + 1] - c[j]) / q->length;
            found = 1;
        }
    return found;
}

static double same(const Run *r) { return 32 * EPS * fmax(fabs(r->t), fabs(r->t - r->first)); }

/* A step within the tolerance, up to goal at most; gives whether an event is on it. */
static int tried(Run *r, double goal, Step *q, int *surface, int *what, double *where, double *slope) {
    double length = r->length;
    if (!(length > 0)) {
        double f[N], far = 0, fast = 0;
        int code = velocity(r, r->t, r->x, f);
        if (code) refuse(r, code, r->surface);
        for (int j = 0; j < N; j++) {
            far = fmax(far, fabs(r->x[j]) / (r->atol + r->rtol * fabs(r->x[j])));
            fast = fmax(fast, fabs(f[j]) / (r->atol + r->rtol * fabs(r->x[j])));
        }
        length = far > 1e-5 && fast > 1e-5 ? 1e-3 * far / fast : 1e-6;
    }
    length = fmin(length, goal - r->t);
    for (;;) {
        double error = 0;
        int code, cut = length == goal - r->t;
        if (--r->room < 0) refuse(r, MAX_STEPS, -1);
        if (length <= 16 * EPS * fmax(fabs(r->t), 1e-300)) refuse(r, MIN_STEP, -1);
        code = make_step(r, r->t, r->x, length, q);
        if (code && code != MIN_STEP) {
            if (code != NO_SLIDING || length <= 1e-9 * fmax(fabs(r->t), fabs(goal - r->t))) refuse(r, code, r->surface);
        }
        if (code) {
            length *= 0.2;
            continue;
        }
        for (int j = 0; j < N; j++)
            error = fmax(error, fabs(q->error[j]) / (r->atol + r->rtol * fmax(fabs(q->x[j]), fabs(q->end[j]))));
        if (error <= 1) {
            int found = first_event(r, q, surface, what, where, slope);
            double natural = length * fmin(5, 0.9 * pow(fmax(error, 1e-10), -0.2));
            if (found >= 0) {
                /* A step cut off by the end or by a clock says little about the one after it. */
                r->length = cut ? fmax(natural, r->length) : natural;
                return found;
            }
            length *= 0.5;
        } else {
            length *= fmax(0.2, 0.9 * pow(error, -0.2));
        }
    }
}

/* What is 0 of a watched function at an event. */
static double tiny(Run *r, int i, int what, double t, const double *x) {
    double upper, lower;
    return what == WATCH_H ? 2 * noise(r, i, t, x) : 1e-12 * at_ends(r, i, t, x, &upper, &lower);
}

static double value_after(Run *r, int i, int what, double length) {
    double all[M][3];
    Step q;
    int code = make_step(r, r->t, r->x, length, &q);
    if (code) refuse(r, code, i);
    values(r, r->t + length, q.end, all);
    return all[i][what];
}

/* The length of the step at whose end a watched function is 0, by the secant method on real steps. */
static double landing(Run *r, int i, int what, double length, double slope) {
    double past = 0, past_value = 0, moved = INFINITY, value = NAN;
    if (length <= 0) return 0;
    for (int again = 0; again < 12; again++) {
        value = value_after(r, i, what, length);
        if (again && past != length && past_value != value) slope = (value - past_value) / (length - past);
        if (value == 0 || slope == 0 || !isfinite(value)) break;
        moved = -value / slope;
        past = length;
        past_value = value;
        if (fabs(moved) <= 2 * EPS * fmax(fabs(r->t), length)) return length;
        length = fmin(fmax(length + moved, 0.25 * length), 2 * length);
    }
    if (value == 0 || fabs(moved) <= 1e3 * EPS * fmax(fabs(r->t), length)) return length;
    refuse(r, TANGENCY, i);
    return 0;
}

static void record(Run *r, const char *surface, const char *kind, const int *before, const double *x) {
    if (r->handler) r->handler(r->t, surface, kind, before, r->m, x, r->user);
}

/* The events of a jump, in the order of surfaces; but: the surface whose reset it is, or -1. */
static void record_jump(Run *r, const int *before, const double *x, int but) {
    for (int i = 0; i < SURFACES; i++) {
        const char *kind = r->m[i] == 0 ? "sliding entry" : before[i] == 0 ? "sliding exit" : "crossing";
        if (i == but || r->m[i] != before[i]) record(r, SURFACE_NAMES[i], i == but ? "reset" : kind, before, x);
    }
}

/* Whether a surface resets the state that reaches it from the side of its sign. */
static int resets_from(const Run *r, int i) { return r->m[i] && (RESET_FROM[i] == 2 || RESET_FROM[i] == r->m[i]); }

/* The least and the largest of every state behind the resets of one instant, and its largest size on the way. */
typedef struct {
    double low[N], high[N], size[N];
    int bad;
} Ends;

/* Takes the resets list[at], list[at + 1], ... in every order, from a state and signs that those before have left. */
static void in_turn(Run *r, int *list, int at, int count, const double *x, const int *m, Ends *e) {
    for (int j = 0; j < N; j++) {
        if (!isfinite(x[j])) e->bad = 1;
        e->size[j] = fmax(e->size[j], fabs(x[j]));
        if (at < count) continue;
        e->low[j] = fmin(e->low[j], x[j]);
        e->high[j] = fmax(e->high[j], x[j]);
    }
    for (int l = at; l < count; l++) {
        double y[N], h[M];
        int i = list[l], signs[M], held[M];
        list[l] = list[at];
        list[at] = i;
        if (i < SURFACES) reset(i, r->t, x, r->p, m, y);
        else strike(i - SURFACES, r->t, x, r->p, m, y);
        for (int j = 0; j < M; j++) held[j] = m[j] ? m[j] : 1;
        guards(r->t, y, r->p, held, h);
        memcpy(signs, m, sizeof signs);
        for (int j = 0; j < SURFACES; j++)
            if (fabs(h[j]) > fmax(WIDTH[j], 64 * noise(r, j, r->t, y)) && m[j] * h[j] <= 0) signs[j] = h[j] > 0 ? 1 : -1;
        in_turn(r, list, at + 1, count, y, signs, e);
        list[at] = list[l];
        list[l] = i;
    }
}

/* Refuses resets of one instant, of the surfaces that are met and of clocks, whose order decides the next state. */
static void check_order(Run *r, const int *met) {
    int list[SURFACES + CLOCKS];
    for (int group = 0; group < SURFACES + CLOCK_COUNT; group++) {
        Ends e = {.bad = 0};
        int count = 0;
        for (int i = 0; i < SURFACES + CLOCK_COUNT; i++)
            if (ORDER[i] == group && (i < SURFACES ? met[i] : r->waiting[i - SURFACES] <= r->t + same(r)))
                list[count++] = i;
        if (count < 2) continue;
        if (count > MOST_ORDERS) refuse(r, NON_UNIQUE, -1);
        for (int j = 0; j < N; j++) e.low[j] = INFINITY, e.high[j] = -INFINITY;
        in_turn(r, list, 0, count, r->x, r->m, &e);
        for (int j = 0; j < N; j++)
            if (e.bad || e.high[j] - e.low[j] > ONE_STATE * e.size[j] + r->atol) refuse(r, NON_UNIQUE, -1);
    }
}

/* Takes the step that ends where a watched function vanishes, and decides what follows. */
static void land(Run *r, const Step *q, int i, int what, double where, double slope) {
    double all[M][3], here[M][3], length = 0;
    int together[M] = {0}, met[M] = {0}, count = 0, jumps = 0, tries;
    Step s = *q;
    for (tries = 0; tries < SURFACES + 2; tries++) {
        int missed = -1, missed_what = 0;
        length = landing(r, i, what, where * q->length, slope);
        memcpy(s.end, r->x, sizeof s.end);
        if (length > 0 && make_step(r, r->t, r->x, length, &s)) refuse(r, MIN_STEP, i);
        values(r, r->t + length, s.end, all);
        for (int j = 0; j < SURFACES && missed < 0; j++)
            for (int w = 0; w < 3 && missed < 0; w++)
                if (is_watched(r, j, w) && !(j == i && w == what) && r->order[j] == 0
                    && all[j][w] < -tiny(r, j, w, r->t + length, s.end)) {
                    missed = j;
                    missed_what = w;
                }
        if (missed < 0) break;
        /* Another one was first by less than the dense output tells. */
        values(r, r->t, r->x, here);
        i = missed;
        what = missed_what;
        where = length / q->length;
        slope = (all[i][what] - here[i][what]) / length;
    }
    if (tries == SURFACES + 2) refuse(r, CORNER, i);
    for (int j = 0; j < SURFACES; j++)
        for (int w = 0; w < 3; w++)
            if (is_watched(r, j, w)
                && ((j == i && w == what)
                    || (r->order[j] == 0 && fabs(all[j][w]) <= tiny(r, j, w, r->t + length, s.end)))) {
                together[j] |= 1 << w;
                count++;
            }
    r->t += length;
    memcpy(r->x, s.end, sizeof r->x);
    project(r);
    r->crowd = r->t - r->last <= SAME * (r->t - r->first) + same(r) ? r->crowd + 1 : 0;
    r->last = r->t;
    if (r->crowd > 4 * SURFACES + 4) refuse(r, ZENO, i);
    for (int j = 0; j < SURFACES && count > 1; j++) {
        int ends_of_one = together[j] & (together[j] - 1);
        if (ends_of_one) refuse(r, TWO_FOLD, j);
        if (together[j] && RESET_FROM[j]) refuse(r, CORNER, j);
        for (int l = 0; l < j; l++)
            if (together[j] && together[l] && COMPONENT[j] == COMPONENT[l]) refuse(r, CORNER, j);
    }
    for (int j = 0; j < SURFACES; j++) {
        met[j] = together[j] & 1 << WATCH_H && resets_from(r, j);
        jumps += met[j];
    }
    if (jumps) check_order(r, met);
    for (int j = 0; j < M; j++) r->order[j] = 0;
    for (int j = 0; j < SURFACES; j++)
        for (int w = 0; w < 3; w++) {
            double x[N];
            int before[M], crossed[M];
            const char *kind;
            if (!(together[j] & 1 << w)) continue;
            memcpy(before, r->m, sizeof before);
            memcpy(x, r->x, sizeof x);
            kind = w == WATCH_H ? reach(r, j) : leave(r, j, w, count == 1 ? slope : -INFINITY);
            leave_kinks(r, crossed);
            if (w == WATCH_H && !strcmp(kind, "reset")) {
                record_jump(r, before, x, j);
                continue;
            }
            for (int l = 0; l < SURFACES; l++) {
                if (l == j) record(r, SURFACE_NAMES[j], kind, before, x);
                else if (crossed[l]) record(r, SURFACE_NAMES[l], "crossing", before, x);
            }
        }
}

/* The first instant of a clock after t: start and period, or a list of TIMES_OF[k] times. */
static double clock_after(const Run *r, int k, double t) {
    const double *q = r->clocks[k];
    double n;
    if (TIMES_OF[k]) {
        for (int i = 0; i < TIMES_OF[k]; i++)
            if (q[i] > t) return q[i];
        return INFINITY;
    }
    n = fmax(floor((t - q[0]) / q[1]) - 1, 0);
    while (q[0] + n * q[1] <= t) n++;
    return q[0] + n * q[1];
}

/* The clocks that are due now, in their order, and the signs after them. */
static void strike_clocks(Run *r) {
    int met[M];
    double h[M];
    guards(r->t, r->x, r->p, r->m, h);
    for (int i = 0; i < SURFACES; i++)
        met[i] = resets_from(r, i) && r->order[i] == 0 && fabs(h[i]) <= noise(r, i, r->t, r->x);
    check_order(r, met);
    for (int k = 0; k < CLOCK_COUNT; k++) {
        double x[N];
        int before[M], crossed[M];
        if (r->waiting[k] > r->t + same(r)) continue;
        r->waiting[k] = clock_after(r, k, r->t + same(r));
        memcpy(before, r->m, sizeof before);
        memcpy(x, r->x, sizeof x);
        strike(k, r->t, x, r->p, r->m, r->x);
        check_finite(r, -1);
        if (memcmp(x, r->x, sizeof x)) after_jump(r, before, -1);
        leave_kinks(r, crossed);
        record_jump(r, before, x, -1);
        record(r, CLOCK_NAMES[k], "time event", before, x);
    }
}

/* Refuses a kink that the solution was to stay on until an event, and has left. */
static void check_still(Run *r) {
    double h[M];
    guards(r->t, r->x, r->p, r->m, h);
    for (int i = 0; i < SURFACES; i++)
        if (r->still[i] && !at_rest(r, i, r->t, r->x, h[i])) refuse(r, TANGENCY, i);
}

/* One step, to an event, to the next instant of a clock, or to t_end at most. */
static void move(Run *r, double t_end) {
    double due = INFINITY, goal;
    for (int k = 0; k < CLOCK_COUNT; k++) due = fmin(due, r->waiting[k]);
    goal = fmin(due, t_end);
    if (goal - r->t > same(r)) {
        int surface = -1, what = 0;
        double where = 0, slope = 0;
        Step q;
        if (tried(r, goal, &q, &surface, &what, &where, &slope)) {
            land(r, &q, surface, what, where, slope);
            return;
        }
        memcpy(r->x, q.end, sizeof r->x);
        r->t = goal - r->t - q.length <= 4 * EPS * fabs(goal) ? goal : r->t + q.length;
        for (int i = 0; i < M; i++) r->order[i] = 0;
        project(r);
        check_still(r);
    } else {
        r->t = goal;
    }
    if (r->t == due) strike_clocks(r);
}

/* The name of output i of OUTPUTS; NULL behind the last. */
const char *filippov_output_name(int i) { return i >= 0 && i < OUTPUTS ? OUTPUT_NAMES[i] : NULL; }

/* The outputs at a state, in the order of their names, as an event tells of it: x with the mode before it, or a
   state with the mode after. out has OUTPUTS numbers, all NaN where nothing holds a slide. Gives a number of STATUS. */
int filippov_outputs(double t, const double *x, const double *p, const int *mode, double *out) {
    Run *r = calloc(1, sizeof *r);
    double f[N], s[M];
    int status = BAD_ARGUMENT;
    for (int i = 0; i < OUTPUTS; i++) out[i] = NAN;
    if (!r) return status;
    for (int i = 0; i < PARAMETERS; i++) r->p[i] = p[i];
    memcpy(r->m, mode, sizeof r->m);
    status = motion(r, t, x, f, s);
    if (!status) output_values(t, x, r->p, s, r->m, out);
    free(r);
    return status;
}

/* As filippov_run; mode: that at the end. */
static int run_model(double *x0, double t0, double *t1, const double *p, double rtol, double atol, long max_steps,
                     EventHandler handler, void *user, int *surface, int *mode) {
    Run *r = calloc(1, sizeof *r);
    int status = BAD_ARGUMENT;
    double end = *t1;
    if (!r) return status;
    r->surface = -1;
    if (rtol >= 1e-13 && atol > 0 && t0 < end && isfinite(t0) && isfinite(end)) status = SUCCESS;
    for (int j = 0; j < N; j++)
        if (!isfinite(x0[j])) status = BAD_ARGUMENT;
    for (int i = 0; i < PARAMETERS; i++)
        if (!(isfinite(p[i]) && LOWER[i] <= p[i] && p[i] <= UPPER[i])) status = BAD_ARGUMENT;
    if (status) {
        free(r);
        return status;
    }
    r->t = r->first = t0;
    r->rtol = rtol;
    r->atol = atol;
    r->room = max_steps;
    r->last = -INFINITY;
    r->handler = handler;
    r->user = user;
    memcpy(r->x, x0, sizeof r->x);
    for (int i = 0; i < PARAMETERS; i++) r->p[i] = p[i];
    clock_numbers(r->p, r->clocks);
    for (int k = 0; k < CLOCK_COUNT; k++) {
        int fits = TIMES_OF[k] || (isfinite(r->clocks[k][0]) && r->clocks[k][1] > 0 && isfinite(r->clocks[k][1]));
        for (int i = 1; i < TIMES_OF[k]; i++) fits &= r->clocks[k][i - 1] < r->clocks[k][i];
        if (!fits) {
            free(r);
            return BAD_ARGUMENT;
        }
        /* Kept, not taken from t: a step may end within rounding before an instant, which is still to come. */
        r->waiting[k] = clock_after(r, k, r->t + same(r));
    }
    if (!setjmp(r->out)) {
        start(r);
        while (r->t < end) move(r, end);
    }
    memcpy(x0, r->x, sizeof r->x);
    *t1 = r->t;
    if (surface) *surface = r->surface;
    if (mode) memcpy(mode, r->m, sizeof r->m);
    status = r->status;
    if (!status && surface) *surface = -1; /* a step that was taken again may have named one */
    free(r);
    return status;
}

/* Runs the model from x0 over t0 < t1 at parameters p. x0 is left at the last state, t1 at the last time and
   `surface` at the one where the run stopped (-1 for none); gives a number of STATUS. */
int filippov_run(double *x0, double t0, double *t1, const double *p, double rtol, double atol, long max_steps,
                 EventHandler handler, void *user, int *surface) {
    return run_model(x0, t0, t1, p, rtol, atol, max_steps, handler, user, surface, NULL);
}

#ifndef FILIPPOV_NO_MAIN
/* Prints events, then the last state, as lines t,surface,kind,states. Arguments: -p NAME=VALUE, -x NAME=VALUE,
   -t T0 T1, as often as wanted. */
static void print_event(double t, const char *surface, const char *kind, const int *before, const int *after,
                        const double *x, void *user) {
    (void)before, (void)after, (void)user;
    printf("%.17g,%s,%s", t, surface, kind);
    for (int j = 0; j < N; j++) printf(",%.17g", x[j]);
    printf("\n");
}

static int named(const char *word, const char *const *names, int count, double *values) {
    const char *sign = strchr(word, '=');
    char *rest;
    for (int i = 0; sign && i < count; i++)
        if (strlen(names[i]) == (size_t)(sign - word) && !strncmp(names[i], word, (size_t)(sign - word))) {
            values[i] = strtod(sign + 1, &rest);
            return *rest == 0 && rest != sign + 1;
        }
    return 0;
}

int main(int argc, char **argv) {
    double x[N], p[P], t[2] = {T0, T1};
    double outputs[OUTPUTS + 1];
    int mode[M] = {0}, surface, status, fits = 1;
    memcpy(x, X0, sizeof x);
    memcpy(p, DEFAULTS, sizeof p);
    for (int i = 1; i < argc && fits; i += 2) {
        if (!strcmp(argv[i], "-p") && i + 1 < argc) {
            fits = named(argv[i + 1], PARAMETER_NAMES, PARAMETERS, p);
        } else if (!strcmp(argv[i], "-x") && i + 1 < argc) {
            fits = named(argv[i + 1], STATE_NAMES, N, x);
        } else if (!strcmp(argv[i], "-t") && i + 2 < argc) {
            t[0] = strtod(argv[i + 1], NULL);
            t[1] = strtod(argv[++i + 1], NULL);
        } else {
            fits = 0;
        }
    }
    if (!fits) {
        fprintf(stderr, "usage: %s [-p NAME=VALUE] [-x NAME=VALUE] [-t T0 T1]\n", argv[0]);
        return 2;
    }
    status = run_model(x, t[0], &t[1], p, 1e-10, 1e-12, 1000000, print_event, NULL, &surface, mode);
    printf("%.17g,%s,%s", t[1], surface < 0 ? "" : SURFACE_NAMES[surface], STATUS[status]);
    for (int j = 0; j < N; j++) printf(",%.17g", x[j]);
    filippov_outputs(t[1], x, p, mode, outputs); /* behind the states of the last line */
    for (int j = 0; j < OUTPUTS; j++) printf(",%.17g", outputs[j]);
    printf("\n");
    return status ? 1 : 0;
}
#endif
