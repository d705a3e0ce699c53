"""Whatever holds samples becomes the same runs."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import gpsindy

T = np.array([0.0, 0.1, 0.2])
COLUMNS = {"t": T, "x": np.array([1.0, np.nan, 3.0]), "u": np.array([0.0, 1.0, 0.0])}


def frames():
    import pandas
    import polars
    import pyarrow

    class OnlyStream:
        def __init__(self, table):
            self.table = table

        def __arrow_c_stream__(self, requested_schema=None):
            return self.table.__arrow_c_stream__(requested_schema)

    table = pyarrow.table({name: list(values) for name, values in COLUMNS.items()})
    with_nulls = {**COLUMNS, "x": [1.0, None, 3.0]}
    return {
        "mapping": COLUMNS,
        "pandas": pandas.DataFrame(COLUMNS),
        "pandas nullable": pandas.DataFrame({n: pandas.array(v) for n, v in with_nulls.items()}),
        "pandas index": pandas.DataFrame({n: v for n, v in COLUMNS.items() if n != "t"}, index=pandas.Index(T, name="t")),
        "polars": polars.DataFrame(with_nulls),
        "polars lazy": polars.LazyFrame(with_nulls),
        "pyarrow": pyarrow.table({n: pyarrow.array(v) for n, v in with_nulls.items()}),
        "arrow stream": OnlyStream(table),
        "records": np.rec.fromarrays(list(COLUMNS.values()), names=list(COLUMNS)),
    }


@pytest.mark.parametrize("kind", ["mapping", "pandas", "pandas nullable", "pandas index", "polars", "polars lazy", "pyarrow", "arrow stream", "records"])
def test_every_frame_gives_the_same_run_with_its_names(kind):
    data = gpsindy.Dataset(frames()[kind])
    assert data.columns == ("x", "u")
    np.testing.assert_array_equal(data[0].t, T)
    np.testing.assert_array_equal(data[0].values, np.column_stack([COLUMNS["x"], COLUMNS["u"]]))


def clocks():
    import datetime

    import pandas
    import polars
    import pyarrow

    start = datetime.datetime(2024, 3, 31, 0, 59, 59, 900_000)
    steps = [datetime.timedelta(milliseconds=100 * i) for i in range(3)]
    dates = [start + step for step in steps]
    x = [1.0, 2.0, 3.0]
    return {
        "pandas datetime": pandas.DataFrame({"t": pandas.to_datetime(dates), "x": x}),
        # Clocks go forward an hour within these samples; the time that passes does not.
        "pandas with a zone": pandas.DataFrame({"t": pandas.to_datetime(dates).tz_localize("UTC").tz_convert("Europe/Berlin"), "x": x}),
        "pandas timedelta": pandas.DataFrame({"t": pandas.to_timedelta(steps), "x": x}),
        "pandas index of dates": pandas.DataFrame({"x": x}, index=pandas.to_datetime(dates)),
        "polars datetime": polars.DataFrame({"t": dates, "x": x}),
        "polars milliseconds": polars.DataFrame({"t": dates, "x": x}).with_columns(polars.col("t").dt.cast_time_unit("ms")),
        "polars duration": polars.DataFrame({"t": steps, "x": x}),
        "pyarrow timestamp": pyarrow.table({"t": pyarrow.array(dates), "x": x}),
        "numpy": {"t": np.array(dates, dtype="datetime64[us]"), "x": x},
        "python": {"t": dates, "x": x},
    }


@pytest.mark.parametrize(
    "kind",
    [
        "pandas datetime",
        "pandas with a zone",
        "pandas timedelta",
        "pandas index of dates",
        "polars datetime",
        "polars milliseconds",
        "polars duration",
        "pyarrow timestamp",
        "numpy",
        "python",
    ],
)
def test_dates_and_durations_become_seconds(kind):
    data = gpsindy.Dataset(clocks()[kind])
    assert data.columns == ("x",)
    np.testing.assert_allclose(data[0].t, T, rtol=0, atol=1e-12)


def test_times_handed_in_beside_the_samples_may_be_dates_and_the_step_a_duration():
    dates = np.datetime64("2024-03-31T01:00:00.000000000") + np.array([0, 100, 200]) * np.timedelta64(1, "ms")
    np.testing.assert_allclose(gpsindy.Dataset(np.ones((3, 1)), dates)[0].t, T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(gpsindy.Dataset(np.ones((3, 1)), np.timedelta64(100, "ms"))[0].t, T, rtol=0, atol=1e-12)


def test_a_column_of_dates_beside_the_time_is_no_state():
    dates = np.array(["2024-03-31", "2024-04-01", "2024-04-02"], dtype="datetime64[D]")
    assert gpsindy.Dataset({"t": T, "x": T, "day": dates}).columns == ("x",)
    with pytest.raises(ValueError, match="dates or durations, not numbers"):
        gpsindy.Dataset(dates, 0.1)


def test_one_run_and_a_list_of_one_run_are_the_same():
    assert len(gpsindy.Dataset(COLUMNS)) == len(gpsindy.Dataset([COLUMNS])) == 1
    assert len(gpsindy.Dataset([COLUMNS, COLUMNS])) == 2


def test_arrays_take_names_and_a_step():
    data = gpsindy.Dataset([np.ones((3, 2)), np.ones((4, 2))], 0.5, columns=["a", "b"], units={"b": "m"})
    assert data.columns == ("a", "b")
    assert data.units == ("", "m")
    np.testing.assert_array_equal(data[1].t, [0.0, 0.5, 1.0, 1.5])


def test_headers_may_carry_a_unit_as_in_files():
    data = gpsindy.Dataset({"t [s]": T, "v [m/s]": T, "note": ["a", "b", "c"]})
    assert (data.columns, data.units) == (("v",), ("m/s",))


def test_arrays_are_read_only_and_pickle_keeps_everything():
    data = gpsindy.Dataset({"t": T, "v [m/s]": T})
    with pytest.raises(ValueError, match="read-only"):
        data[0].values[0, 0] = 1.0
    copy = pickle.loads(pickle.dumps(data))
    assert (copy.columns, copy.units, copy.names) == (data.columns, data.units, data.names)
    np.testing.assert_array_equal(copy[0].values, data[0].values)


def test_runs_and_columns_can_be_chosen():
    data = gpsindy.Dataset([COLUMNS, COLUMNS, COLUMNS], names=["a", "b", "c"])
    assert data[1:].names == ("b", "c")
    assert data[[2, 0]].names == ("c", "a")
    assert data.select("u").columns == ("u",)
    np.testing.assert_array_equal(data[-1]["u"], COLUMNS["u"])


def test_csv_files_are_runs(tmp_path):
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("t,phi (rad),note\n0,3.1,x\n0.1,-3.1,y\n")
    data = gpsindy.read_csv([tmp_path / "a.csv", tmp_path / "b.csv"], rename={"phi": "angle"}, angles="angle")
    assert (data.names, data.columns, data.units) == (("a.csv", "b.csv"), ("angle",), ("rad",))
    assert data[0]["angle"][1] == pytest.approx(2 * np.pi - 3.1)


def test_times_in_milliseconds_are_warned_of(tmp_path):
    (tmp_path / "a.csv").write_text("t [ms],x\n0,1\n1,2\n")
    with pytest.warns(gpsindy.DataWarning, match="seconds"):
        gpsindy.read_csv(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        (([],), {}, "runs: no run"),
        ((np.ones((3, 2)),), {}, "t: hand in the sample times"),
        ((np.ones((3, 2)), [0.0, 0.1]), {}, r"t: expected 3 times, one a sample, found shape \(2,\)"),
        ((np.ones((3, 2)), 0.0), {}, "t: the step must be above 0 s"),
        ((np.ones((3, 2, 2)), 0.1), {}, r"runs: expected shape \(samples, columns\)"),
        ((np.ones((3, 2)), 0.1), {"columns": ["a"]}, "expected 1 columns"),
        ((np.ones((3, 2)), 0.1), {"columns": ["a", "a"]}, "`a` appears twice"),
        ((COLUMNS,), {"columns": ["y"]}, "no column 'y'; found x, u"),
        ((COLUMNS,), {"time": "clock"}, "no time column 'clock'"),
        (({"t": T},), {}, "no column of numbers"),
        (({"t": T, "x": T, "y": T[:2]},), {}, r"column 'y' has shape \(2,\), column 'x' has \(3,\)"),
        (({"t": T[::-1], "x": T},), {}, "time must increase"),
        (({"t": T, "x": [1.0, np.inf, 0.0]},), {}, "not a finite number"),
        ((COLUMNS,), {"units": {"y": "m"}}, "units: no column 'y'"),
        ((COLUMNS,), {"names": ["a", "b"]}, "names: expected 1"),
        ((COLUMNS,), {"angles": "phi"}, "column `phi` is unknown"),
    ],
)
def test_wrong_input_is_one_line_that_names_the_argument(arguments, options, message):
    with pytest.raises(ValueError, match=message) as caught:
        gpsindy.Dataset(*arguments, **options)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_told_by_its_name(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nothing\.csv: cannot be read: there is no such file"):
        gpsindy.read_csv(tmp_path / "nothing.csv")


def test_a_bad_cell_is_told_with_file_line_and_column(tmp_path):
    (tmp_path / "a.csv").write_text("t,x\n0,1\n0,2\n")
    with pytest.raises(ValueError, match=r"a\.csv:3"):
        gpsindy.read_csv(tmp_path / "a.csv")
