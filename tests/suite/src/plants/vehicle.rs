//! Things that move about.

use super::Family;
use crate::plant::{Plant, Row};
use crate::random::{Draw, digits};

pub(super) const FAMILIES: &[Family] = &[car, unicycle, planar_copter, puck, scooter, rocket, ship, lateral_car, omni];

fn car(draw: &mut Draw) -> Plant {
    let l = draw.sheet(0.2, 2.8);
    let speed = draw.uniform(1.0, 2.0) * l.max(0.5);
    let c = draw.sheet(0.2, 0.8);
    Plant::new("car", |p, x, u, _, d| {
        let (sin, cos) = x[2].sin_cos();
        d[0] = x[3] * cos;
        d[1] = x[3] * sin;
        d[2] = x[3] / p[0] * u[1].tan();
        d[3] = p[1] * u[0] - p[2] * x[3];
    })
    .row("x", "m", "v*cos(th)", (0.0, 1.0), Row::Kinematic)
    .row("y", "m", "v*sin(th)", (0.0, 1.0), Row::Kinematic)
    .row("th", "rad", "v*tan(de)/L", (0.0, 1.0), Row::Rate)
    .row("v", "m/s", "k*a - c*v", (speed, 0.3 * speed), Row::Force { position: None, angle: false })
    .drive("a", "", 0.5, 0.4, true)
    .control("de", "rad", draw.uniform(0.2, 0.45))
    .parameter("L", "m", l)
    .parameter("k", "m/s^2", digits(speed * c / 0.5, 3))
    .parameter("c", "1/s", c)
    .timing(draw.uniform(10.0, 25.0), draw.uniform(20.0, 40.0), (0.05, 0.5))
}

fn unicycle(draw: &mut Draw) -> Plant {
    let (k, b) = (draw.sheet(0.05, 0.2), draw.sheet(0.2, 0.5));
    Plant::new("unicycle", |p, x, u, _, d| {
        // Wheel radius and track, wheel speeds as commands.
        let (forward, turn) = (0.5 * p[0] * (u[0] + u[1]), p[0] / p[1] * (u[1] - u[0]));
        d[0] = forward * x[2].cos();
        d[1] = forward * x[2].sin();
        d[2] = turn;
    })
    .position("x", "m", "r/2*(wl + wr)*cos(th)", 1.0)
    .position("y", "m", "r/2*(wl + wr)*sin(th)", 1.0)
    .row("th", "rad", "r/b*(wr - wl)", (0.0, 1.5), Row::Rate)
    .drive("wl", "rad/s", 4.0, 3.0, false)
    .drive("wr", "rad/s", 4.0, 3.0, false)
    .parameter("r", "m", k)
    .parameter("b", "m", b)
    .timing(draw.uniform(10.0, 30.0), draw.uniform(15.0, 30.0), (0.05, 0.5))
}

fn planar_copter(draw: &mut Draw) -> Plant {
    let (m, arm) = (draw.sheet(0.3, 2.0), draw.sheet(0.1, 0.3));
    let inertia = digits(m * arm * arm * draw.uniform(0.3, 0.6), 3);
    let c = digits(m * draw.uniform(0.1, 0.4), 3);
    let hover = 0.5 * m * 9.81;
    let (ph, dh) = (0.5 * m * 4.0, 0.5 * m * 3.2);
    let (wt, wx) = (draw.uniform(7.0, 10.0), draw.uniform(1.2, 1.8));
    let roll = inertia / (2.0 * arm);
    let tilt = roll * wt * wt;
    // x'' = -g th: the reference of the tilt is (wx^2 (x_ref - x) + 1.6 wx (v_ref - v))/-g.
    let (px, dx) = (tilt * wx * wx / 9.81, tilt * 1.6 * wx / 9.81);
    let spin = roll * 1.4 * wt;
    Plant::new("planar_copter", |p, x, u, _, d| {
        let (lift, twist) = (u[0] + u[1], p[2] * (u[1] - u[0]));
        let (sin, cos) = x[2].sin_cos();
        d[0] = x[3];
        d[1] = x[4];
        d[2] = x[5];
        d[3] = -(lift * sin + p[3] * x[3]) / p[0];
        d[4] = (lift * cos - p[3] * x[4]) / p[0] - p[4];
        d[5] = twist / p[1];
    })
    .position("x", "m", "vx", 0.3)
    .position("z", "m", "vz", 0.3)
    .position("th", "rad", "w", 0.05)
    .velocity("vx", "m/s", "-((f1 + f2)*sin(th) + c*vx)/m", 0.0, Some(0))
    .velocity("vz", "m/s", "((f1 + f2)*cos(th) - c*vz)/m - g", 0.0, Some(1))
    .angular("w", "a*(f2 - f1)/J", 0.0, 2)
    .drive("f1", "N", hover, 0.8 * hover, true)
    .drive("f2", "N", hover, 0.8 * hover, true)
    .parameter("m", "kg", m)
    .parameter("J", "kg*m^2", inertia)
    .parameter("a", "m", arm)
    .parameter("c", "N*s/m", c)
    .constant("g", "m/s^2", 9.81)
    .coupled(&[(3, 4), (4, 3)])
    .timing(draw.uniform(50.0, 100.0), draw.uniform(8.0, 12.0), (0.05, 0.3))
    .closed(
        vec![vec![px, ph, -tilt, dx, dh, -spin], vec![-px, ph, tilt, -dx, dh, spin]],
        &[(0, draw.uniform(0.2, 0.6)), (1, draw.uniform(0.2, 0.6))],
        true,
    )
}

fn puck(draw: &mut Draw) -> Plant {
    let m = draw.sheet(0.1, 1.0);
    let c = digits(m * draw.uniform(0.05, 0.3), 3);
    Plant::new("puck", |p, x, u, _, d| {
        d[0] = x[2];
        d[1] = x[3];
        d[2] = (u[0] - p[1] * x[2]) / p[0];
        d[3] = (u[1] - p[1] * x[3]) / p[0];
    })
    .position("x", "m", "vx", 0.3)
    .position("y", "m", "vy", 0.3)
    .velocity("vx", "m/s", "(fx - c*vx)/m", 0.1, Some(0))
    .velocity("vy", "m/s", "(fy - c*vy)/m", 0.1, Some(1))
    .control("fx", "N", digits(m * draw.uniform(0.3, 1.0), 2))
    .control("fy", "N", digits(m * draw.uniform(0.3, 1.0), 2))
    .parameter("m", "kg", m)
    .parameter("c", "N*s/m", c)
    .coupled(&[(2, 3), (3, 2), (2, 1), (3, 0)])
    .timing(draw.uniform(25.0, 60.0), draw.uniform(12.0, 18.0), (0.1, 0.8))
}

fn scooter(draw: &mut Draw) -> Plant {
    let m = draw.sheet(60.0, 250.0);
    let (push, c) = (digits(m * draw.uniform(1.5, 3.0), 3), digits(m * draw.uniform(0.05, 0.15), 3));
    Plant::new("scooter", |p, x, u, _, d| {
        let wheel = p[0] * u[0];
        d[0] = x[1];
        d[1] = (wheel - p[1] * x[1]) / p[2];
    })
    .position("s", "m", "v", 2.0)
    .row("v", "m/s", "(F*a - c0*v)/m", (6.0, 3.0), Row::Force { position: Some(0), angle: false })
    .drive("a", "", 0.45, 0.45, true)
    .parameter("F", "N", push)
    .parameter("c0", "N*s/m", c)
    .parameter("m", "kg", m)
    .timing(draw.uniform(10.0, 25.0), draw.uniform(30.0, 50.0), (0.03, 0.3))
}

fn rocket(draw: &mut Draw) -> Plant {
    let (m, rate) = (draw.sheet(1.0, 10.0), draw.uniform(10.0, 40.0));
    let c = digits(m * draw.uniform(0.004, 0.02), 3);
    let weight = m * 9.81;
    Plant::new("rocket", |p, x, u, _, d| {
        let drag = p[1] * x[1] * x[1].abs();
        d[0] = x[1];
        d[1] = (u[0] - drag) / p[0] - p[2];
    })
    .row("h", "m", "v", (50.0, 20.0), Row::Kinematic)
    .velocity("v", "m/s", "(F - c*v*abs(v))/m - g", 3.0, Some(0))
    .drive("F", "N", weight, 0.8 * weight, true)
    .parameter("m", "kg", m)
    .parameter("c", "N*s^2/m^2", c)
    .constant("g", "m/s^2", 9.81)
    .timing(rate, draw.uniform(400.0, 700.0) / rate, (0.1, 0.8))
}

fn ship(draw: &mut Draw) -> Plant {
    let (t, k) = (draw.sheet(4.0, 30.0), draw.sheet(0.1, 0.4));
    Plant::new("ship", |p, x, u, _, d| {
        d[0] = x[1];
        d[1] = (p[1] * u[0] - x[1] - p[2] * x[1] * x[1] * x[1]) / p[0];
    })
    .position("psi", "deg", "r", 10.0)
    .velocity("r", "deg/s", "(K*de - r - n3*r^3)/T", 0.5, Some(0))
    .control("de", "deg", draw.uniform(10.0, 25.0))
    .parameter("T", "s", t)
    .parameter("K", "1/s", k)
    .parameter("n3", "s^2/deg^2", draw.sheet(0.005, 0.05))
    .timing((60.0 / t).clamp(2.0, 8.0), 12.0 * t, (0.05 / t, 0.8 / t))
}

fn lateral_car(draw: &mut Draw) -> Plant {
    let m = draw.sheet(900.0, 1800.0);
    let (a, b) = (draw.sheet(1.0, 1.3), draw.sheet(1.3, 1.7));
    let inertia = digits(m * a * b * draw.uniform(0.9, 1.2), 3);
    let stiff = 55.0 * m;
    let (cf, cr) = (digits(stiff * draw.uniform(0.8, 1.0), 3), digits(stiff * draw.uniform(1.0, 1.3), 3));
    let speed = digits(draw.uniform(10.0, 25.0), 3);
    Plant::new("lateral_car", |p, x, u, _, d| {
        let (m, j, a, b, cf, cr, v) = (p[0], p[1], p[2], p[3], p[4], p[5], p[6]);
        let front = cf * (u[0] - (x[0] + a * x[1]) / v);
        let rear = -cr * (x[0] - b * x[1]) / v;
        d[0] = (front + rear) / m - v * x[1];
        d[1] = (a * front - b * rear) / j;
    })
    .balance("vy", "m/s", "(Cf*(de - (vy + a*r)/V) - Cr*(vy - b*r)/V)/m - V*r", (0.0, 0.1))
    .balance("r", "rad/s", "(a*Cf*(de - (vy + a*r)/V) + b*Cr*(vy - b*r)/V)/J", (0.0, 0.05))
    .control("de", "rad", draw.uniform(0.03, 0.1))
    .parameter("m", "kg", m)
    .parameter("J", "kg*m^2", inertia)
    .parameter("a", "m", a)
    .parameter("b", "m", b)
    .parameter("Cf", "N/rad", cf)
    .parameter("Cr", "N/rad", cr)
    .parameter("V", "m/s", speed)
    .coupled(&[(0, 1), (1, 0)])
    .timing(draw.uniform(25.0, 60.0), draw.uniform(10.0, 18.0), (0.1, 2.0))
}

fn omni(draw: &mut Draw) -> Plant {
    // A platform on three wheels at 120 degrees; velocities in its own frame.
    let m = draw.sheet(5.0, 30.0);
    let r = draw.sheet(0.15, 0.4);
    let inertia = digits(0.5 * m * r * r, 3);
    let force = digits(m * draw.uniform(0.6, 1.5), 2);
    Plant::new("omni", |p, x, u, _, d| {
        let (sin, cos) = x[2].sin_cos();
        let forward = 3f64.sqrt() / 2.0 * (u[0] - u[1]);
        let aside = u[2] - 0.5 * u[0] - 0.5 * u[1];
        d[0] = cos * x[3] - sin * x[4];
        d[1] = sin * x[3] + cos * x[4];
        d[2] = x[5];
        d[3] = (forward - p[2] * x[3]) / p[0] + x[5] * x[4];
        d[4] = (aside - p[2] * x[4]) / p[0] - x[5] * x[3];
        d[5] = (p[4] * (u[0] + u[1] + u[2]) - p[3] * x[5]) / p[1];
    })
    .position("x", "m", "vx*cos(th) - vy*sin(th)", 1.0)
    .position("y", "m", "vx*sin(th) + vy*cos(th)", 1.0)
    .position("th", "rad", "w", 1.0)
    .velocity("vx", "m/s", "(sqrt(3)/2*(f1 - f2) - c*vx)/m + vy*w", 0.3, None)
    .velocity("vy", "m/s", "(f3 - (f1 + f2)/2 - c*vy)/m - vx*w", 0.3, None)
    .angular("w", "(r*(f1 + f2 + f3) - cw*w)/J", 0.3, 2)
    .control("f1", "N", force)
    .control("f2", "N", force)
    .control("f3", "N", force)
    .parameter("m", "kg", m)
    .parameter("J", "kg*m^2", inertia)
    .parameter("c", "N*s/m", digits(m * draw.uniform(0.4, 1.0), 3))
    .parameter("cw", "N*m*s", digits(inertia * draw.uniform(1.5, 4.0), 3))
    .parameter("r", "m", r)
    .coupled(&[(3, 4), (4, 3), (3, 5), (4, 5)])
    .timing(draw.uniform(25.0, 50.0), draw.uniform(12.0, 20.0), (0.1, 1.0))
}
