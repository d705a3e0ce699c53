//! The text of every nominal model against the physics in code, by an evaluator of the test's own.

#![allow(clippy::unwrap_used, clippy::panic)]

use gpsindy_suite::plant::Plant;
use gpsindy_suite::plants::families;
use gpsindy_suite::random::Draw;
use gpsindy_suite::simulate::{Commands, Machine, Setup};
use std::collections::HashMap;

/// A tiny recursive evaluator of the contract's expressions, as far as the models use them.
struct Reader<'a> {
    text: &'a [u8],
    at: usize,
    names: &'a HashMap<String, f64>,
}

impl Reader<'_> {
    fn peek(&mut self) -> u8 {
        while self.at < self.text.len() && self.text[self.at] == b' ' {
            self.at += 1;
        }
        self.text.get(self.at).copied().unwrap_or(0)
    }

    fn sum(&mut self) -> f64 {
        let mut value = self.product();
        loop {
            match self.peek() {
                b'+' => {
                    self.at += 1;
                    value += self.product();
                }
                b'-' => {
                    self.at += 1;
                    value -= self.product();
                }
                _ => return value,
            }
        }
    }

    fn product(&mut self) -> f64 {
        let mut value = self.signed();
        loop {
            match self.peek() {
                b'*' => {
                    self.at += 1;
                    value *= self.signed();
                }
                b'/' => {
                    self.at += 1;
                    value /= self.signed();
                }
                _ => return value,
            }
        }
    }

    fn signed(&mut self) -> f64 {
        if self.peek() == b'-' {
            self.at += 1;
            return -self.signed();
        }
        let base = self.atom();
        if self.peek() == b'^' {
            self.at += 1;
            return base.powf(self.signed());
        }
        base
    }

    fn atom(&mut self) -> f64 {
        if self.peek() == b'(' {
            self.at += 1;
            let value = self.sum();
            assert_eq!(self.peek(), b')');
            self.at += 1;
            return value;
        }
        let first = self.at;
        while self.at < self.text.len()
            && (self.text[self.at].is_ascii_alphanumeric() || matches!(self.text[self.at], b'_' | b'.'))
        {
            self.at += 1;
        }
        let word = std::str::from_utf8(&self.text[first..self.at]).unwrap();
        if let Ok(number) = word.parse::<f64>() {
            return number;
        }
        if self.peek() != b'(' {
            return *self.names.get(word).unwrap_or_else(|| panic!("unknown name `{word}`"));
        }
        self.at += 1;
        let mut arguments = vec![self.sum()];
        while self.peek() == b',' {
            self.at += 1;
            arguments.push(self.sum());
        }
        assert_eq!(self.peek(), b')');
        self.at += 1;
        match word {
            "sin" => arguments[0].sin(),
            "cos" => arguments[0].cos(),
            "tan" => arguments[0].tan(),
            "sqrt" => arguments[0].sqrt(),
            "abs" => arguments[0].abs(),
            "exp" => arguments[0].exp(),
            "max" => arguments[0].max(arguments[1]),
            other => panic!("unknown function `{other}`"),
        }
    }
}

fn evaluate(text: &str, names: &HashMap<String, f64>) -> f64 {
    let mut reader = Reader { text: text.as_bytes(), at: 0, names };
    let value = reader.sum();
    assert_eq!(reader.peek(), 0, "left over in `{text}`");
    value
}

fn names(plant: &Plant, x: &[f64], u: &[f64]) -> HashMap<String, f64> {
    let mut names = HashMap::new();
    names.extend(plant.parameters.iter().map(|p| (p.name.clone(), p.value)));
    names.extend(plant.states.iter().zip(x).map(|(s, &v)| (s.name.clone(), v)));
    names.extend(plant.controls.iter().zip(u).map(|(c, &v)| (c.name.clone(), v)));
    assert_eq!(names.len(), plant.parameters.len() + x.len() + u.len(), "{}: a name appears twice", plant.name);
    names
}

#[test]
fn the_text_of_every_model_is_the_physics_in_code() {
    assert!(families().len() >= 20);
    for (k, family) in families().into_iter().enumerate() {
        for seed in 0..5 {
            let mut draw = Draw::new(seed, k as u64);
            let plant = family(&mut draw);
            for _ in 0..10 {
                let x: Vec<f64> =
                    plant.states.iter().map(|s| s.start.0 + (s.start.1 + 0.1) * draw.uniform(-0.9, 0.9)).collect();
                let u: Vec<f64> =
                    plant.controls.iter().map(|c| c.centre + c.amplitude * draw.uniform(-1.0, 1.0)).collect();
                let mut d = vec![0.0; x.len()];
                (plant.flow)(&plant.values(), &x, &u, 0.0, &mut d);
                let names = names(&plant, &x, &u);
                for (state, &code) in plant.states.iter().zip(&d) {
                    let text = evaluate(&state.equation, &names);
                    // Two orders of the same arithmetic: rounding, enlarged where large terms cancel.
                    assert!(
                        (text - code).abs() < 1e-9 * (1.0 + code.abs()),
                        "{} {}: {text} {code}",
                        plant.name,
                        state.name
                    );
                }
            }
        }
    }
}

#[test]
fn a_clean_run_follows_the_text_of_its_model() {
    // Runge-Kutta of order 4 with 20 steps a sample on the text, against the adaptive integrator on the code.
    for (k, family) in families().into_iter().enumerate() {
        let mut draw = Draw::new(7, k as u64);
        let plant = family(&mut draw);
        let interval = 1.0 / plant.rate.clamp(2.0, 200.0);
        let start: Vec<f64> = plant.states.iter().map(|s| s.start.0 + 0.3 * s.start.1).collect();
        let controls: Vec<Vec<f64>> = (0..15)
            .map(|i| plant.controls.iter().map(|c| c.centre + 0.3 * c.amplitude * (i as f64).sin()).collect())
            .collect();
        let setup = Setup {
            times: (0..controls.len()).map(|i| interval * i as f64).collect(),
            start: start.clone(),
            commands: Commands::Open(controls.clone()),
            linear: false,
        };
        let scale: Vec<f64> = plant.states.iter().map(|s| s.start.0.abs() + s.start.1 + 1e-3).collect();
        let trace = Machine::new(&plant, &[], &scale, 1e-10).run(&setup).unwrap();
        let mut x = start;
        for (i, u) in controls.iter().enumerate() {
            for (j, value) in x.iter().enumerate() {
                assert!(
                    (trace.states[i][j] - value).abs() < 1e-6 * scale[j].max(value.abs()),
                    "{} {i} {j}",
                    plant.name
                );
            }
            let slope = |x: &[f64]| -> Vec<f64> {
                let names = names(&plant, x, u);
                plant.states.iter().map(|s| evaluate(&s.equation, &names)).collect()
            };
            let add = |x: &[f64], d: &[f64], h: f64| -> Vec<f64> { x.iter().zip(d).map(|(a, b)| a + h * b).collect() };
            let h = interval / 20.0;
            for _ in 0..20 {
                let k1 = slope(&x);
                let k2 = slope(&add(&x, &k1, 0.5 * h));
                let k3 = slope(&add(&x, &k2, 0.5 * h));
                let k4 = slope(&add(&x, &k3, h));
                x = (0..x.len()).map(|j| x[j] + h / 6.0 * (k1[j] + 2.0 * (k2[j] + k3[j]) + k4[j])).collect();
            }
        }
    }
}
