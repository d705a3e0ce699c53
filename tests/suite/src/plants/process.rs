//! Levels, temperatures, concentrations and populations.

use super::Family;
use crate::plant::Plant;
use crate::random::{Draw, digits};

pub(super) const FAMILIES: &[Family] =
    &[tanks, predators, epidemic, heaters, reactor, kettle, chemostat, gas_vessel, dose];

fn tanks(draw: &mut Draw) -> Plant {
    let (a1, a2) = (draw.sheet(50.0, 300.0), draw.sheet(50.0, 300.0));
    let level = draw.uniform(8.0, 20.0);
    let c1 = digits(a1 * draw.uniform(0.01, 0.03), 3);
    let c2 = digits(c1 * draw.uniform(0.7, 1.2), 3);
    let pump = digits(c1 * level.sqrt() / 5.0, 3);
    let tau = 2.0 * a1 * level.sqrt() / c1;
    let mut plant = Plant::new("tanks", |p, x, u, _, d| {
        let (first, second) = (p[0] * x[0].max(0.0).sqrt(), p[1] * x[1].max(0.0).sqrt());
        d[0] = (p[2] * u[0] - first) / p[3];
        d[1] = (first - second) / p[4];
    })
    .balance("h1", "cm", "(kp*u - c1*sqrt(max(h1, 0)))/A1", (level, 0.3 * level))
    .balance("h2", "cm", "(c1*sqrt(max(h1, 0)) - c2*sqrt(max(h2, 0)))/A2", (level, 0.3 * level))
    .drive("u", "V", 5.0, draw.uniform(1.5, 2.5), true)
    .parameter("c1", "cm^2.5/s", c1)
    .parameter("c2", "cm^2.5/s", c2)
    .parameter("kp", "cm^3/s/V", pump)
    .parameter("A1", "cm^2", a1)
    .parameter("A2", "cm^2", a2)
    .coupled(&[(1, 0), (0, 1)])
    .timing(100.0 / tau, 8.0 * tau, (0.1 / tau, 1.5 / tau));
    plant.positive = true;
    plant
}

fn predators(draw: &mut Draw) -> Plant {
    let (a, c) = (draw.sheet(0.5, 1.2), draw.sheet(0.4, 1.0));
    let (b, e) = (draw.sheet(0.02, 0.06), draw.sheet(0.01, 0.03));
    let (prey, hunters) = (c / e, a / b);
    let mut plant = Plant::new("predators", |p, x, u, _, d| {
        let met = x[0] * x[1];
        d[0] = (p[0] - u[0]) * x[0] - p[1] * met;
        d[1] = p[3] * met - p[2] * x[1];
    })
    .balance("n", "", "a*n - b*n*m - h*n", (0.9 * prey, 0.3 * prey))
    .balance("m", "", "e*n*m - c*m", (hunters, 0.3 * hunters))
    .drive("h", "1/d", 0.1 * a, 0.1 * a, true)
    .parameter("a", "1/d", a)
    .parameter("b", "1/d", b)
    .parameter("c", "1/d", c)
    .parameter("e", "1/d", e)
    .coupled(&[(0, 1), (1, 0)])
    .timing(draw.uniform(5.0, 12.0), draw.uniform(40.0, 80.0), (0.02, 0.3));
    plant.positive = true;
    plant
}

fn epidemic(draw: &mut Draw) -> Plant {
    let gamma = draw.sheet(0.1, 0.4);
    let beta = digits(gamma * draw.uniform(1.8, 3.5), 3);
    let mut plant = Plant::new("epidemic", |p, x, u, _, d| {
        let infected = p[0] * (1.0 - u[0]) * x[0] * x[1] / 100.0;
        d[0] = p[2] * (100.0 - x[0]) - infected;
        d[1] = infected - (p[1] + p[2]) * x[1];
    })
    .balance("S", "%", "mu*(100 - S) - beta*(1 - q)*S*I/100", (55.0, 15.0))
    .balance("I", "%", "beta*(1 - q)*S*I/100 - (gamma + mu)*I", (8.0, 4.0))
    .drive("q", "", 0.25, 0.25, true)
    .parameter("beta", "1/d", beta)
    .parameter("gamma", "1/d", gamma)
    .parameter("mu", "1/d", draw.sheet(0.03, 0.08))
    .coupled(&[(0, 1), (1, 0)])
    .timing(draw.uniform(4.0, 10.0), draw.uniform(80.0, 120.0), (0.01, 0.12));
    plant.positive = true;
    plant
}

fn heaters(draw: &mut Draw) -> Plant {
    let (c1, c2) = (draw.sheet(4.0, 20.0), draw.sheet(4.0, 20.0));
    let (g, k) = (draw.sheet(0.03, 0.12), draw.sheet(0.03, 0.15));
    let power = draw.sheet(2.0, 6.0);
    let tau = c1.max(c2) / g;
    let room = digits(draw.uniform(17.0, 26.0), 3);
    Plant::new("heaters", |p, x, u, _, d| {
        let across = p[1] * (x[0] - x[1]);
        d[0] = (p[2] * u[0] - p[0] * (x[0] - p[5]) - across) / p[3];
        d[1] = (p[2] * u[1] - p[0] * (x[1] - p[5]) + across) / p[4];
    })
    .balance("T1", "degC", "(P*q1 - G*(T1 - Te) - K*(T1 - T2))/C1", (room + 5.0, 4.0))
    .balance("T2", "degC", "(P*q2 - G*(T2 - Te) - K*(T2 - T1))/C2", (room + 5.0, 4.0))
    .drive("q1", "", 0.5, 0.5, true)
    .drive("q2", "", 0.5, 0.5, true)
    .parameter("G", "W/K", g)
    .parameter("K", "W/K", k)
    .parameter("P", "W", power)
    .parameter("C1", "J/K", c1)
    .parameter("C2", "J/K", c2)
    .parameter("Te", "degC", room)
    .coupled(&[(0, 1), (1, 0)])
    .timing((150.0 / tau).max(2.0), 5.0 * tau.min(120.0), (0.1 / tau, 2.0 / tau))
}

fn reactor(draw: &mut Draw) -> Plant {
    let (k1, k2) = (draw.sheet(0.04, 0.2), draw.sheet(0.02, 0.1));
    let mut plant = Plant::new("reactor", |p, x, u, _, d| {
        let first = p[1] * x[0];
        d[0] = u[0] * (p[0] - x[0]) - first;
        d[1] = first - p[2] * x[1] * x[1] - u[0] * x[1];
    })
    .balance("ca", "mol/l", "q*(cf - ca) - k1*ca", (1.0, 0.5))
    .balance("cb", "mol/l", "-q*cb + k1*ca - k2*cb^2", (0.6, 0.3))
    .drive("q", "1/s", 0.1, 0.09, true)
    .parameter("cf", "mol/l", draw.sheet(1.5, 3.5))
    .parameter("k1", "1/s", k1)
    .parameter("k2", "l/mol/s", k2)
    .coupled(&[(0, 1), (1, 0)])
    .timing(draw.uniform(2.0, 5.0), draw.uniform(120.0, 240.0), (0.005, 0.08));
    plant.positive = true;
    plant
}

fn kettle(draw: &mut Draw) -> Plant {
    let (g, c) = (draw.sheet(1.0, 5.0), draw.sheet(200.0, 1500.0));
    let tau = c / g;
    let room = digits(draw.uniform(17.0, 26.0), 3);
    Plant::new("kettle", |p, x, u, _, d| {
        let lost = p[0] * (x[0] - p[1]);
        d[0] = (u[0] - lost) / p[2];
    })
    .balance("T", "degC", "(P - G*(T - Te))/C", (room + 15.0, 12.0))
    .drive("P", "W", digits(30.0 * g, 2), digits(30.0 * g, 2), true)
    .parameter("G", "W/K", g)
    .parameter("Te", "degC", room)
    .parameter("C", "J/K", c)
    .timing((150.0 / tau).max(2.0), 5.0 * tau.min(150.0), (0.15 / tau, 2.0 / tau))
}

fn chemostat(draw: &mut Draw) -> Plant {
    let (top, half, yields) = (draw.sheet(0.3, 0.8), draw.sheet(0.3, 1.0), draw.sheet(0.3, 0.6));
    let mut plant = Plant::new("chemostat", |p, x, u, _, d| {
        let (food, cells) = (x[1], x[0]);
        let growth = p[0] * food / (p[1] + food) * cells;
        d[0] = growth - u[0] * cells;
        d[1] = u[0] * (p[3] - food) - growth / p[2];
    })
    .balance("X", "g/l", "mu*S/(Ks + S)*X - D*X", (2.0, 0.6))
    .balance("S", "g/l", "D*(Sf - S) - mu*S/(Ks + S)*X/Y", (1.0, 0.4))
    .drive("D", "1/h", 0.35 * top, 0.3 * top, true)
    .parameter("mu", "1/h", top)
    .parameter("Ks", "g/l", half)
    .parameter("Y", "", yields)
    .parameter("Sf", "g/l", draw.sheet(4.0, 9.0))
    .coupled(&[(0, 1), (1, 0)])
    .timing(draw.uniform(4.0, 8.0), draw.uniform(60.0, 120.0), (0.01, 0.15));
    plant.positive = true;
    plant
}

fn gas_vessel(draw: &mut Draw) -> Plant {
    // A vessel with inflow through a valve and outflow by pressure, and a second one behind a pipe.
    let (v1, v2) = (draw.sheet(2.0, 10.0), draw.sheet(2.0, 10.0));
    let (pipe, leak, valve) = (draw.sheet(0.5, 2.0), draw.sheet(0.3, 1.5), draw.sheet(0.4, 2.0));
    let mut plant = Plant::new("gas_vessel", |p, x, u, _, d| {
        let (through, out) = (p[2] * (x[0] - x[1]), p[3] * (x[1] - 1.0));
        d[0] = (p[4] * u[0] - through) / p[0];
        d[1] = (through - out) / p[1];
    })
    .balance("p1", "bar", "(kv*u - kp*(p1 - p2))/V1", (3.0, 1.0))
    .balance("p2", "bar", "(kp*(p1 - p2) - kl*(p2 - 1))/V2", (2.5, 0.7))
    .drive("u", "", 1.0, 0.9, true)
    .parameter("V1", "l", v1)
    .parameter("V2", "l", v2)
    .parameter("kp", "l/s", pipe)
    .parameter("kl", "l/s", leak)
    .parameter("kv", "l*bar/s", valve)
    .coupled(&[(1, 0)])
    .timing(draw.uniform(4.0, 10.0), draw.uniform(60.0, 120.0), (0.01, 0.2));
    plant.positive = true;
    plant
}

fn dose(draw: &mut Draw) -> Plant {
    // A dose that passes from gut to blood to tissue and out: no control.
    let mut plant = Plant::new("dose", |p, x, _, _, d| {
        let (taken, there, back) = (p[0] * x[0], p[1] * x[1], p[2] * x[2]);
        d[0] = -taken;
        d[1] = taken - there + back - p[3] * x[1];
        d[2] = there - back;
    })
    .balance("gut", "mg", "-ka*gut", (70.0, 30.0))
    .balance("blood", "mg", "ka*gut - k12*blood + k21*tissue - ke*blood", (20.0, 18.0))
    .balance("tissue", "mg", "k12*blood - k21*tissue", (20.0, 18.0))
    .parameter("ka", "1/h", draw.sheet(0.3, 1.0))
    .parameter("k12", "1/h", draw.sheet(0.2, 0.8))
    .parameter("k21", "1/h", draw.sheet(0.2, 0.6))
    .parameter("ke", "1/h", draw.sheet(0.1, 0.4))
    .coupled(&[(0, 1), (2, 0), (1, 2)])
    .timing(draw.uniform(15.0, 30.0), draw.uniform(15.0, 25.0), (0.05, 0.4));
    plant.positive = true;
    plant
}
