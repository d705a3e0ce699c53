use super::*;

#[test]
fn lanes_agree_with_single_evaluations() {
    let expression = Expression::parse("-k*x^3 + clamp(u, -1, 1)*sin(x) - dead_zone(x, 0.3) + 2^x + t").unwrap();
    let names: Vec<String> = ["k", "x", "u"].map(String::from).into();
    let tape = Tape::new(&[expression], &names).unwrap();
    let mut registers = tape.registers::<4>();
    for lane in 0..4 {
        let shift = lane as f64;
        registers[0][lane] = 1.0 + shift;
        registers[1][lane] = -1.0 + 0.7 * shift;
        registers[2][lane] = -2.0 + 1.5 * shift;
        registers[3][lane] = 0.25;
    }
    let inputs = registers.clone();
    tape.evaluate(&mut registers);
    for lane in 0..4 {
        let alone = tape.evaluate_once(&[inputs[0][lane], inputs[1][lane], inputs[2][lane]], 0.25)[0];
        assert_eq!(tape.output(&registers, 0)[lane], alone);
    }
}

#[test]
fn known_values() {
    for (source, wanted) in [
        ("dead_zone(0.5, 0.2)", 0.3),
        ("dead_zone(-0.5, 0.2)", -0.3),
        ("dead_zone(0.1, 0.2)", 0.0),
        ("step(0)", 0.0),
        ("step(1e-9)", 1.0),
        ("sign(-3)", -1.0),
        ("sign(0)", 0.0),
        ("clamp(5, -1, 2)", 2.0),
        ("2^3^2", 512.0),
        ("-2^2", -4.0),
        ("min(1, 2) + max(1, 2)", 3.0),
        ("log(exp(2))", 2.0),
        ("7/2/2", 1.75),
        ("1e3", 1000.0),
        ("abs(-pi)", std::f64::consts::PI),
    ] {
        let tape = Tape::new(&[Expression::parse(source).unwrap()], &[]).unwrap();
        let found = tape.evaluate_once(&[], 0.0)[0];
        assert!((found - wanted).abs() < 1e-12, "{source} = {found}, not {wanted}");
    }
}

#[test]
fn equal_parts_are_computed_once() {
    let expressions = [Expression::parse("sin(x*y) + 1").unwrap(), Expression::parse("2*sin(x*y)").unwrap()];
    let tape = Tape::new(&expressions, &["x".into(), "y".into()]).unwrap();
    assert_eq!(tape.instructions.len(), 4);
}

#[test]
fn products_are_in_the_sums_that_alone_read_them_and_no_bit_changes() {
    let names: Vec<String> = ["a", "b", "x", "y"].map(String::from).into();
    let values = [0.1, 0.7, -1.3, 3.1];
    let [a, b, x, y] = values;
    for (sources, steps, wanted) in [
        (vec!["a*x + y"], 1, vec![a * x + y]),
        (vec!["y + a*x"], 1, vec![y + a * x]),
        (vec!["a*x - y"], 1, vec![a * x - y]),
        (vec!["y - a*x"], 1, vec![y - a * x]),
        (vec!["a*x - b*y"], 2, vec![a * x - b * y]),
        (vec!["b*x - a*y - a*x + b"], 4, vec![b * x - a * y - a * x + b]),
        // Read twice, or read by the caller.
        (vec!["a*x + y", "a*x - b"], 3, vec![a * x + y, a * x - b]),
        (vec!["a*x + y", "a*x"], 2, vec![a * x + y, a * x]),
        (vec!["a*x + a*x"], 2, vec![a * x + a * x]),
        (vec!["a*x*y + x"], 2, vec![a * x * y + x]),
    ] {
        let expressions: Vec<Expression> = sources.iter().map(|source| Expression::parse(source).unwrap()).collect();
        let tape = Tape::new(&expressions, &names).unwrap();
        assert_eq!(tape.instructions.len(), steps, "{sources:?}");
        assert_eq!(tape.evaluate_once(&values, 0.0), wanted, "{sources:?}");
    }
}

#[test]
fn an_unknown_name_is_told_with_the_known_ones() {
    let error = Tape::new(&[Expression::parse("a*x").unwrap()], &["x".into()]).unwrap_err();
    assert_eq!(error.to_string(), "name `a` is unknown; known: x");
}
