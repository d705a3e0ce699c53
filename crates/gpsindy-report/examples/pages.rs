//! Writes the page and the summary of every fixture into a folder, to be looked at in a browser.
//!
//! `cargo run --release -p gpsindy-report --example pages -- FOLDER`
#![allow(missing_docs, unreachable_pub)]

#[path = "../tests/public/fixtures/mod.rs"]
mod fixtures;

fn main() -> std::io::Result<()> {
    let folder = std::path::PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "pages".into()));
    std::fs::create_dir_all(&folder)?;
    for (name, report) in fixtures::all() {
        std::fs::write(folder.join(format!("{name}.html")), gpsindy_report::render(&report))?;
        std::fs::write(folder.join(format!("{name}.json")), serde_json::to_string_pretty(&report)?)?;
        println!("--- {name}\n{}", gpsindy_report::summary(&report, 90, false));
    }
    Ok(())
}
