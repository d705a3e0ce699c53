//! `gpsindy export` as a user runs it. That the sources agree with our integrator is tested in the core.

use crate::common::{Folder, data};

#[test]
fn every_language_shows_the_equations() {
    let folder = Folder::new();
    for (language, expected) in [
        ("latex", "\\dot"),
        ("sympy", "sp.Symbol"),
        ("python", "def "),
        ("c", "#include"),
        ("rust", "fn "),
        ("julia", "function"),
        ("modelica", "der("),
    ] {
        let ran = folder.run(&format!("export {} --to {language}", data("pendulum.toml"))).done();
        assert!(ran.stdout.contains(expected) && ran.stdout.contains("omega"), "{language}:\n{}", ran.stdout);
        assert_eq!(ran.stderr, "");
    }
}

#[test]
fn a_file_holds_the_same_source() {
    let folder = Folder::new();
    let text = folder.run(&format!("export {} --to c", data("pendulum.toml"))).done().stdout;
    folder.run(&format!("export {} --to c --out pendulum.c", data("pendulum.toml"))).done();
    assert_eq!(folder.read("pendulum.c"), text);
}

#[test]
fn latex_has_six_digits_or_all() {
    let folder = Folder::new();
    folder.write("m.toml", "[[state]]\nname = \"x\"\nequation = \"0.123456789*x\"\n");
    assert!(folder.run("export m.toml --to latex").done().stdout.contains("0.123457 "));
    assert!(folder.run("export m.toml --to latex --full-digits").done().stdout.contains("0.123456789 "));
}

#[test]
fn every_mistake_is_one_line_and_nothing_is_written() {
    let folder = Folder::new();
    folder.write("m.toml", "[[state]]\nname = \"x\"\nequation = \"foo(x)\"\n");
    folder.write("hidden.toml", "name = \"a\\nb\"\n[[state]]\nname = \"x\"\nequation = \"-x\"\n");
    for (arguments, expected) in [
        ("export m.toml --to fortran", "invalid value 'fortran' for '--to <LANGUAGE>'"),
        ("export hidden.toml --to c", "hidden.toml:1: name or unit: character 2 is U+000A, which does not show"),
        ("export m.toml --to c", "m.toml:3: `foo(x)`, at character 1"),
        ("export m.toml", "the following required arguments were not provided: --to <LANGUAGE>"),
    ] {
        let ran = folder.run(arguments);
        assert!(ran.refused().starts_with(expected), "{arguments}\n{ran:?}\nexpected {expected}");
    }
    assert_eq!(folder.names(), ["hidden.toml", "m.toml"]);
}

#[test]
fn a_sum_of_20000_terms_is_one_line_and_no_overflow() {
    let folder = Folder::new();
    let model = |terms: usize| {
        let sum = vec!["v"; terms].join(" + ");
        format!(
            "schema = \"gpsindy.model/1\"\nname = \"m\"\n[[state]]\nname = \"v\"\nequation = \"{sum}\"\n[initial]\nv = 1.0\n"
        )
    };
    folder.write("long.toml", &model(20_000)).write("longest.toml", &model(1000));
    for arguments in ["export long.toml --to sympy", "simulate long.toml --duration 0.1"] {
        let ran = folder.run(arguments);
        let stated = ran.refused();
        assert!(stated.contains("more than 1000 operations on each other") && stated.len() < 600, "{stated}");
    }
    for language in ["latex", "sympy", "python", "c", "rust", "julia", "modelica"] {
        folder.run(&format!("export longest.toml --to {language}")).done();
    }
    folder.run("simulate longest.toml --duration 0.001").done();
}
