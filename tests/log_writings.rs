//! One drive log, however a tool writes it: the same columns, or a refusal that says what and where.

use rfl_mpc::log::{CleanLog, DriveLog, LogError};
use std::path::Path;

const NAMES: [&str; 4] = ["time", "steer_cmd", "vx", "yaw_rate"];

/// Rows of a drive; times are whole hundredths, a quarter of a minute after midnight.
fn rows() -> Vec<[f64; 4]> {
    let row = |k: i32| {
        let k = f64::from(k);
        [15.0 + 0.25 * k, 0.01 * (0.3 * k).sin(), 12.0 + 0.125 * k, -0.1 * (0.2 * k).cos()]
    };
    (0..40).map(row).collect()
}

/// The log with its numbers, names and fields as they are written.
fn written(names: &[&str], delimiter: &str, end: &str, field: impl Fn(usize, f64) -> String) -> String {
    let line = |fields: Vec<String>| fields.join(delimiter) + end;
    let names = line(names.iter().map(|&name| name.to_owned()).collect());
    let rows =
        rows().into_iter().map(|row| line(row.iter().enumerate().map(|(i, &v)| field(i, v)).collect()));
    names + &rows.collect::<String>()
}

fn read(bytes: &[u8]) -> Result<DriveLog, LogError> {
    DriveLog::from_reader(bytes, Path::new("a.csv"))
}

fn plain(_: usize, value: f64) -> String {
    format!("{value:.6}")
}

fn comma(column: usize, value: f64) -> String {
    plain(column, value).replace('.', ",")
}

/// A stamp of a column `time`, other columns by `other`.
fn stamped(
    stamp: impl Fn(i64, f64) -> String,
    other: impl Fn(usize, f64) -> String,
) -> impl Fn(usize, f64) -> String {
    move |column, value| match column {
        0 => stamp(value.floor() as i64, value.fract()),
        _ => other(column, value),
    }
}

/// A log's columns, `time` from its first row on.
fn columns(log: &DriveLog) -> Vec<(&str, Vec<f64>)> {
    let from_first = |name: &str, values: &[f64]| -> Vec<f64> {
        let zero = if name == "time" { values[0] } else { 0.0 };
        values.iter().map(|value| value - zero).collect()
    };
    log.columns().map(|(name, values)| (name, from_first(name, values))).collect()
}

fn assert_same(case: &str, bytes: &[u8]) -> DriveLog {
    let log = read(bytes).unwrap_or_else(|error| panic!("{case}: {error}"));
    let right = read(written(&NAMES, ",", "\n", plain).as_bytes()).unwrap();
    for ((name, values), (expected, others)) in columns(&log).into_iter().zip(columns(&right)) {
        assert_eq!((name, values.len()), (expected, others.len()), "{case}");
        let off = values.iter().zip(&others).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 2e-6, "{case}: {name} is {off} off");
    }
    log
}

#[test]
fn delimiters_ends_of_lines_and_decimal_marks_change_nothing() {
    for delimiter in [",", ";", "\t", "|", " ", "   ", " ; ", " | "] {
        for end in ["\n", "\r\n", "\r"] {
            assert_same(&format!("{delimiter:?} {end:?}"), written(&NAMES, delimiter, end, plain).as_bytes());
            if !delimiter.contains(',') {
                let text = written(&NAMES, delimiter, end, comma);
                assert_same(&format!("{delimiter:?} {end:?}, decimal commas"), text.as_bytes());
            }
        }
    }
    let quoted = |column, value| format!("\"{}\"", plain(column, value));
    assert_same("quoted", written(&NAMES, ",", "\n", quoted).as_bytes());
    let quoted = |column, value| format!("\"{}\"", comma(column, value));
    assert_same("quoted, decimal commas", written(&NAMES, ",", "\n", quoted).as_bytes());
    let aligned = |column, value| format!("{:>14}", plain(column, value));
    assert_same("aligned", written(&NAMES, " ", "\n", aligned).as_bytes());
}

#[test]
fn encodings_change_nothing() {
    let names = ["time", "steer_cmd", "vx [m/s]", "yaw_rate [°/s]"];
    let degrees =
        |column, value: f64| if column == 3 { value.to_degrees().to_string() } else { plain(0, value) };
    let text = written(&names, ";", "\r\n", degrees);
    let wide = |big: bool| -> Vec<u8> {
        let pair = |unit: u16| if big { unit.to_be_bytes() } else { unit.to_le_bytes() };
        text.encode_utf16().flat_map(pair).collect()
    };
    let widest = |big: bool| -> Vec<u8> {
        let unit = |unit: u32| if big { unit.to_be_bytes() } else { unit.to_le_bytes() };
        text.chars().flat_map(|letter| unit(letter.into())).collect()
    };
    let narrow: Vec<u8> = text.chars().map(|letter| u8::try_from(u32::from(letter)).unwrap()).collect();
    for (case, bytes) in [
        ("UTF-8", text.clone().into_bytes()),
        ("UTF-8 with a mark", [b"\xef\xbb\xbf", text.as_bytes()].concat()),
        ("UTF-16, low byte first", wide(false)),
        ("UTF-16, high byte first, with a mark", [vec![0xfe, 0xff], wide(true)].concat()),
        ("UTF-32, low byte first", widest(false)),
        ("UTF-32, low byte first, with a mark", [vec![0xff, 0xfe, 0, 0], widest(false)].concat()),
        ("UTF-32, high byte first, with a mark", [vec![0, 0, 0xfe, 0xff], widest(true)].concat()),
        ("Latin-1", narrow),
    ] {
        let log = assert_same(case, &bytes);
        let said = log.notes.iter().any(|note| note.contains("yaw_rate: read from °/s"));
        assert!(said, "{case}: {:?}", log.notes);
    }
}

#[test]
fn dates_and_times_of_day_are_seconds() {
    let fraction = |part: f64| format!("{:.2}", part)[1..].to_owned();
    let hour =
        move |whole: i64, part: f64| format!("00:{:02}:{:02}{}", whole / 60, whole % 60, fraction(part));
    let iso = move |whole, part| format!("2024-05-01T{}", hour(whole, part));
    let zoned = move |whole, part| format!("2024-05-01 {}+02:00", hour(whole, part));
    let points = move |whole, part| format!("01.05.2024 {}", hour(whole, part));
    assert_same("ISO 8601", written(&NAMES, ",", "\n", stamped(iso, plain)).as_bytes());
    assert_same("with a zone", written(&NAMES, "\t", "\n", stamped(zoned, plain)).as_bytes());
    assert_same("a day with points", written(&NAMES, ",", "\n", stamped(points, plain)).as_bytes());
    let commas = move |whole, part| format!("01.05.2024 {}", hour(whole, part).replace('.', ","));
    assert_same("and decimal commas", written(&NAMES, ";", "\n", stamped(commas, comma)).as_bytes());
    let slashes = move |whole, part| format!("2024/05/01 {} UTC", hour(whole, part));
    assert_same(
        "slashes and a zone in words",
        written(&NAMES, ",", "\n", stamped(slashes, plain)).as_bytes(),
    );
    let basic = move |whole, part| format!("20240501T{}+0200", hour(whole, part).replace(':', ""));
    assert_same("ISO 8601, basic format", written(&NAMES, ",", "\n", stamped(basic, plain)).as_bytes());
    let midnight = move |whole: i64, part| {
        let seconds = (whole + 86_340) % 86_400;
        format!("{:02}:{:02}:{:02}{}", seconds / 3600, seconds / 60 % 60, seconds % 60, fraction(part))
    };
    assert_same(
        "times of day about midnight",
        written(&NAMES, ",", "\n", stamped(midnight, plain)).as_bytes(),
    );
    assert_same("times of day", written(&NAMES, ",", "\n", stamped(hour, plain)).as_bytes());
    // May or January: nobody knows.
    let american = move |whole, part| format!("05/01/2024 {}", hour(whole, part));
    let error =
        read(written(&NAMES, ",", "\n", stamped(american, plain)).as_bytes()).unwrap_err().to_string();
    assert!(error.contains("line 2, column time: '05/01/2024 00:00:15.00' is not a number"), "{error}");
}

#[test]
fn words_for_a_missing_value_are_gaps_and_other_words_are_not() {
    let words = ["n/a", "NULL", "--", "#N/A", "-1.#IND", "NaN", "", "none"];
    let text = |word: &str| {
        written(&NAMES, ",", "\n", |i, v| if i == 3 && v < 0.0 { word.into() } else { plain(i, v) })
    };
    for word in words {
        let log = read(text(word).as_bytes()).unwrap_or_else(|error| panic!("{word}: {error}"));
        let gaps = log.column("yaw_rate").unwrap().iter().filter(|value| value.is_nan()).count();
        assert_eq!(gaps, rows().iter().filter(|row| row[3] < 0.0).count(), "{word}");
    }
    for word in ["broken", "1_000", "1.2.3", "#####"] {
        let error = read(text(word).as_bytes()).unwrap_err().to_string();
        assert!(error.contains("line 2, column yaw_rate") && error.contains(word), "{error}");
    }
    let amid = written(&NAMES, ",", "\n", plain) + "Average,0.0,12.0,0.0\n25,0,1,0\n";
    assert!(read(amid.as_bytes()).unwrap_err().to_string().contains("line 42, column time: 'Average'"));
}

#[test]
fn a_column_in_an_unknown_unit_or_under_another_name_is_not_lost_silently() {
    let all = written(&["time", "steer_cmd", "vx", "yaw_rate"], ",", "\n", plain);
    let odd = all.replacen("yaw_rate", "yaw_rate,vy [furlong/s]", 1).replacen('\n', ",1\n", usize::MAX);
    let odd = odd.replacen("vy [furlong/s],1", "vy [furlong/s]", 1);
    let log = read(odd.as_bytes()).unwrap();
    assert!(log.column("vy").is_none());
    assert!(
        log.warnings.iter().any(|note| note.contains("vy [furlong/s]") && note.contains("unknown")),
        "{:?}",
        log.warnings
    );
    // Without the command a log is another one.
    let odd = written(&["time", "steer_cmd [furlong]", "vx", "yaw_rate"], ",", "\n", plain);
    let error = read(odd.as_bytes()).unwrap_err().to_string();
    assert!(error.contains("the unit 'furlong' is unknown"), "{error}");
    for (names, column, like) in [
        (["timestamp", "steer_cmd", "vx", "yaw_rate"], "time", "timestamp"),
        (["time", "steer_cmd", "vx_kmh", "yaw_rate"], "vx", "vx_kmh"),
        (["time", "SteeringWheelAngle", "vx", "yaw_rate"], "steer_cmd", "SteeringWheelAngle"),
        (["time", "steer_cmd", "vx", "gyro_z"], "yaw_rate", "gyro_z"),
    ] {
        let log = read(written(&names, ",", "\n", plain).as_bytes()).unwrap();
        let error = CleanLog::of(&log, &|_| 2.7).unwrap_err().to_string();
        assert!(
            error.contains(&format!("column '{column}' is missing"))
                && error.contains(&format!("is it {like}?")),
            "{error}"
        );
    }
}

#[test]
fn words_of_other_tools_for_no_value_are_missing_values() {
    for word in ["-nan(ind)", "1.#INF", "SNA", "<NA>", "#DIV/0!"] {
        let log = read(format!("time,vx\n0,{word}\n0.02,3\n").as_bytes()).unwrap();
        assert!(log.column("vx").unwrap()[0].is_nan(), "{word}");
    }
}

#[test]
fn a_cut_off_last_line_and_a_summary_are_left_out_and_said() {
    let whole = written(&NAMES, ",", "\n", plain);
    let last = whole.trim_end().rfind('\n').unwrap() + 1;
    let all_but_one: Vec<usize> =
        columns(&read(whole.as_bytes()).unwrap()).iter().map(|(_, v)| v.len() - 1).collect();
    for cut in [last + 3, last + 14, whole.len() - 12] {
        let log = read(&whole.as_bytes()[..cut]).unwrap();
        assert_eq!(columns(&log).iter().map(|(_, values)| values.len()).collect::<Vec<_>>(), all_but_one);
        assert!(
            log.notes.iter().any(|note| note.contains("1 line(s) at the end") && note.contains("line 41"))
        );
    }
    for (end, lines) in
        [("END\n", 1), ("\nRows: 40\n", 1), ("mean,1,2,3\nmax,1,2,3\nmin,1,2,3\n", 3), ("Total,,,", 1)]
    {
        let log = assert_same(end, format!("{whole}{end}").as_bytes());
        assert!(
            log.notes.iter().any(|note| note.contains(&format!("{lines} line(s) at the end"))),
            "{:?}",
            log.notes
        );
    }
    // More than a few, or rows behind them: no end of a log.
    for end in ["a\nb\nc\nd\n", "END\n16,0,1,0\n", "1,2\n16,0,1,0\n17,0,1,0\n"] {
        let error = read(format!("{whole}{end}").as_bytes()).unwrap_err();
        assert!(
            matches!(error, LogError::RowLength { line: 42, .. } | LogError::NotANumber { line: 42, .. }),
            "{error}"
        );
    }
}

#[test]
fn numbers_and_times_as_spreadsheets_and_loggers_show_them_are_read() {
    let apart = |mark: &'static str, decimal: &'static str| {
        move |column: usize, value: f64| {
            let text = plain(column, value);
            let (whole, part) = text.split_once('.').unwrap();
            if column == 2 {
                format!("\"0{mark}0{whole:0>2}{decimal}{part}\"")
            } else {
                text.replace('.', decimal)
            }
        }
    };
    assert_same("thousands by commas", written(&NAMES, ",", "\n", apart(",", ".")).as_bytes());
    assert_same("thousands by points", written(&NAMES, ";", "\n", apart(".", ",")).as_bytes());
    assert_same("thousands by hard blanks", written(&NAMES, ";", "\n", apart("\u{a0}", ",")).as_bytes());
    let minus = |column, value| plain(column, value).replace('-', "\u{2212}");
    assert_same("a minus of typography", written(&NAMES, ",", "\n", minus).as_bytes());
    let laps = |whole: i64, part: f64| format!("{}:{:05.2}", whole / 60, (whole % 60) as f64 + part);
    assert_same("minutes and seconds", written(&NAMES, ",", "\n", stamped(laps, plain)).as_bytes());
    let parts = |whole: i64, part: f64| format!("0:00:{whole:02}:{:03.0}", 1e3 * part);
    assert_same("thousandths", written(&NAMES, ",", "\n", stamped(parts, plain)).as_bytes());
    // Names in a comment, none of them known: the message has them, not the first row.
    let topics = ["%time", "field.header.seq", "field.speed", "field.gyro.z"];
    let error = read(written(&topics, ",", "\n", plain).as_bytes()).unwrap_err().to_string();
    assert!(error.contains("field.speed") && !error.contains("12.0"), "{error}");
}
