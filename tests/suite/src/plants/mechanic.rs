//! Mechanical plants that stay in one place.

use super::Family;
use crate::plant::Plant;
use crate::random::{Draw, digits};
use std::f64::consts::TAU;

pub(super) const FAMILIES: &[Family] = &[
    cart_spring,
    pendulum,
    flexible_joint,
    stage,
    gantry,
    ball_beam,
    cart_pole,
    hoist,
    buoy,
    belt,
    turntable,
    duffing,
    arm,
    bells,
];

fn cart_spring(draw: &mut Draw) -> Plant {
    let (m, omega) = (draw.sheet(0.3, 8.0), TAU * draw.log(0.3, 2.0));
    let k = digits(m * omega * omega, 3);
    let b = digits(2.0 * draw.uniform(0.05, 0.35) * m * omega, 3);
    let force = digits(k * draw.log(0.05, 0.4), 2);
    let plant = Plant::new("cart_spring", |p, x, u, _, d| {
        let (mass, stiffness, damper) = (p[0], p[1], p[2]);
        d[0] = x[1];
        d[1] = (u[0] - damper * x[1] - stiffness * x[0]) / mass;
    })
    .position("x", "m", "v", 0.1)
    .velocity("v", "m/s", "(u - k*x - b*v)/m", 0.1, Some(0))
    .control("u", "N", force)
    .parameter("m", "kg", m)
    .parameter("k", "N/m", k)
    .parameter("b", "N*s/m", b)
    .timing(omega / TAU * draw.uniform(20.0, 60.0), 12.0 * TAU / omega, (0.1 * omega / TAU, 1.6 * omega / TAU));
    if draw.chance(0.7) { plant.log(&[0]) } else { plant }
}

fn pendulum(draw: &mut Draw) -> Plant {
    let (m, l) = (draw.sheet(0.1, 2.0), draw.sheet(0.1, 0.8));
    let omega = (9.81 / l).sqrt();
    let b = digits(2.0 * draw.uniform(0.03, 0.3) * m * l * l * omega, 3);
    let torque = digits(m * 9.81 * l * draw.uniform(0.3, 1.0), 2);
    let plant = Plant::new("pendulum", |p, x, u, _, d| {
        let (mass, length, drag, gravity) = (p[0], p[1], p[2], p[3]);
        let moment = u[0] - drag * x[1] - mass * gravity * length * x[0].sin();
        d[0] = x[1];
        d[1] = moment / (mass * length.powi(2));
    })
    .position("phi", "rad", "om", 0.4)
    .angular("om", "(T - b*om - m*g*l*sin(phi))/(m*l^2)", 0.2, 0)
    .control("T", "N*m", torque)
    .parameter("m", "kg", m)
    .parameter("l", "m", l)
    .parameter("b", "N*m*s", b)
    .constant("g", "m/s^2", 9.81)
    .timing(omega / TAU * draw.uniform(25.0, 70.0), 12.0 * TAU / omega, (0.1 * omega / TAU, 1.5 * omega / TAU));
    if draw.chance(0.7) { plant.log(&[0]) } else { plant }
}

fn flexible_joint(draw: &mut Draw) -> Plant {
    let (jm, jl) = (draw.sheet(0.005, 0.05), draw.sheet(0.01, 0.1));
    let resonance = TAU * draw.log(1.5, 5.0);
    let k = digits(resonance * resonance * jm * jl / (jm + jl), 3);
    let d = digits(0.1 * draw.uniform(0.3, 2.0) * k / resonance, 3);
    let bm = digits(jm * draw.uniform(0.4, 2.0), 3);
    let torque = digits((jm + jl) * draw.uniform(10.0, 40.0), 2);
    let plant = Plant::new("flexible_joint", |p, x, u, _, dx| {
        let (motor, load, spring, damper, bearing) = (p[0], p[1], p[2], p[3], p[4]);
        let shaft = spring * (x[0] - x[1]) + damper * (x[2] - x[3]);
        dx[0] = x[2];
        dx[1] = x[3];
        dx[2] = (u[0] - shaft - bearing * x[2]) / motor;
        dx[3] = shaft / load;
    })
    .position("qm", "rad", "wm", 0.2)
    .position("ql", "rad", "wl", 0.2)
    .angular("wm", "(T - k*(qm - ql) - d*(wm - wl) - bm*wm)/Jm", 0.0, 0)
    .angular("wl", "(k*(qm - ql) + d*(wm - wl))/Jl", 0.0, 1)
    .control("T", "N*m", torque)
    .parameter("Jm", "kg*m^2", jm)
    .parameter("Jl", "kg*m^2", jl)
    .parameter("k", "N*m/rad", k)
    .parameter("d", "N*m*s/rad", d)
    .parameter("bm", "N*m*s/rad", bm)
    .coupled(&[(3, 0), (2, 1)])
    .timing(resonance / TAU * draw.uniform(20.0, 40.0), 20.0 * TAU / resonance, (0.1, 1.4 * resonance / TAU));
    if draw.chance(0.6) { plant.log(&[0, 1]) } else { plant }
}

fn stage(draw: &mut Draw) -> Plant {
    let (m1, m2) = (draw.sheet(0.5, 6.0), draw.sheet(0.5, 6.0));
    let (w1, w2) = (TAU * draw.log(0.4, 1.2), TAU * draw.log(0.4, 1.2));
    let (k1, k2) = (digits(m1 * w1 * w1, 3), digits(m2 * w2 * w2, 3));
    let kc = digits(draw.uniform(0.1, 0.4) * k1.min(k2), 3);
    let (b1, b2) = (digits(0.3 * m1 * w1, 3), digits(0.25 * m2 * w2, 3));
    let plant = Plant::new("stage", |p, x, u, _, d| {
        let bridge = p[4] * (x[0] - x[1]);
        d[0] = x[2];
        d[1] = x[3];
        d[2] = (u[0] - p[2] * x[0] - bridge - p[5] * x[2]) / p[0];
        d[3] = (u[1] - p[3] * x[1] + bridge - p[6] * x[3]) / p[1];
    })
    .position("x", "mm", "vx", 1.0)
    .position("y", "mm", "vy", 1.0)
    .velocity("vx", "mm/s", "(fx - k1*x - kc*(x - y) - b1*vx)/m1", 1.0, Some(0))
    .velocity("vy", "mm/s", "(fy - k2*y - kc*(y - x) - b2*vy)/m2", 1.0, Some(1))
    .control("fx", "mN", digits(2.0 * k1, 2))
    .control("fy", "mN", digits(2.0 * k2, 2))
    .parameter("m1", "kg", m1)
    .parameter("m2", "kg", m2)
    .parameter("k1", "N/m", k1)
    .parameter("k2", "N/m", k2)
    .parameter("kc", "N/m", kc)
    .parameter("b1", "N*s/m", b1)
    .parameter("b2", "N*s/m", b2)
    .coupled(&[(2, 1), (3, 0), (2, 3), (3, 2)])
    .timing(draw.uniform(25.0, 50.0), draw.uniform(12.0, 24.0), (0.1, 1.5));
    if draw.chance(0.5) { plant.log(&[0, 1]) } else { plant }
}

fn gantry(draw: &mut Draw) -> Plant {
    let (m, load, l) = (draw.sheet(2.0, 20.0), draw.sheet(0.5, 6.0), draw.sheet(0.3, 1.5));
    let b = digits(m * draw.uniform(0.5, 2.0), 3);
    let plant = Plant::new("gantry", |p, x, u, _, d| {
        let (trolley, load, rope, drag, air, gravity) = (p[0], p[1], p[2], p[3], p[4], p[5]);
        let (sin, cos) = x[1].sin_cos();
        let swing = load * sin * (rope * x[3] * x[3] + gravity * cos);
        let push = (u[0] - drag * x[2] + swing) / (trolley + load * sin * sin);
        d[0] = x[2];
        d[1] = x[3];
        d[2] = push;
        d[3] = -(push * cos + gravity * sin) / rope - air * x[3];
    })
    .position("x", "m", "v", 0.2)
    .position("th", "rad", "w", 0.3)
    .velocity("v", "m/s", "(F - b*v + ml*sin(th)*(l*w^2 + g*cos(th)))/(m + ml*sin(th)^2)", 0.0, Some(0))
    .angular(
        "w",
        "-(cos(th)*(F - b*v + ml*sin(th)*(l*w^2 + g*cos(th)))/(m + ml*sin(th)^2) + g*sin(th))/l - c*w",
        0.0,
        1,
    )
    .control("F", "N", digits(m * draw.uniform(1.0, 3.0), 2))
    .parameter("m", "kg", m)
    .parameter("ml", "kg", load)
    .parameter("l", "m", l)
    .parameter("b", "N*s/m", b)
    .parameter("c", "1/s", draw.sheet(0.1, 0.5))
    .constant("g", "m/s^2", 9.81)
    .coupled(&[(2, 1), (3, 2)])
    .timing(draw.uniform(25.0, 50.0), draw.uniform(12.0, 20.0), (0.1, 1.2));
    if draw.chance(0.4) { plant.log(&[0, 1]) } else { plant }
}

fn ball_beam(draw: &mut Draw) -> Plant {
    let b = draw.sheet(0.05, 0.3);
    let omega = draw.uniform(1.5, 3.0);
    let s = 5.0 / 7.0 * 9.81;
    Plant::new("ball_beam", |p, x, u, _, d| {
        d[0] = x[1];
        d[1] = 5.0 * p[0] * u[0].sin() / 7.0 - p[1] * x[1];
    })
    .position("p", "m", "v", 0.1)
    .velocity("v", "m/s", "5/7*g*sin(al) - b*v", 0.05, Some(0))
    .control("al", "rad", 0.3)
    .constant("g", "m/s^2", 9.81)
    .parameter("b", "1/s", b)
    .timing(draw.uniform(30.0, 60.0), draw.uniform(12.0, 20.0), (0.05, 0.4))
    .closed(vec![vec![omega * omega / s, 1.4 * omega / s]], &[(0, draw.uniform(0.1, 0.25))], false)
}

fn cart_pole(draw: &mut Draw) -> Plant {
    let (m, pole, l) = (draw.sheet(0.4, 1.5), draw.sheet(0.05, 0.3), draw.sheet(0.3, 0.8));
    let b = draw.sheet(0.1, 0.6);
    // Pole placement on the linear plant: x'' = (F - b v - mp g th)/m, th'' = ((m + mp) g th - F + b v)/(m l).
    let w = (9.81 / l).sqrt() * 1.1;
    let (a, c) = (draw.uniform(0.8, 1.2), draw.uniform(1.6, 2.2));
    // Desired (s^2 + 2 a s + a^2)(s^2 + 2 w s + w^2) = s^4 + c3 s^3 + c2 s^2 + c1 s + c0.
    let w = w * c / 2.0 + 0.5;
    let (c3, c2, c1, c0) = (2.0 * (a + w), a * a + w * w + 4.0 * a * w, 2.0 * a * w * (a + w), a * a * w * w);
    // With y = x + l th the flat output: y'' = g th; F chosen so that l th'' follows; friction is left to the loop.
    let g = 9.81;
    // th'' = v: F = -m l v + (m + mp) g th; y'''' = g v, v = -(c3 y''' + c2 y'' + c1 y' + c0 y)/g.
    let gain_y = [c0 / g, c1 / g, c2, c3];
    let ml = m * l;
    // F = ml (gain . (y, y', th, th')) + (m + mp) g th with y = x + l th; F = K (0 - state) in our sign, so negate.
    let kx = ml * gain_y[0];
    let kth = ml * (gain_y[0] * l + gain_y[2]) + (m + pole) * g;
    let kv = ml * gain_y[1];
    let kw = ml * (gain_y[1] * l + gain_y[3]);
    Plant::new("cart_pole", |p, x, u, _, d| {
        let (cart, pole, length, drag, gravity) = (p[0], p[1], p[2], p[3], p[4]);
        let (sin, cos) = x[1].sin_cos();
        let push =
            (u[0] - drag * x[2] + pole * sin * (length * x[3] * x[3] - gravity * cos)) / (cart + pole * sin * sin);
        d[0] = x[2];
        d[1] = x[3];
        d[2] = push;
        d[3] = (gravity * sin - push * cos) / length;
    })
    .position("x", "m", "v", 0.1)
    .position("th", "rad", "w", 0.05)
    .velocity("v", "m/s", "(F - b*v + mp*sin(th)*(l*w^2 - g*cos(th)))/(m + mp*sin(th)^2)", 0.0, Some(0))
    .angular("w", "(g*sin(th) - cos(th)*(F - b*v + mp*sin(th)*(l*w^2 - g*cos(th)))/(m + mp*sin(th)^2))/l", 0.0, 1)
    .control("F", "N", digits(12.0 * (m + pole), 2))
    .parameter("m", "kg", m)
    .parameter("mp", "kg", pole)
    .parameter("l", "m", l)
    .parameter("b", "N*s/m", b)
    .constant("g", "m/s^2", g)
    .coupled(&[(2, 1), (3, 2)])
    .timing(draw.uniform(60.0, 100.0), draw.uniform(8.0, 15.0), (0.03, 0.2))
    .closed(vec![vec![-kx, -kth, -kv, -kw]], &[(0, draw.uniform(0.1, 0.3))], true)
}

fn hoist(draw: &mut Draw) -> Plant {
    let (m, c) = (draw.sheet(4.0, 30.0), draw.uniform(0.8, 3.0));
    let kf = digits(m * draw.uniform(2.0, 5.0), 3);
    let c = digits(c * m, 3);
    let hover = m * 9.81 / kf;
    let omega = draw.uniform(2.0, 5.0);
    Plant::new("hoist", |p, x, u, _, d| {
        let thrust = p[0] * u[0];
        d[0] = x[1];
        d[1] = (thrust - p[1] * x[1]) / p[2] - p[3];
    })
    .row("h", "m", "v", (1.0, 0.2), crate::plant::Row::Kinematic)
    .velocity("v", "m/s", "(kf*i - c*v)/m - g", 0.0, Some(0))
    .drive("i", "A", hover, 0.9 * hover, true)
    .parameter("kf", "N/A", kf)
    .parameter("c", "N*s/m", c)
    .parameter("m", "kg", m)
    .constant("g", "m/s^2", 9.81)
    .timing(draw.uniform(40.0, 100.0), draw.uniform(10.0, 15.0), (0.05, 0.5))
    .closed(vec![vec![m / kf * omega * omega, m / kf * omega]], &[(0, draw.uniform(0.1, 0.4))], false)
}

fn buoy(draw: &mut Draw) -> Plant {
    let (m, omega) = (draw.sheet(15.0, 200.0), TAU * draw.log(0.25, 0.8));
    let k = digits(m * omega * omega, 3);
    let b = digits(2.0 * draw.uniform(0.05, 0.3) * m * omega, 3);
    Plant::new("buoy", |p, x, u, _, d| {
        let (mass, buoyancy, wave) = (p[2], p[0], p[1]);
        d[0] = x[1];
        d[1] = u[0] / mass - buoyancy / mass * x[0] - wave / mass * x[1];
    })
    .position("z", "m", "vz", 0.1)
    .velocity("vz", "m/s", "(f - k*z - d*vz)/m", 0.05, Some(0))
    .control("f", "N", digits(k * draw.uniform(0.1, 0.4), 2))
    .parameter("k", "N/m", k)
    .parameter("d", "N*s/m", b)
    .parameter("m", "kg", m)
    .timing(omega / TAU * draw.uniform(20.0, 60.0), 12.0 * TAU / omega, (0.1 * omega / TAU, 2.0 * omega / TAU))
}

fn belt(draw: &mut Draw) -> Plant {
    let m = draw.sheet(2.0, 30.0);
    let c = digits(m * draw.uniform(0.5, 2.5), 3);
    Plant::new("belt", |p, x, u, _, d| {
        let roller = p[0] * x[1];
        d[0] = x[1];
        d[1] = (u[0] - roller) / p[1];
    })
    .position("s", "m", "v", 0.5)
    .velocity("v", "m/s", "(u - c*v)/m", 0.0, Some(0))
    .control("u", "N", digits(m * draw.uniform(5.0, 15.0), 2))
    .parameter("c", "N*s/m", c)
    .parameter("m", "kg", m)
    .timing(draw.uniform(40.0, 100.0), draw.uniform(8.0, 15.0), (0.06, 0.5))
    .closed(
        vec![vec![m * draw.uniform(4.0, 20.0), m * draw.uniform(3.0, 8.0)]],
        &[(0, draw.uniform(0.3, 1.2))],
        false,
    )
}

fn turntable(draw: &mut Draw) -> Plant {
    let inertia = draw.sheet(0.005, 0.2);
    let b = digits(inertia * draw.uniform(0.3, 1.5), 3);
    let plant = Plant::new("turntable", |p, x, u, _, d| {
        d[0] = x[1];
        d[1] = u[0] / p[1] - p[0] * x[1] / p[1];
    })
    .position("phi", "rad", "om", 0.5)
    .angular("om", "(T - b*om)/J", 0.5, 0)
    .control("T", "N*m", digits(inertia * draw.uniform(4.0, 20.0), 2))
    .parameter("b", "N*m*s", b)
    .parameter("J", "kg*m^2", inertia)
    .timing(draw.uniform(50.0, 100.0), draw.uniform(8.0, 15.0), (0.1, 1.5));
    if draw.chance(0.7) { plant.log(&[0]) } else { plant }
}

fn duffing(draw: &mut Draw) -> Plant {
    let (d, a, b) = (draw.sheet(0.1, 0.6), draw.sheet(0.5, 3.0), draw.sheet(0.2, 3.0));
    Plant::new("duffing", |p, x, u, _, dx| {
        let (damping, linear, cubic) = (p[0], p[1], p[2]);
        dx[0] = x[1];
        dx[1] = u[0] - damping * x[1] - x[0] * (linear + cubic * x[0] * x[0]);
    })
    .position("x", "mm", "v", 0.5)
    .velocity("v", "mm/s", "u - d*v - a*x - b*x^3", 0.5, Some(0))
    .control("u", "mm/s^2", digits(draw.uniform(0.6, 2.0) * a, 2))
    .parameter("d", "1/s", d)
    .parameter("a", "1/s^2", a)
    .parameter("b", "1/(mm*s)^2", b)
    .timing(draw.uniform(10.0, 25.0), draw.uniform(30.0, 60.0), (0.03, 0.5))
}

fn arm(draw: &mut Draw) -> Plant {
    // A horizontal arm of two links; masses are lumped as usual: A, B, D of the mass matrix.
    let d = draw.sheet(0.02, 0.2);
    let b = digits(d * draw.uniform(0.8, 1.4), 3);
    let a = digits(2.0 * b * b / d + d * draw.uniform(1.5, 3.0), 3);
    let (c1, c2) = (digits(a * draw.uniform(0.5, 2.0), 3), digits(d * draw.uniform(0.5, 2.0), 3));
    let (w1, w2) = (draw.uniform(3.0, 6.0), draw.uniform(4.0, 8.0));
    Plant::new("arm", |p, x, u, _, dx| {
        let (sin, cos) = x[1].sin_cos();
        let (m11, m12, m22) = (p[0] + 2.0 * p[1] * cos, p[2] + p[1] * cos, p[2]);
        let spin = p[1] * sin;
        let r1 = u[0] - p[3] * x[2] + spin * (2.0 * x[2] + x[3]) * x[3];
        let r2 = u[1] - p[4] * x[3] - spin * x[2] * x[2];
        let det = m11 * m22 - m12 * m12;
        dx[0] = x[2];
        dx[1] = x[3];
        dx[2] = (m22 * r1 - m12 * r2) / det;
        dx[3] = (m11 * r2 - m12 * r1) / det;
    })
    .position("q1", "rad", "w1", 0.3)
    .position("q2", "rad", "w2", 0.3)
    .angular(
        "w1",
        "(D*(T1 - c1*w1 + B*sin(q2)*(2*w1*w2 + w2^2)) - (D + B*cos(q2))*(T2 - c2*w2 - B*sin(q2)*w1^2))\
         /((A + 2*B*cos(q2))*D - (D + B*cos(q2))^2)",
        0.0,
        0,
    )
    .angular(
        "w2",
        "((A + 2*B*cos(q2))*(T2 - c2*w2 - B*sin(q2)*w1^2) - (D + B*cos(q2))*(T1 - c1*w1 + B*sin(q2)*(2*w1*w2 + w2^2)))\
         /((A + 2*B*cos(q2))*D - (D + B*cos(q2))^2)",
        0.0,
        1,
    )
    .control("T1", "N*m", digits(a * 40.0, 2))
    .control("T2", "N*m", digits(d * 80.0, 2))
    .parameter("A", "kg*m^2", a)
    .parameter("B", "kg*m^2", b)
    .parameter("D", "kg*m^2", d)
    .parameter("c1", "N*m*s", c1)
    .parameter("c2", "N*m*s", c2)
    .coupled(&[(2, 3), (3, 2)])
    .timing(draw.uniform(50.0, 100.0), draw.uniform(8.0, 12.0), (0.1, 0.8))
    .closed(
        vec![vec![a * w1 * w1, 0.0, a * 1.2 * w1, 0.0], vec![0.0, d * w2 * w2, 0.0, d * 1.2 * w2]],
        &[(0, draw.uniform(0.3, 0.8)), (1, draw.uniform(0.3, 0.8))],
        false,
    )
}

fn bells(draw: &mut Draw) -> Plant {
    // Two pendulums on a soft shaft that swing out: no control at all.
    let (l1, l2) = (draw.sheet(0.2, 0.6), draw.sheet(0.2, 0.6));
    let (c, k) = (draw.sheet(0.05, 0.3), draw.sheet(0.5, 6.0));
    let plant = Plant::new("bells", |p, x, _, _, d| {
        let twist = p[3] * (x[1] - x[0]);
        d[0] = x[2];
        d[1] = x[3];
        d[2] = twist - p[4] / p[0] * x[0].sin() - p[2] * x[2];
        d[3] = -twist - p[4] / p[1] * x[1].sin() - p[2] * x[3];
    })
    .position("a", "rad", "wa", 1.2)
    .position("b", "rad", "wb", 1.2)
    .angular("wa", "-g/l1*sin(a) - c*wa + k*(b - a)", 1.0, 0)
    .angular("wb", "-g/l2*sin(b) - c*wb + k*(a - b)", 1.0, 1)
    .parameter("l1", "m", l1)
    .parameter("l2", "m", l2)
    .parameter("c", "1/s", c)
    .parameter("k", "1/s^2", k)
    .constant("g", "m/s^2", 9.81)
    .coupled(&[(2, 1), (3, 0), (2, 3), (3, 2)])
    .timing(draw.uniform(30.0, 60.0), draw.uniform(8.0, 14.0), (0.3, 1.5));
    if draw.chance(0.5) { plant.log(&[0, 1]) } else { plant }
}
