"""The output-error filter as a textbook has it: NumPy matrices, one sample after the other, no holes."""

import numpy as np
from numpy.typing import NDArray

import piezoest as pz

FloatArray = NDArray[np.float64]


class OutputErrorFilter:
    """Kalman filter on (b, c, d, centre, disturbance), relative to the initial c.

    The voltage's clock is that of a triangle whose turns are seen once it is back by a tenth of its swing.
    """

    def __init__(self, rate: float, start: pz.ColemanHodgdon, decays: FloatArray) -> None:
        self.unit, self.decays = start.c, decays
        self.step_size = float(np.log(decays[1] / decays[0]))
        self.member = decays.size // 2
        self.h, self.slope = np.zeros(decays.size), np.zeros(decays.size)
        self.s = np.array([start.b / start.c, 1.0, 0.0, 0.0, 0.0])
        self.P = np.zeros((5, 5))
        self.P[:3, :3] = 0.25 * self.walk()
        self.slack, self.first_half = max(1.0, 1e-4 * rate) ** 2, 0.05 * rate
        self.primed = False
        # The clock.
        self.direction = self.furthest = self.size = self.turned = 0.0
        self.since = self.usual = 0.0
        self.excitation, self.way = np.zeros((3, 3)), 0.0
        self.before, self.member_before = np.zeros(3), self.member
        self.changes: list[float] = []
        self.noise, self.count = 0.0, 0

    def walk(self) -> FloatArray:
        c = max(self.s[1], 0.01)
        b = min(max(self.s[0], 2e-3 * c), 0.5 * c)
        jacobian = np.array([[-c, -(c - b), c], [-c, 0.0, c], [b, 0.0, 0.0]])
        return jacobian @ jacobian.T

    def follow(self, u: float) -> None:
        self.since += 1.0
        way = u - self.furthest
        self.size = max(self.size, abs(u - self.turned))
        if self.direction * way >= 0.0:
            self.direction = self.direction or float(np.sign(way))
            self.furthest = u
        elif abs(way) > 0.1 * self.size:
            self.usual = self.since if self.usual == 0.0 else 0.5 * (self.usual + self.since)
            self.size += 0.8 * (abs(self.furthest - self.turned) - self.size)
            self.direction, self.turned, self.furthest, self.since = -self.direction, self.furthest, u, 0.0

    def measure_noise(self, x: float) -> None:
        self.changes.append(x)
        self.count = min(self.count + 1, 2000)
        if self.count > 3:
            third = np.diff(self.changes[-4:], 3)[0] if len(self.changes) >= 4 else 0.0
            self.noise += (third**2 / 20.0 - self.noise) / (self.count - 3)

    def step(self, u: float, x: float) -> tuple[float, float]:
        """Innovation and its variance."""
        if not self.primed:
            self.primed, self.u_0, self.x_0, self.u = True, u, x, 0.0
            self.changes = [0.0]
            return 0.0, 0.0
        u, x = u - self.u_0, x - self.x_0
        du, self.u = u - self.u, u
        kept = np.exp(-self.decays * abs(du))
        gone = (1.0 - kept) / self.decays
        # h' = kept h - sign(du) gone, and its derivative by ln(a).
        by_log = self.decays * (-abs(du) * kept * self.h)
        by_log -= np.sign(du) * (abs(du) * kept - gone)
        self.slope = kept * self.slope + by_log
        self.h = kept * self.h - np.sign(du) * gone
        self.follow(u)
        self.measure_noise(x)
        half = min(max(self.usual or self.first_half, self.since), 1e6)
        part = 1.0 / max(self.first_half, self.since) if self.usual == 0.0 else min(abs(du) / self.size, 1.0)

        phi = np.array([self.h[self.member], u, self.slope[self.member], 1.0, 1.0])
        if self.member == self.member_before:
            self.way = min(self.way + part, 1.0)
            change = phi[:3] - self.before
            self.excitation += (np.outer(change, change) / part - part * self.excitation) / self.way
        self.member_before, self.before = self.member, phi[:3].copy()
        walk = 0.5 * 0.4**2
        pace = max(part, 0.2 / half)
        c = max(self.s[1], 0.01)
        Q = walk * self.walk()
        self.P[:3, :3] += part * Q
        self.P[3, 3] += part * walk * (0.3 * c * self.size) ** 2
        memory = 0.3**2
        if self.usual:
            memory += 2.0 * self.noise / (3e-3 * self.size * abs(self.s[1]) * self.unit) ** 2
        swing_noise = memory * float(np.sum(Q * self.excitation))
        F = np.diag([1.0, 1.0, 1.0, 1.0, np.exp(-pace / 0.3)])
        self.s, self.P = F @ self.s, F @ self.P @ F.T
        self.P[4, 4] += (1.0 - F[4, 4] ** 2) * 0.5 * 0.3 * swing_noise
        R = self.slack * swing_noise * pace + (1.5e-3**2 + self.noise) / self.unit**2

        y = x / self.unit - phi @ self.s
        S = phi @ self.P @ phi + R
        K = self.P @ phi / S
        self.s = self.s + K * y
        A = np.eye(5) - np.outer(K, phi)
        self.P = A @ self.P @ A.T + R * np.outer(K, K)
        way = self.s[2] / self.s[0]
        sign = int(np.sign(way))
        if abs(way) > 0.6 * self.step_size and 0 <= self.member + sign < self.decays.size:
            T = np.eye(5)
            T[2, 0] = -sign * self.step_size
            self.s, self.P = T @ self.s, T @ self.P @ T.T
            self.member += sign
        return y * self.unit, S * self.unit**2
