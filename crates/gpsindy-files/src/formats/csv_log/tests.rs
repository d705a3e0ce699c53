//! Tests of the log reader: tables of input and what must come of it.

use super::*;

fn parse(text: &str) -> Result<CsvLog> {
    CsvLog::parse("log.csv", text.as_bytes(), &LogOptions::default())
}

fn message(text: &str) -> String {
    match parse(text) {
        Ok(log) => match log.columns().map(|h| log.values(&h.name)).find_map(Result::err) {
            Some(error) => error.to_string(),
            None => panic!("accepted: {text:?}"),
        },
        Err(error) => error.to_string(),
    }
}

#[test]
fn a_model_in_the_place_of_a_log_is_called_one() {
    let error =
        CsvLog::parse("m.toml", b"schema = \"gpsindy.model/1\"\nname = \"a\"\n", &LogOptions::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "m.toml:1: this is a model, not a log; a log has a header row and then one sample per row"
    );
}

#[test]
fn every_kind_of_bad_input_is_one_clear_line() {
    for (text, expected) in [
        ("", "log.csv: the file is empty"),
        ("# only a comment\n\n", "log.csv: the file is empty"),
        ("t,x\n", "log.csv:1: no samples follow the header"),
        ("t,x\n0,1\n", "log.csv:2: 1 sample; a run needs at least 2"),
        ("0,1\n1,2\n", "log.csv:1: no header: the first row holds only numbers"),
        ("a,x\n0,1\n", "log.csv:1: no column `t` or `time`; name the time column with --time; found: a, x"),
        ("t|x\n0|1\n", "log.csv:1: the cells look separated by bars"),
        ("t;x\n0;1,5\n1;2\n", "log.csv:2: column `x`: not a number: \"1,5\"; write the decimals behind a point"),
        ("t,x\n2024-05-01T12:00:00Z,1\n17,2\n", "log.csv:3: column `t`: not a time like that of the first row: \"17\""),
        (
            "# c\nt,x\n0,1\n1,n/a?\n",
            "log.csv:4: column `x`: not a number: \"n/a?\"; leave the cell empty for a missing value",
        ),
        ("t,x\r\n0,1\r\n\r\n1,bad\r\n", "log.csv:4: column `x`: not a number: \"bad\""),
        ("t,x\n0,1\n1,inf\n", "log.csv:3: column `x`: infinite value \"inf\""),
        ("t,x\n0,1\n1,1e999\n", "log.csv:3: column `x`: infinite value \"1e999\""),
        (
            "t,x\n0,1\n1,2\n0.5,3\n",
            "log.csv:4: column `t`: time goes back, from 1 to 0.5; sort the samples, or name the column of the runs with --run",
        ),
        ("t,x\n0,1\n0,2\n", "log.csv:3: column `t`: time does not advance, from 0 to 0"),
        ("t,x\n0,1\n,2\n", "log.csv:3: column `t`: the time is missing"),
        ("t,x\n0,1\nnan,2\n", "log.csv:3: column `t`: the time is missing"),
        ("t,x\n0,1\nlater,2\n", "log.csv:3: column `t`: not a number: \"later\""),
        (
            "t,v [m/s],v [km/h]\n0,1,2\n1,2,3\n",
            "log.csv:1: column `v`: column appears twice, as `v [m/s]` and as `v [km/h]`",
        ),
        ("t,x\n0,1\n1\n", "log.csv:3: 1 cell where the header has 2 cells"),
        ("t,x\n0,1\n1,2,3\n", "log.csv:3: 3 cells where the header has 2 cells"),
        ("t,x\n0,1\n# pause\n1,2\n", "log.csv:3: a comment among the samples"),
        ("t,x\n0,\"1,5\"\n1,2\n", "log.csv:2: column `x`: not a number: \"1,5\"; write the decimals behind a point"),
        ("t,x\n0,1\n\n\n1,2\nx,3\n", "log.csv:6: column `t`: not a number: \"x\""),
        ("t,x\n0,1\n1,\"2\n2,3\n", "log.csv:3: column `x`: not a number: \"2\\n2,3"),
    ] {
        let found = message(text);
        assert!(found.starts_with(expected), "{text:?}\n   found: {found}\nexpected: {expected}");
        assert!(!found.contains('\n'), "{found}");
    }
}

#[test]
fn a_file_that_is_not_utf8_names_its_line() {
    let error = CsvLog::parse("log.csv", b"t,x [\xb0C]\n0,1\n1,2\n", &LogOptions::default()).unwrap_err();
    assert_eq!(error.to_string(), "log.csv:1: byte 0xb0 is not UTF-8; save the file as UTF-8");
    let error = CsvLog::parse("log.csv", b"\xff\xfet\0", &LogOptions::default()).unwrap_err();
    assert!(error.to_string().contains("UTF-16"), "{error}");
}

#[test]
fn every_spelling_of_the_format_reads_the_same() {
    for text in [
        "t,x [m],\"heading angle (rad), from x-axis\"\n0,1,2\n0.5,,3\n",
        "\u{feff}t,x [m],\"heading angle (rad), from x-axis\"\r\n0,1,2\r\n0.5,nan,3\r\n",
        "# made by hand\n\n#second, with a comma\nt, x [m],\"heading angle (rad), from x-axis\"\n0, 1, 2\n0.5, NaN, 3",
        "t,x [m],\"heading angle (rad), from x-axis\"\n\n0.0,1e0,+2.0\n\n5e-1,NA,3.\n\n",
        "x [m],time,\"heading angle (rad), from x-axis\"\n1,0,2\n,0.5,3\n",
        "t;x [m];heading angle (rad), from x-axis\n0;1;2\n0.5;;3\n",
        "t\tx [m]\t\"heading angle (rad), from x-axis\"\n0\t1\t2\n0.5\t\t3\n",
        "__time,x [m],\"heading angle (rad), from x-axis\"\n1396293887.125,1,2\n1396293887.625,,3\n",
        "Time,x [m],\"heading angle (rad), from x-axis\"\n2014-03-31T19:24:47.125Z,1,2\n2014-03-31 19:24:47.625,,3\n",
    ] {
        let log = parse(text).unwrap();
        assert_eq!(log.times, [0.0, 0.5], "{text}");
        let x = log.values("x").unwrap();
        assert!(x[0] == 1.0 && x[1].is_nan(), "{text}");
        assert_eq!(log.values("heading_angle").unwrap(), [2.0, 3.0], "{text}");
        assert_eq!(log.values("heading angle (rad), from x-axis").unwrap(), [2.0, 3.0], "{text}");
        assert_eq!(log.columns().find(|h| h.name == "heading_angle").unwrap().unit, "rad");
    }
}

#[test]
fn columns_that_nobody_asks_for_may_hold_text() {
    let log = parse("t,x,remark\n0,1,start\n1,2,end\n").unwrap();
    assert_eq!(log.values("x").unwrap(), [1.0, 2.0]);
    assert!(Source::is_numeric(&log, 0) && !Source::is_numeric(&log, 1));
}

#[test]
fn options_find_columns_by_name_and_by_header() {
    let text = b"clock (s),trial,v [m/s],v [km/h]\n0,a,1,2\n1,a,1,2\n0,b,3,4\n0.5,b,5,6\n";
    let options = LogOptions {
        time: Some("clock".into()),
        run: Some("trial".into()),
        rename: vec![("v [km/h]".into(), "speed".into())],
        ..LogOptions::default()
    };
    let log = CsvLog::parse("log.csv", text, &options).unwrap();
    let names: Vec<&str> = log.columns().map(|h| h.name.as_str()).collect();
    assert_eq!(names, ["v", "speed"]);
    assert_eq!(log.runs(), [("a".to_string(), vec![0, 1]), ("b".to_string(), vec![2, 3])]);
    assert_eq!(log.values("speed").unwrap(), [2.0, 2.0, 4.0, 6.0]);
}

#[test]
fn options_that_name_no_column_are_refused() {
    let text = b"t,x\n0,1\n1,2\n";
    for (options, expected) in [
        (
            LogOptions { time: Some("clock".into()), ..LogOptions::default() },
            "log.csv: time column `clock` is not in the file; found: t, x",
        ),
        (
            LogOptions { run: Some("trial".into()), ..LogOptions::default() },
            "log.csv: run column `trial` is not in the file; found: t, x",
        ),
        (
            LogOptions { rename: vec![("y".into(), "z".into())], ..LogOptions::default() },
            "log.csv: --rename: column `y` is not in the file; found: t, x",
        ),
        (
            LogOptions { rename: vec![("x".into(), "t".into())], ..LogOptions::default() },
            "log.csv:1: column `t`: column appears twice, as `t` and as `x`",
        ),
    ] {
        let error = CsvLog::parse("log.csv", text, &options).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
    }
}

#[test]
fn a_time_that_goes_back_within_a_run_is_found_among_several() {
    let options = LogOptions { run: Some("run".into()), ..LogOptions::default() };
    let error =
        CsvLog::parse("log.csv", b"run,t,x\n1,0,1\n2,0,1\n1,1,1\n2,1,1\n1,0.5,1\n", &options).unwrap_err().to_string();
    assert!(error.starts_with("log.csv:6: column `t`: time goes back, from 1 to 0.5"), "{error}");
}

#[test]
fn a_map_names_a_column_and_leaves_a_name_that_is_there() {
    let options = LogOptions {
        map: vec![("v".into(), "speed [m/s]".into()), ("u".into(), "/cmd.data[0]".into())],
        ..LogOptions::default()
    };
    let log = CsvLog::parse("log.csv", b"t,speed [m/s],u\n0,1,2\n1,3,4\n", &options).unwrap();
    assert_eq!(log.columns().map(|h| h.name.as_str()).collect::<Vec<_>>(), ["v", "u"]);
    let options = LogOptions { map: vec![("v".into(), "sped".into())], ..LogOptions::default() };
    let error = CsvLog::parse("log.csv", b"t,speed [m/s],u\n0,1,2\n1,3,4\n", &options).unwrap_err().to_string();
    assert_eq!(error, "log.csv: --map v: column `sped` is not in the file; did you mean `speed`?; found: t, speed, u");
}

#[test]
fn parts_of_a_second_since_1970_are_told_by_their_size() {
    let read = |text: &str| {
        let logs = crate::Logs::parse("a.csv", text.as_bytes(), &LogOptions::default()).unwrap();
        let task = crate::Task { needed: vec!["x".into()], ..crate::Task::default() };
        let read = logs.assemble(&task, &gpsindy_core::Silent).unwrap();
        (read.data.runs()[0].time.clone(), read.notes)
    };
    let (times, notes) = read("t,x\n1763000000123456789,1\n1763000000133456789,2\n1763000000143456790,3\n");
    assert_eq!(times, [0.0, 0.01, 0.020000001]);
    assert_eq!(
        notes,
        [
            "a.csv: the stamps of `t` are taken for nanoseconds since 1970, which their size shows, and counted in seconds from the first, 1763000000123456789"
        ]
    );
    let (times, notes) = read("t,x\n0,1\n10000,2\n20000,3\n");
    assert_eq!(times, [0.0, 1e4, 2e4]);
    assert!(
        notes[0].starts_with("a.csv: the stamps of `t` are whole numbers, 10000 from one to the next"),
        "{notes:?}"
    );
    assert_eq!(read("t,x\n0,1\n1,2\n2,3\n"), (vec![0.0, 1.0, 2.0], vec![]));
}
