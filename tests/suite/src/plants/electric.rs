//! Electric and electromechanical plants.

use super::Family;
use crate::plant::Plant;
use crate::random::{Draw, digits};
use std::f64::consts::TAU;

pub(super) const FAMILIES: &[Family] = &[dc_motor, speed_drive, rlc, van_der_pol, ladder, voice_coil];

fn dc_motor(draw: &mut Draw) -> Plant {
    let (r, kt, inertia) = (draw.sheet(0.5, 5.0), draw.sheet(0.02, 0.2), draw.sheet(1e-4, 2e-3));
    let l = digits(r * draw.log(0.01, 0.05), 3);
    let b = digits(0.2 * kt * kt / r * draw.uniform(0.5, 3.0), 3);
    let slow = inertia * r / (kt * kt);
    let rate = (8.0 * r / l).clamp(40.0, 200.0);
    Plant::new("dc_motor", |p, x, u, _, d| {
        let (resistance, inductance, torque, inertia, drag) = (p[0], p[1], p[2], p[3], p[4]);
        d[0] = (torque * x[1] - drag * x[0]) / inertia;
        d[1] = (u[0] - resistance * x[1] - torque * x[0]) / inductance;
    })
    .velocity("om", "rad/s", "(kt*i - b*om)/J", 1.0, None)
    .balance("i", "A", "(V - R*i - kt*om)/L", (0.0, 0.1))
    .control("V", "V", digits(draw.uniform(4.0, 24.0), 2))
    .parameter("R", "Ohm", r)
    .parameter("L", "H", l)
    .parameter("kt", "N*m/A", kt)
    .parameter("J", "kg*m^2", inertia)
    .parameter("b", "N*m*s", b)
    .timing(rate, draw.uniform(500.0, 1200.0) / rate, (0.1 / slow.min(2.0), 1.5 / slow.max(0.05)))
}

fn speed_drive(draw: &mut Draw) -> Plant {
    let (k, tau) = (draw.sheet(2.0, 30.0), draw.sheet(0.1, 2.0));
    Plant::new("speed_drive", |p, x, u, _, d| {
        d[0] = x[1];
        d[1] = p[0] / p[1] * u[0] - x[1] / p[1];
    })
    .position("phi", "rad", "om", 0.0)
    .angular("om", "(K*V - om)/tau", 1.0, 0)
    .control("V", "V", digits(draw.uniform(1.0, 10.0), 2))
    .parameter("K", "rad/s/V", k)
    .parameter("tau", "s", tau)
    .timing(20.0 / tau.clamp(0.2, 1.0), 30.0 * tau.clamp(0.3, 1.0), (0.05 / tau, 1.0 / tau))
    .log(if draw.chance(0.5) { &[0, 1] } else { &[0] })
}

fn rlc(draw: &mut Draw) -> Plant {
    let (l, omega) = (draw.sheet(0.01, 0.2), TAU * draw.log(0.6, 6.0));
    let c = digits(1.0 / (l * omega * omega), 3);
    let r = digits(2.0 * draw.uniform(0.08, 0.4) * l * omega, 3);
    Plant::new("rlc", |p, x, u, _, d| {
        d[0] = x[1] / p[0];
        d[1] = (u[0] - x[0]) / p[2] - p[1] / p[2] * x[1];
    })
    .balance("uc", "V", "il/C", (0.0, 0.5))
    .balance("il", "A", "(e - R*il - uc)/L", (0.0, 0.1))
    .control("e", "V", digits(draw.uniform(1.0, 12.0), 2))
    .parameter("C", "F", c)
    .parameter("R", "Ohm", r)
    .parameter("L", "H", l)
    .coupled(&[(1, 0)])
    .timing(omega / TAU * draw.uniform(20.0, 40.0), 18.0 * TAU / omega, (0.1 * omega / TAU, 1.6 * omega / TAU))
}

fn van_der_pol(draw: &mut Draw) -> Plant {
    let (mu, w) = (draw.sheet(0.3, 1.5), draw.sheet(1.0, 6.0));
    Plant::new("van_der_pol", |p, x, u, _, d| {
        let (gain, frequency) = (p[0] * p[1], p[1] * p[1]);
        d[0] = x[1];
        d[1] = gain * x[1] - gain * x[0] * x[0] * x[1] - frequency * x[0] + u[0];
    })
    .position("q", "V", "r", 1.5)
    .velocity("r", "V/s", "mu*w*(1 - q^2)*r - w^2*q + e", 1.0, Some(0))
    .control("e", "V/s^2", digits(w * w * draw.uniform(0.4, 1.5), 2))
    .parameter("mu", "", mu)
    .parameter("w", "rad/s", w)
    .timing(w / TAU * draw.uniform(25.0, 50.0), 14.0 * TAU / w, (0.05 * w, 0.3 * w))
}

fn ladder(draw: &mut Draw) -> Plant {
    let tau = draw.log(0.02, 0.5);
    let (r1, r2) = (draw.sheet(0.5, 5.0), draw.sheet(0.5, 5.0));
    let (c1, c2) = (digits(tau / r1, 3), digits(tau * draw.uniform(0.5, 2.0) / r2, 3));
    Plant::new("ladder", |p, x, u, _, d| {
        let (first, second) = ((u[0] - x[0]) / p[0], (x[0] - x[1]) / p[1]);
        d[0] = (first - second) / p[2];
        d[1] = (second - p[4] * x[1]) / p[3];
    })
    .balance("u1", "V", "((e - u1)/R1 - (u1 - u2)/R2)/C1", (0.0, 1.0))
    .balance("u2", "V", "((u1 - u2)/R2 - G*u2)/C2", (0.0, 1.0))
    .control("e", "V", digits(draw.uniform(1.0, 10.0), 2))
    .parameter("R1", "kOhm", r1)
    .parameter("R2", "kOhm", r2)
    .parameter("C1", "mF", c1)
    .parameter("C2", "mF", c2)
    .parameter("G", "mS", digits(draw.uniform(0.1, 0.4) / r2, 3))
    .coupled(&[(1, 0)])
    .timing((8.0 / tau).min(200.0), 100.0 * tau.max(0.04), (0.03 / tau, 0.4 / tau))
}

fn voice_coil(draw: &mut Draw) -> Plant {
    let (m, omega) = (draw.sheet(0.01, 0.2), TAU * draw.log(2.0, 8.0));
    let k = digits(m * omega * omega, 3);
    let (bl, r) = (draw.sheet(2.0, 8.0), draw.sheet(2.0, 8.0));
    let b = digits(2.0 * draw.uniform(0.05, 0.2) * m * omega, 3);
    let volt = digits(k * 0.004 * r / bl, 2);
    Plant::new("voice_coil", |p, x, u, _, d| {
        // The coil's current follows at once: i = (e - Bl v)/R; lengths in mm.
        let current = (u[0] - p[0] * x[1] / 1000.0) / p[1];
        d[0] = x[1];
        d[1] = (1000.0 * p[0] * current - p[2] * x[0] - p[3] * x[1]) / p[4];
    })
    .position("x", "mm", "v", 0.5)
    .velocity("v", "mm/s", "(1000*Bl*(e - Bl*v/1000)/R - k*x - b*v)/m", 5.0, Some(0))
    .control("e", "V", volt)
    .parameter("Bl", "N/A", bl)
    .parameter("R", "Ohm", r)
    .parameter("k", "N/m", k)
    .parameter("b", "N*s/m", b)
    .parameter("m", "kg", m)
    .timing((omega / TAU * 25.0).min(200.0), 25.0 * TAU / omega, (0.1 * omega / TAU, 1.5 * omega / TAU))
}
