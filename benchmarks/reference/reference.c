/* What a careful C programmer writes for one model by hand: straight-line scalar code, state in
 * registers. The yardstick of benchmarks/speed.py, which compiles it and compares the results. */
#include <math.h>
#include <stdint.h>

/* (1 - exp(-travel)) / travel, for a short travel the series that the library sums, too. */
static inline double relative_decay(double travel) {
    if (travel < 1.0 / 64.0) {
        const double square = travel * travel;
        const double low = (1.0 - travel * (1.0 / 2.0)) + square * ((1.0 / 6.0) - travel * (1.0 / 24.0));
        const double high = ((1.0 / 120.0) - travel * (1.0 / 720.0)) + square * (1.0 / 5040.0);
        return low + square * square * high;
    }
    return -expm1(-travel) / travel;
}

/* Recursive least squares of (alpha, beta, gamma) from raw (u, x), with W_p, forgetting, the bound on
 * the trace, a dead zone and the history of theta. par: pole, forgetting, bound, dead zone (< 0: none), scale
 * of the three parameters, scale of the output, initial variance, units of the three. */
void rls(int64_t N, const double *u, const double *x, const double *par, double *theta) {
    const double pole = par[0], mu = par[1], inverse_mu = 1.0 / mu, bound = par[2], zone = par[3];
    const double s0 = par[4], s1 = par[5], s2 = par[6], sz = par[7];
    double t0 = 1, t1 = 1, t2 = 1, p00 = par[8], p01 = 0, p02 = 0, p11 = par[8], p12 = 0, p22 = par[8];
    const double prior = par[8];
    double f0 = 0, f1 = 0, f2 = 0, fz = 0, u0 = u[0], x0 = x[0];
    theta[0] = par[9]; theta[1] = par[10]; theta[2] = par[11];
    for (int64_t k = 1; k < N; k++) {
        const double du = u[k] - u0, travel = fabs(du);
        const double r0 = -0.5 * (x[k] + x0) * travel * s0, r1 = du * s1;
        const double r2 = 0.5 * (u[k] + u0) * travel * s2, rz = (x[k] - x0) * sz;
        u0 = u[k]; x0 = x[k];
        f0 = r0 + pole * (f0 - r0); f1 = r1 + pole * (f1 - r1);
        f2 = r2 + pole * (f2 - r2); fz = rz + pole * (fz - rz);
        if ((f0 * f0 + f1 * f1 + f2 * f2) * prior > zone) {
            const double y = fz - (t0 * f0 + t1 * f1 + t2 * f2);
            const double w0 = p00 * f0 + p01 * f1 + p02 * f2;
            const double w1 = p01 * f0 + p11 * f1 + p12 * f2;
            const double w2 = p02 * f0 + p12 * f1 + p22 * f2;
            const double g = 1.0 / (w0 * f0 + w1 * f1 + w2 * f2 + mu);
            const double gy = g * y;
            t0 += w0 * gy; t1 += w1 * gy; t2 += w2 * gy;
            if (p00 + p11 + p22 - (w0 * w0 + w1 * w1 + w2 * w2) * g <= bound * mu) {
                const double g0 = g * w0, g1 = g * w1, g2 = g * w2;
                p00 = (p00 - g0 * w0) * inverse_mu; p01 = (p01 - g0 * w1) * inverse_mu;
                p02 = (p02 - g0 * w2) * inverse_mu; p11 = (p11 - g1 * w1) * inverse_mu;
                p12 = (p12 - g1 * w2) * inverse_mu; p22 = (p22 - g2 * w2) * inverse_mu;
            }
        }
        theta[3 * k] = t0 * par[9]; theta[3 * k + 1] = t1 * par[10]; theta[3 * k + 2] = t2 * par[11];
    }
}

/* The same law for many channels at once, (K, N) samples, the state channel by channel in arrays of N:
 * the inner loop runs on vector instructions. work: 17 N numbers, zero at first. */
void bank(int64_t K, int64_t N, const double *u, const double *x, const double *par, double *work) {
    const double pole = par[0], mu = par[1], inverse_mu = 1.0 / mu, bound = par[2], zone = par[3];
    const double s0 = par[4], s1 = par[5], s2 = par[6], sz = par[7], prior = par[8];
    for (int64_t start = 0; start < N; start += 64) {
        const int64_t m = N - start < 64 ? N - start : 64;
        double t0[64], t1[64], t2[64], p00[64], p01[64], p02[64], p11[64], p12[64], p22[64];
        double f0[64], f1[64], f2[64], fz[64], u0[64], x0[64];
        for (int64_t i = 0; i < m; i++) {
            t0[i] = t1[i] = t2[i] = 1; p00[i] = p11[i] = p22[i] = prior;
            p01[i] = p02[i] = p12[i] = f0[i] = f1[i] = f2[i] = fz[i] = 0;
            u0[i] = u[start + i]; x0[i] = x[start + i];
        }
        for (int64_t k = 1; k < K; k++) {
            const double *uk = u + k * N + start, *xk = x + k * N + start;
            for (int64_t i = 0; i < m; i++) {
                const double du = uk[i] - u0[i], travel = fabs(du);
                const double r0 = -0.5 * (xk[i] + x0[i]) * travel * s0, r1 = du * s1;
                const double r2 = 0.5 * (uk[i] + u0[i]) * travel * s2, rz = (xk[i] - x0[i]) * sz;
                u0[i] = uk[i]; x0[i] = xk[i];
                f0[i] = r0 + pole * (f0[i] - r0); f1[i] = r1 + pole * (f1[i] - r1);
                f2[i] = r2 + pole * (f2[i] - r2); fz[i] = rz + pole * (fz[i] - rz);
                const double on = (f0[i] * f0[i] + f1[i] * f1[i] + f2[i] * f2[i]) * prior > zone;
                const double y = fz[i] - (t0[i] * f0[i] + t1[i] * f1[i] + t2[i] * f2[i]);
                const double w0 = p00[i] * f0[i] + p01[i] * f1[i] + p02[i] * f2[i];
                const double w1 = p01[i] * f0[i] + p11[i] * f1[i] + p12[i] * f2[i];
                const double w2 = p02[i] * f0[i] + p12[i] * f1[i] + p22[i] * f2[i];
                const double g = on / (w0 * f0[i] + w1 * f1[i] + w2 * f2[i] + mu), gy = g * y;
                t0[i] += w0 * gy; t1[i] += w1 * gy; t2[i] += w2 * gy;
                const double size = p00[i] + p11[i] + p22[i] - (w0 * w0 + w1 * w1 + w2 * w2) * g;
                const double in = size <= bound * mu ? on : 0.0, shrink = in * g;
                const double grow = 1.0 + in * (inverse_mu - 1.0);
                p00[i] = (p00[i] - shrink * w0 * w0) * grow; p01[i] = (p01[i] - shrink * w0 * w1) * grow;
                p02[i] = (p02[i] - shrink * w0 * w2) * grow; p11[i] = (p11[i] - shrink * w1 * w1) * grow;
                p12[i] = (p12[i] - shrink * w1 * w2) * grow; p22[i] = (p22[i] - shrink * w2 * w2) * grow;
            }
        }
        for (int64_t i = 0; i < m; i++) {
            work[3 * (start + i)] = t0[i] * par[9]; work[3 * (start + i) + 1] = t1[i] * par[10];
            work[3 * (start + i) + 2] = t2[i] * par[11];
        }
    }
}

/* Extended Kalman filter of (w_h, a, b, c): exact step and Jacobian, the variance of the product a w_h,
 * P symmetric, its update by P - K S K'. par: R, four process noises, start (4), initial variances (4). */
void ekf(int64_t N, const double *u, const double *x, const double *par, double *history) {
    const double R = par[0], q0 = par[1], q1 = par[2], q2 = par[3], q3 = par[4];
    double w = par[5], a = par[6], b = par[7], c = par[8];
    double p00 = par[9], p11 = par[10], p22 = par[11], p33 = par[12];
    double p01 = 0, p02 = 0, p03 = 0, p12 = 0, p13 = 0, p23 = 0, u0 = u[0];
    for (int64_t k = 0; k < N; k++) {
        const double du = u[k] - u0, distance = fabs(du), travel = a * distance;
        u0 = u[k];
        const double decay = relative_decay(travel), kept = 1 - travel * decay;
        const double slope = travel == 0 ? -0.5 : (kept - decay) / travel, pull = travel * w + b * du;
        const double by_a = -distance * (slope * pull + decay * w), by_b = -decay * du;
        const double extra = (p11 * p00 + p01 * p01) * distance / fabs(a);
        w -= decay * pull;
        const double r0 = kept * p00 + by_a * p01 + by_b * p02, r1 = kept * p01 + by_a * p11 + by_b * p12;
        const double r2 = kept * p02 + by_a * p12 + by_b * p22, r3 = kept * p03 + by_a * p13 + by_b * p23;
        p00 = kept * r0 + by_a * r1 + by_b * r2 + q0 + extra;
        p01 = r1; p02 = r2; p03 = r3; p11 += q1; p22 += q2; p33 += q3;
        const double h = u[k];
        const double y = x[k] - (w + h * c);
        const double g0 = p00 + p03 * h, g1 = p01 + p13 * h, g2 = p02 + p23 * h, g3 = p03 + p33 * h;
        const double i = 1.0 / (g0 + h * g3 + R);
        const double k0 = g0 * i, k1 = g1 * i, k2 = g2 * i, k3 = g3 * i;
        w += k0 * y; a += k1 * y; b += k2 * y; c += k3 * y;
        p00 -= k0 * g0; p01 -= k0 * g1; p02 -= k0 * g2; p03 -= k0 * g3; p11 -= k1 * g1;
        p12 -= k1 * g2; p13 -= k1 * g3; p22 -= k2 * g2; p23 -= k2 * g3; p33 -= k3 * g3;
        history[4 * k] = w; history[4 * k + 1] = a; history[4 * k + 2] = b; history[4 * k + 3] = c;
    }
}

/* Voltage for a reference by the closed form in increments, three steps of Newton, within a range.
 * par: a, b, c, minimum, maximum. */
void inverse(int64_t N, const double *r, const double *par, double *out) {
    const double a = par[0], b = par[1], c = par[2];
    double u = 0, w = 0;
    for (int64_t k = 0; k < N; k++) {
        const double dr = r[k] - (c * u + w), s = (dr > 0) - (dr < 0);
        const double e = fmin(fmax((b + s * a * w) / c, 0.0), 1.0), d = a * fabs(dr) / c;
        const double slope = 1 - e - 0.5 * d;
        double z = fmin(2 * d / (slope + sqrt(slope * slope + 2 * d) + 1e-300), d + e);
        for (int j = 0; j < 3; j++) {
            const double decayed = -z * relative_decay(z);
            z -= (z + e * decayed - d) / (1 - e * (1 + decayed) + 1e-300);
        }
        const double wanted = u + s * z / a;
        const double given = wanted < par[3] ? par[3] : wanted > par[4] ? par[4] : wanted;
        const double du = given - u, travel = a * fabs(du);
        w -= relative_decay(travel) * (travel * w + b * du);
        u = given;
        out[k] = u;
    }
}

/* One sample of recursive least squares of n parameters with forgetting; n is a constant where it is put in
 * place. P is symmetric. */
static inline __attribute__((always_inline)) void learn(int n, double mu, double R, double inverse_mu, double x,
                                                        const double *phi, double *t, double (*P)[n], double *w) {
    double quadratic = 0, innovation = x;
    for (int i = 0; i < n; i++) w[i] = 0;
    for (int j = 0; j < n; j++)
        for (int i = 0; i < n; i++) w[i] += P[j][i] * phi[j];
    for (int i = 0; i < n; i++) { quadratic += phi[i] * w[i]; innovation -= phi[i] * t[i]; }
    const double g = 1.0 / (quadratic + mu * R);
    for (int i = 0; i < n; i++) t[i] += w[i] * g * innovation;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) P[i][j] = (P[i][j] - g * w[i] * w[j]) * inverse_mu;
}

static inline double between(double p, double low, double high) { return p > high ? high : p < low ? low : p; }

/* Recursive least squares of a gain, M slopes of plays and a level, on each sample, with forgetting.
 * par: forgetting, R, initial variance, level's variance; then M thresholds and M + 2 scales. */
#define M 12
#define S (M + 2)
void plays(int64_t N, const double *u, const double *x, const double *par, double *out) {
    const double mu = par[0], R = par[1], inverse_mu = 1.0 / mu;
    const double *threshold = par + 4, *scale = threshold + M;
    double y[M] = {0}, t[S] = {0}, P[S][S] = {{0}}, phi[S], w[S];
    for (int i = 0; i < S; i++) P[i][i] = i < S - 1 ? par[2] : par[3];
    for (int64_t k = 0; k < N; k++) {
        phi[0] = u[k] * scale[0];
        for (int i = 0; i < M; i++) {
            y[i] = between(y[i], u[k] - threshold[i], u[k] + threshold[i]);
            phi[i + 1] = y[i] * scale[i + 1];
        }
        phi[S - 1] = 1.0;
        learn(S, mu, R, inverse_mu, x[k], phi, t, P, w);
        for (int i = 0; i < S; i++) out[S * k + i] = t[i] * scale[i];
    }
}

/* The same with three slopes for each play and for the voltage, one for each part of the range, and C terms of
 * creep of what the slopes give. par as above, with S scales replaced by the two bends and C decays. */
#define C 3
#define SLOPES (3 * (M + 1))
#define B (SLOPES + C + 1)
void bent_plays(int64_t N, const double *u, const double *x, const double *par, double *out) {
    const double mu = par[0], R = par[1], inverse_mu = 1.0 / mu;
    const double *threshold = par + 4, *bend = threshold + M, *decay = bend + 2;
    const double edge[4] = {-1e30, bend[0], bend[1], 1e30};
    double y[M] = {0}, t[B] = {0}, P[B][B] = {{0}}, phi[B], w[B], z[C] = {0}, zero[3];
    for (int i = 0; i < B; i++) P[i][i] = i < B - 1 ? par[2] : par[3];
    for (int s = 0; s < 3; s++) zero[s] = between(0.0, edge[s], edge[s + 1]);
    for (int64_t k = 0; k < N; k++) {
        double slow = 0, sums[4] = {0};
        for (int i = 0; i <= M; i++) {
            if (i > 0) y[i - 1] = between(y[i - 1], u[k] - threshold[i - 1], u[k] + threshold[i - 1]);
            const double p = i > 0 ? y[i - 1] : u[k];
            for (int s = 0; s < 3; s++) phi[3 * i + s] = between(p, edge[s], edge[s + 1]) - zero[s];
        }
        for (int i = 0; i + 3 < SLOPES; i += 4) // no sum waits for another's last product
            for (int j = 0; j < 4; j++) sums[j] += t[i + j] * phi[i + j];
        for (int i = SLOPES - SLOPES % 4; i < SLOPES; i++) slow += t[i] * phi[i];
        slow += (sums[0] + sums[1]) + (sums[2] + sums[3]);
        for (int j = 0; j < C; j++) phi[SLOPES + j] = z[j] += (1.0 - decay[j]) * (slow - z[j]);
        phi[B - 1] = 1.0;
        learn(B, mu, R, inverse_mu, x[k], phi, t, P, w);
        for (int i = 0; i < B; i++) out[B * k + i] = t[i];
    }
}
