use super::super::InputKind;
use super::super::{Control, Model, Parameter, State};
use super::*;

#[test]
fn a_compiled_model_gives_the_rates_of_its_equations() {
    let mut angle = State::new("phi", Expression::parse("om").unwrap());
    angle.measured = Some(Expression::parse("delay(phi, 0.1) + c").unwrap());
    let model = Model {
        states: vec![angle, State::new("om", Expression::parse("-g*sin(phi) + delay(play(u, 0.1), tau)").unwrap())],
        controls: vec![Control::new("u")],
        parameters: vec![Parameter::new("g", 9.81), Parameter::new("c", 0.2), Parameter::new("tau", 0.05)],
        ..Model::default()
    };
    let system = model.compile().unwrap();
    assert_eq!(system.inputs().len(), 2);
    assert_eq!(system.inputs()[0].kind, InputKind::Play);
    let mut dx = [0.0; 2];
    system.derivative(0.0, &[0.3, -0.4], &[2.0], &mut dx).unwrap();
    assert_eq!(dx[0], -0.4);
    assert!((dx[1] - (2.0 - 9.81 * 0.3_f64.sin())).abs() < 1e-15);
    assert!(system.derivative(0.0, &[0.3], &[2.0], &mut dx).is_err());
}
