//! A log with given derivatives to a model, as a Rust program does it:
//!
//! ```text
//! cargo run --release -p gpsindy-files --example identify -- data/lotka_volterra.csv x1,x2 '' 2
//! cargo run --release -p gpsindy-files --example identify -- data/unicycle.csv x1,x2,x3,x4 u1,u2 1
//! ```
//!
//! LOG, states, controls, degree; the column `dx` carries the derivative of the state `x`. The model goes to stdout.
#![allow(clippy::print_stdout)]

use gpsindy_core::library::LibrarySettings;
use gpsindy_core::{Hold, Identify, Silent};
use gpsindy_files::{LogOptions, Logs, model_to_toml};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [log, states, controls, degree] = arguments.as_slice() else {
        return Err("expected LOG STATES CONTROLS DEGREE".into());
    };
    let names = |list: &str| list.split(',').filter(|name| !name.is_empty()).map(String::from).collect::<Vec<_>>();
    let (states, controls) = (names(states), names(controls));
    let derivatives: Vec<(String, String)> = states.iter().map(|state| (state.clone(), format!("d{state}"))).collect();
    let columns: Vec<String> =
        states.iter().chain(&controls).cloned().chain(derivatives.iter().map(|(_, column)| column.clone())).collect();

    let data = Logs::read(&[log], &LogOptions::default())?.dataset(&columns, &[])?;
    let identify = Identify {
        // The controls of these logs are not held between samples.
        hold: (!controls.is_empty()).then_some(Hold::Linear),
        library: LibrarySettings { degree: degree.parse()?, trig: true, products: true, ..LibrarySettings::default() },
        states,
        controls,
        derivatives,
        ..Identify::default()
    };
    let found = identify.fit(&data, &Silent)?;
    println!("{}", model_to_toml(&found.model)?);
    Ok(())
}
