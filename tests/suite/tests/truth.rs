//! The truth simulator against solutions on paper.

#![allow(clippy::unwrap_used, clippy::panic)]

use gpsindy_suite::effect::{Act, Actuator, Effect, Friction, Sensor, Variable};
use gpsindy_suite::plant::Plant;
use gpsindy_suite::simulate::{Commands, Machine, Setup, Trace};

/// A block on a table: `x' = v, v' = u`.
fn block() -> Plant {
    Plant::new("block", |_, x, u, _, d| {
        d[0] = x[1];
        d[1] = u[0];
    })
    .position("x", "m", "v", 0.0)
    .velocity("v", "m/s", "u", 0.0, Some(0))
    .control("u", "m/s^2", 1.0)
}

fn run(act: Act, start: [f64; 2], interval: f64, controls: &[f64]) -> Trace {
    let plant = block();
    let effects = [Effect { id: "test", state: 1, variables: vec![], act }];
    let setup = Setup {
        times: (0..controls.len()).map(|k| interval * k as f64).collect(),
        start: start.to_vec(),
        commands: Commands::Open(controls.iter().map(|&u| vec![u]).collect()),
        linear: false,
    };
    Machine::new(&plant, &effects, &[1.0, 1.0], 1e-9).run(&setup).unwrap()
}

fn close(found: f64, expected: f64) {
    // Integration tolerance 1e-9 over a few seconds.
    assert!((found - expected).abs() < 1e-7, "found {found}, expected {expected}");
}

#[test]
fn a_sliding_block_decelerates_evenly_and_then_sticks() {
    // v0 = 1, friction 0.5: it stops after 2 s, 1 m further, and stays there under a push of 0.4.
    let friction = Act::Friction { law: Friction::Coulomb { c: 0.5 } };
    let trace = run(friction, [0.0, 1.0], 0.3, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.4, 0.4, 0.4]);
    close(trace.states[5][1], 1.0 - 0.5 * 1.5);
    close(trace.states[7][0], 1.0);
    assert_eq!(trace.states[8][1], 0.0);
    close(trace.states[10][0], 1.0);
    assert_eq!(trace.states[10][1], 0.0);
}

#[test]
fn a_stuck_block_breaks_loose_at_the_static_level() {
    // Static 0.8, kinetic 0.5 (w so small that motion is kinetic at once): a push of 0.7 holds, one of 1.0 moves with 0.5.
    let friction = Act::Friction { law: Friction::Stribeck { c: 0.5, s: 0.8, w: 1e-9 } };
    let trace = run(friction, [0.0, 0.0], 0.5, &[0.7, 0.7, 1.0, 1.0, 1.0]);
    assert_eq!(trace.states[2], vec![0.0, 0.0]);
    close(trace.states[4][1], 0.5);
    close(trace.states[4][0], 0.25);
}

#[test]
fn friction_of_a_turning_block_acts_against_both_directions() {
    // v0 = 1 under u = -2 with friction 0.5: stops after 0.4 s at 0.2 m, then accelerates backward with 1.5.
    let friction = Act::Friction { law: Friction::Coulomb { c: 0.5 } };
    let trace = run(friction, [0.0, 1.0], 0.7, &[-2.0, -2.0, -2.0]);
    let t = 1.4 - 0.4;
    close(trace.states[2][1], -1.5 * t);
    close(trace.states[2][0], 0.2 - 0.75 * t * t);
}

#[test]
fn a_delayed_integrator_gets_each_step_late_within_a_sample() {
    // u steps from 0 to 1 at t = 1 and arrives 0.13 s later; samples every 0.5 s.
    let act = Act::Actuator { control: 0, law: Actuator::Delay { tau: 0.13 } };
    let trace = run(act, [0.0, 0.0], 0.5, &[0.0, 0.0, 1.0, 1.0, 1.0]);
    close(trace.states[2][1], 0.0);
    close(trace.states[3][1], 0.37);
    close(trace.states[4][1], 0.87);
    // A delay above one sample.
    let act = Act::Actuator { control: 0, law: Actuator::Delay { tau: 0.7 } };
    let trace = run(act, [0.0, 0.0], 0.5, &[0.0, 1.0, 1.0, 1.0, 1.0]);
    close(trace.states[2][1], 0.0);
    close(trace.states[3][1], 0.3);
}

#[test]
fn a_lagged_step_follows_its_exponential() {
    let act = Act::Actuator { control: 0, law: Actuator::Lag { tau: 0.4 } };
    let trace = run(act, [0.0, 0.0], 0.5, &[0.0, 1.0, 1.0, 1.0]);
    // v(t) = t - tau (1 - exp(-t/tau)) after the step.
    let v = |t: f64| t - 0.4 * (1.0 - (-t / 0.4).exp());
    close(trace.states[2][1], v(0.5));
    close(trace.states[3][1], v(1.0));
}

#[test]
fn a_play_moves_only_when_its_gap_is_closed() {
    // Width 1, in the middle at 0: 0.4 stays 0; 2 gives 1.5; back to 1.2 keeps 1.5; 0 gives 0.5.
    let act = Act::Actuator { control: 0, law: Actuator::Play { c: 1.0 } };
    let trace = run(act, [0.0, 0.0], 1.0, &[0.0, 0.4, 2.0, 1.2, 0.0, 0.0]);
    let expected = [0.0, 0.0, 0.0, 1.5, 3.0, 3.5];
    for (state, v) in trace.states.iter().zip(expected) {
        close(state[1], v);
    }
}

#[test]
fn a_rate_limit_makes_a_ramp_with_a_sharp_end() {
    // A step of 1 at rate 2 takes 0.5 s: the velocity after 1 s is 0.25 + 0.5.
    let act = Act::Actuator { control: 0, law: Actuator::RateLimit { c: 2.0 } };
    let trace = run(act, [0.0, 0.0], 1.0, &[0.0, 1.0, 1.0]);
    close(trace.states[2][1], 0.75);
}

#[test]
fn saturation_and_dead_zone_cut_the_command() {
    let law = |law| Act::Actuator { control: 0, law };
    close(run(law(Actuator::Saturation { c: 0.6 }), [0.0, 0.0], 1.0, &[-2.0, 0.0]).states[1][1], -0.6);
    close(run(law(Actuator::DeadZone { c: 0.6 }), [0.0, 0.0], 1.0, &[-2.0, 0.0]).states[1][1], -1.4);
    close(run(law(Actuator::DeadZone { c: 0.6 }), [0.0, 0.0], 1.0, &[0.5, 0.0]).states[1][1], 0.0);
}

#[test]
fn an_event_in_time_is_met_between_samples() {
    let trace = run(Act::Step { c: 2.0, t0: 0.75 }, [0.0, 0.0], 0.5, &[0.0, 0.0, 0.0]);
    close(trace.states[1][1], 0.0);
    close(trace.states[2][1], 0.5);
}

#[test]
fn a_late_sensor_reads_the_state_of_before() {
    let act = Act::Sensor { law: Sensor::Delay { tau: 0.13 } };
    let trace = run(act, [0.0, 0.0], 0.5, &[1.0, 1.0, 1.0, 1.0]);
    close(trace.readings[0][1], 0.0);
    close(trace.readings[1][1], 0.37);
    close(trace.readings[3][1], 1.37);
    close(trace.states[3][1], 1.5);
}

#[test]
fn a_hidden_mass_shares_the_motion_of_the_whole() {
    // Without a push the sum of momenta stays: v + c v_hidden.
    let c = 0.3;
    let act = Act::Resonance { position: 0, velocity: 1, c, omega: 5.0, damping: 0.1 };
    let trace = run(act, [0.0, 0.0], 0.5, &[1.0; 9]);
    // Far later the whole moves as one mass 1 + c on average: v within the swing of the small one.
    assert!((trace.states[8][1] - 4.0 / (1.0 + c)).abs() < 0.1);
    let _ = Variable::State(0);
}
