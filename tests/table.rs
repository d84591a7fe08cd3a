//! Tables however they are written: every kind of file gives the same numbers, and what gives none is refused by name.

use proptest::prelude::*;
use rfl_mpc::log::DriveLog;
use rfl_mpc::path::{Path, PathError, PathOptions, Sample};
use rfl_mpc::table::{Limits, Table, TableError, open};
use std::path::{Path as FilePath, PathBuf};

fn road(bytes: &[u8]) -> Result<Path, PathError> {
    Path::from_csv(bytes, FilePath::new("road.csv"), &PathOptions::default())
}

fn log(bytes: &[u8]) -> DriveLog {
    DriveLog::from_reader(bytes, FilePath::new("log.csv")).unwrap_or_else(|error| panic!("{error}"))
}

fn log_error(bytes: &[u8]) -> String {
    DriveLog::from_reader(bytes, FilePath::new("log.csv")).expect_err("was read").to_string()
}

fn has(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "no `{part}` in: {message}");
    }
}

/// A road of 80 points and 100 m.
fn points() -> Vec<(f64, f64)> {
    (0..80).map(|i| 1.25 * f64::from(i)).map(|x| (x, 10.0 * (x / 40.0).sin())).collect()
}

fn rows(row: impl Fn(f64, f64) -> String) -> String {
    points().into_iter().map(|(x, y)| row(x, y)).collect()
}

/// Reads a road and compares it with the same in our format.
fn same_road(bytes: &[u8]) -> Path {
    let ours = road(format!("x,y\n{}", rows(|x, y| format!("{x:.4},{y:.4}\n"))).as_bytes()).unwrap();
    let read =
        road(bytes).unwrap_or_else(|error| panic!("{error}\n{}", String::from_utf8_lossy(&bytes[..200])));
    assert!((ours.length() - read.length()).abs() < 1e-3, "{} {}", ours.length(), read.length());
    for s in 0..100 {
        let (a, b) = (ours.at(f64::from(s)), read.at(f64::from(s)));
        assert!((a.x - b.x).hypot(a.y - b.y) < 1e-3, "{s}: {a:?} {b:?}");
    }
    read
}

fn comma(text: String) -> String {
    text.replace('.', ",")
}

fn utf16(text: &str, low_first: bool, mark: bool) -> Vec<u8> {
    let mark = mark.then_some(0xfeff);
    let bytes = |unit: u16| if low_first { unit.to_le_bytes() } else { unit.to_be_bytes() };
    mark.into_iter().chain(text.encode_utf16()).flat_map(bytes).collect()
}

#[test]
fn delimiters_and_decimal_commas_are_found() {
    same_road(format!("x;y\n{}", rows(|x, y| format!("{x:.4};{y:.4}\n"))).as_bytes());
    same_road(format!("x;y\r\n{}", comma(rows(|x, y| format!("{x:.4};{y:.4}\r\n")))).as_bytes());
    same_road(format!("y\tx\n{}", comma(rows(|x, y| format!("{y:.4}\t{x:.4}\n")))).as_bytes());
    same_road(
        format!("sep=;\r\n\"X\";\"Y\";\r\n{}", comma(rows(|x, y| format!("\"{x:.4}\";{y:.4};\r\n"))))
            .as_bytes(),
    );
    // A first field that is empty, between tabs.
    let tabs = format!("speed\tx\ty\n{}", rows(|x, y| format!("\t{x:.4}\t{y:.4}\n")));
    assert_eq!(same_road(tabs.as_bytes()).at(1.0).speed, None);
    // Points that may part thousands.
    let mixed = format!("x;y\n{}1.250;0,5\n", comma(rows(|x, y| format!("{x:.4};{y:.4}\n"))));
    has(
        &road(mixed.as_bytes()).unwrap_err().to_string(),
        &["line 82", "column `x`", "1.250", "decimal commas"],
    );
}

#[test]
fn encodings_are_found() {
    let text = format!("x;y\r\n{}", comma(rows(|x, y| format!("{x:.4};{y:.4}\r\n"))));
    for (low_first, mark) in [(true, true), (false, true), (true, false), (false, false)] {
        same_road(&utf16(&text, low_first, mark));
    }
    same_road(format!("\u{feff}{text}").as_bytes());
    // Latin-1, in a comment of a road and in a column of a log that is not used.
    let mut latin = b"# Stra\xdfe\n".to_vec();
    latin.extend(text.as_bytes());
    same_road(&latin);
    let read = log(b"time,vx,Temperatur [\xb0C]\n0,1,20\n0.5,2,20\n");
    assert_eq!(read.column("vx"), Some(&[1.0, 2.0][..]));
}

#[test]
fn racing_lines_and_aliases_are_read() {
    let line = |head: &str, tail: &str| {
        format!("# 12ab\n# 2,5\n# {head}\n{}", rows(|x, y| format!("{x:.4}; {x:.4}; {y:.4}; {tail}\n")))
    };
    let text = line("s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2", "0.1; 0.02; 7.0; 0");
    let read = same_road(text.as_bytes());
    assert!((read.at(10.0).speed.unwrap() - 7.0).abs() < 1e-9);
    assert!(
        read.notes()
            .iter()
            .any(|note| note.text.contains("not used: psi_rad, kappa_radpm, ax_mps2") && !note.warning)
    );
    let commas = line("s_m, x_m, y_m, vx_mps", "7").replace(';', ",");
    same_road(commas.as_bytes());
    same_road(format!("% x_m\ty_m\n{}", rows(|x, y| format!("{x:.4}\t{y:.4}\n"))).as_bytes());
    // A reference line 2 m to the right, its normals and the offset back.
    let head = "# x_ref_m; y_ref_m; x_normvec_m; y_normvec_m; alpha_m\n";
    same_road(format!("{head}{}", rows(|x, y| format!("{x:.4};{:.4};0;1;2\n", y - 2.0))).as_bytes());
    let units =
        format!("North [m],East [m],speed_kmh,bank (deg)\n{}", rows(|x, y| format!("{y:.4},{x:.4},36,1\n")));
    let point = same_road(units.as_bytes()).at(5.0);
    assert!((point.speed.unwrap() - 10.0).abs() < 1e-9 && (point.bank.to_degrees() - 1.0).abs() < 1e-9);
    let rows_of_units = format!("\"Road\",\"A\"\n\nX,Y\nm,m\n\n{}", rows(|x, y| format!("{x:.4},{y:.4}\n")));
    same_road(rows_of_units.as_bytes());
    let error = road(b"x [m],y [s]\n0,0\n1,1\n").unwrap_err().to_string();
    has(&error, &["road.csv, line 1", "`y`", "`s`", "give it in m"]);
}

#[test]
fn logs_with_header_blocks_units_and_dates_are_read() {
    let motec = "\"Format\",\"MoTeC CSV File\",,,\"Workbook\",\"\"\n\"Driver\",\"B\"\n\"Sample Rate\",\"50.000\",\"Hz\"\n\n\n\
                 \"time\",\"vx\",\"yaw_rate\",\"ay\"\n\"s\",\"km/h\",\"deg/s\",\"G\"\n\n\"0.00\",\"36\",\"180\",\"1\"\n\"0.02\",\"72\",\"0\",\"0\"\n";
    let read = log(motec.as_bytes());
    assert_eq!(read.column("time"), Some(&[0.0, 0.02][..]));
    assert!((read.column("vx").unwrap()[1] - 20.0).abs() < 1e-12);
    assert!((read.column("yaw_rate").unwrap()[0] - std::f64::consts::PI).abs() < 1e-12);
    assert!((read.column("ay").unwrap()[0] - 9.806_65).abs() < 1e-12);
    assert_eq!(read.notes.len(), 3, "{:?}", read.notes);
    // Semicolons; units in brackets; a block without a blank line; dates.
    let canape = "Recorder;CANape\nMeasurement;a.mf4\ntime;vx [km/h]\n2024-12-31 23:59:59,5;36,0\n2025-01-01 00:00:00,25;72,0\n";
    let read = log(canape.as_bytes());
    assert_eq!(read.column("time"), Some(&[0.5, 1.25][..]));
    assert!((read.column("vx").unwrap()[1] - 20.0).abs() < 1e-12);
    let zones = log(b"time,vx\n2024-05-01T12:00:00+02:00,1\n2024-05-01T10:00:01.5Z,1\n");
    assert_eq!(zones.column("time"), Some(&[0.0, 1.5][..]));
    // A block with numbers of its own.
    let numbers = log(b"1500,2.7\n1,2\ntime,vx\n0,1\n0.5,2\n");
    assert_eq!(numbers.column("vx"), Some(&[1.0, 2.0][..]));
    // Names that nobody knows: the header is shown, not the block.
    has(
        &log_error(
            &motec.replace("\"time\",\"vx\",\"yaw_rate\",\"ay\"", "Time,Ground Speed,Gyro,G").into_bytes(),
        ),
        &["`Time,Ground Speed,Gyro,G`"],
    );
}

#[test]
fn what_only_looks_like_a_number_is_refused_with_row_and_column() {
    for text in ["2024_04_23_13_37_00_000", "1_000", "12:00:00", "2024-13-01T00:00:00", "0x10"] {
        let bytes = format!("time,vx\n0,1\n\"{text}\",2\n");
        has(&log_error(bytes.as_bytes()), &["log.csv, line 3, column time", text, "not a number"]);
    }
    has(&log_error(b"time,vx\n2024-05-01T12:00:00,1\n3.5,1\n"), &["line 3, column time"]);
    has(&log_error(b"time;vx\n0;1\n0.5;1_0\n"), &["line 3, column vx", "1_0"]);
    let row = "x,y\n0,0\n1_000,0\n2,0\n";
    has(&road(row.as_bytes()).unwrap_err().to_string(), &["road.csv, line 3", "column `x`", "1_000"]);
    has(&log_error(b"time,vx\nfurlong,km/h\n0,1\n"), &["line 1, column time", "'furlong'", "in s"]);
}

#[test]
fn a_row_that_begins_with_a_spreadsheets_error_is_no_comment() {
    for error in ["#N/A", "#NV", "#VALUE!", "#REF!", "#DIV/0!"] {
        for end in [",", ";"] {
            let text = format!("x,y\n0,0\n#comment\n{error},0\n2,0\n").replace(',', end);
            has(&road(text.as_bytes()).unwrap_err().to_string(), &["road.csv, line 4", "column `x`", error]);
        }
        let read = log(format!("time,vx\n0,1\n{error},2\n0.04,{error}\n").as_bytes());
        let [time, vx] = ["time", "vx"].map(|name| read.column(name).unwrap());
        assert!(time.len() == 3 && time[1].is_nan() && vx[1] == 2.0 && vx[2].is_nan(), "{error}");
    }
}

#[test]
fn empty_lines_are_passed_over_and_counted() {
    for (end, many) in [("\n", 3_000_000), ("\r\n", 70_000), ("\r", 70_000)] {
        let text = format!("x,y{end}0,0{end}{}1,0{end}{end}  {end}2,far{end}", end.repeat(many));
        let line = format!("line {}", many + 6);
        has(&road(text.as_bytes()).unwrap_err().to_string(), &["road.csv", &line, "far"]);
    }
}

#[test]
fn values_that_no_road_has_are_refused_with_row_and_column() {
    for (column, value) in
        [("friction", "0"), ("friction", "-0.5"), ("friction", "0.0000"), ("bank", "1.2"), ("grade", "-7")]
    {
        let text = format!("x,y,{column}\n0,0,0.5\n\n1,0,{value}\n2,0,0.5\n");
        has(
            &road(text.as_bytes()).unwrap_err().to_string(),
            &["road.csv, line 4", &format!("column `{column}`")],
        );
    }
}

#[test]
fn sizes_are_bounded_and_the_error_names_the_limit() {
    let text = format!("x,y\n{}", "1,2\n".repeat(1000));
    let read = |limits| -> Result<u64, TableError> {
        let mut table = Table::new(text.as_bytes(), limits, &|_| false)?;
        let mut rows = 0;
        while table.next_row()?.is_some() {
            rows += 1;
        }
        Ok(rows)
    };
    assert_eq!(read(Limits::default()).unwrap(), 1000);
    assert!(matches!(
        read(Limits { rows: 10, ..Limits::default() }),
        Err(TableError::TooManyRows { line: 12, limit: 10 })
    ));
    assert!(matches!(
        read(Limits { bytes: 2000, ..Limits::default() }),
        Err(TableError::TooLarge { limit: 2000, .. })
    ));
    let long = "x".repeat(2 << 20);
    let error = Table::new(long.as_bytes(), Limits::default(), &|_| false).err().unwrap();
    assert!(matches!(error, TableError::LongLine { line: 1 }));
}

#[cfg(feature = "cli")]
#[test]
fn packed_files_are_bounded_unpacked() {
    use std::io::Write;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bomb.csv.gz");
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    for _ in 0..100_000 {
        packer.write_all(b"0,0,0,0,0,0,0,0\n").unwrap();
    }
    std::fs::write(&file, packer.finish().unwrap()).unwrap();
    let limits = Limits { bytes: 1 << 20, ..Limits::default() };
    let mut table = Table::new(open(&file, limits).unwrap(), limits, &|_| false).unwrap();
    let error =
        std::iter::from_fn(|| table.next_row().map(|row| row.map(|_| ())).transpose()).find_map(Result::err);
    has(&error.expect("was read").to_string(), &["more than 1 MB", "limit"]);
}

#[cfg(unix)]
#[test]
fn what_is_no_file_is_refused_unread() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.csv");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let socket = folder.path().join("socket.csv");
    let _kept = std::os::unix::net::UnixListener::bind(&socket).unwrap();
    for (file, kind) in [
        (pipe, "a pipe"),
        (socket, "a socket"),
        (folder.path().to_owned(), "a folder"),
        (PathBuf::from("/dev/zero"), "a device"),
    ] {
        let name = file.display().to_string();
        has(&Path::read(&file).unwrap_err().to_string(), &[&name, kind]);
        has(&DriveLog::read(&file).unwrap_err().to_string(), &[&name, kind]);
    }
    for (bytes, kind) in [
        (&b"BZh91AY&SY"[..], "bzip2"),
        (b"\xfd7zXZ\0\0", "xz"),
        (b"\x28\xb5\x2f\xfd\0", "zstd"),
        (b"MDF     4.10", "an MDF file"),
        (b"PK\x03\x04", "spreadsheet"),
    ] {
        let file = folder.path().join("foreign.csv");
        std::fs::write(&file, bytes).unwrap();
        has(&Path::read(&file).unwrap_err().to_string(), &["foreign.csv", kind]);
        has(&DriveLog::read(&file).unwrap_err().to_string(), &["foreign.csv", kind]);
    }
    // Larger than any road, and no bytes on the disk.
    let large = folder.path().join("large.csv");
    std::fs::File::create(&large).unwrap().set_len(3 << 30).unwrap();
    has(&Path::read(&large).unwrap_err().to_string(), &["large.csv", "256 MB"]);
    has(&DriveLog::read(&large).unwrap_err().to_string(), &["large.csv", "512 MB"]);
}

/// Repeatable noise of unit variance (sum of 12 uniform numbers).
fn noise(seed: &mut u64) -> f64 {
    let mut uniform = || {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

#[test]
fn noise_is_measured_and_smoothed() {
    // Standard deviation and spacing in m.
    for (sigma, spacing, seed) in
        [(0.1, 1.0, 1), (1.0, 1.0, 2), (0.05, 0.5, 3), (0.5, 0.25, 4), (0.1, 0.1, 5), (2.0, 1.0, 6)]
    {
        let mut seed = seed;
        let count = (300.0 / spacing) as u32;
        let text: String = (0..count)
            .map(|i| f64::from(i) * spacing)
            .map(|x| (x + sigma * noise(&mut seed), 20.0 * (x / 40.0).sin() + sigma * noise(&mut seed)))
            .map(|(x, y)| format!("{x:.4},{y:.4}\n"))
            .collect();
        let path = road(format!("x,y\n{text}").as_bytes())
            .unwrap_or_else(|error| panic!("{sigma} {spacing}: {error}"));
        let tightest = (0..(4.0 * path.length()) as u32)
            .fold(0.0f64, |worst, i| worst.max(path.curvature(0.25 * f64::from(i)).abs()));
        println!(
            "{sigma} m at {spacing} m: {:.1} m, radius {:.1} m, {:?}",
            path.length(),
            1.0 / tightest,
            path.notes()
        );
        // The truth: 317.7 m, 80 m.
        assert!((312.0..327.0).contains(&path.length()) && 1.0 / tightest > 30.0, "{sigma} {spacing}");
        assert!(path.notes().iter().any(|note| note.text.contains("measured noise") && !note.warning));
    }
    // Closed ones.
    for (sigma, seed) in [(0.03, 7), (0.5, 8)] {
        let mut seed = seed;
        let ring: String = (0..377)
            .map(|i| f64::from(i) / 60.0)
            .map(|a| (60.0 * a.cos() + sigma * noise(&mut seed), 60.0 * a.sin() + sigma * noise(&mut seed)))
            .map(|(x, y)| format!("{x:.3},{y:.3}\n"))
            .collect();
        let ring = road(format!("x,y\n{ring}").as_bytes()).unwrap();
        assert!(ring.is_periodic() && (ring.length() - 377.0).abs() < 5.0, "{sigma}: {}", ring.length());
    }
}

#[test]
fn clean_points_have_no_noise() {
    let mut seed = 1;
    let mut x = 0.0;
    // Uneven steps, written in full and with three decimals.
    let uneven: Vec<(f64, f64)> = (0..400)
        .map(|_| {
            x += 0.8 + 0.1 * noise(&mut seed).abs() + if noise(&mut seed) > 1.0 { 1.5 } else { 0.0 };
            (x, 20.0 * (x / 40.0).sin())
        })
        .collect();
    // Right angles, and a zigzag of 20 m legs.
    let corners: Vec<(f64, f64)> =
        (0..200).map(|i| (f64::from(i.min(100)), f64::from((i - 100).max(0)))).collect();
    let zigzag: Vec<(f64, f64)> =
        (0..300).map(|i| (f64::from(i), 0.5 * f64::from((i % 40 - 20i32).abs()))).collect();
    for points in [uneven, corners, zigzag] {
        for decimals in [3, 6] {
            let text: String =
                points.iter().map(|(x, y)| format!("{x:.decimals$},{y:.decimals$}\n")).collect();
            let path = road(format!("x,y\n{text}").as_bytes()).unwrap();
            assert!(
                path.notes().iter().all(|note| !note.text.contains("measured noise")),
                "{:?}",
                path.notes()
            );
        }
    }
}

#[test]
fn points_without_order_are_still_refused() {
    let mut seed = 4;
    let text: String = (0..200)
        .map(|_| format!("{:.3},{:.3}\n", 50.0 * noise(&mut seed), 50.0 * noise(&mut seed)))
        .collect();
    let error = road(format!("x,y\n{text}").as_bytes()).expect_err("was read");
    assert!(
        matches!(error, PathError::Noise { .. } | PathError::TurnsBack { .. } | PathError::Gap { .. }),
        "{error}"
    );
}

#[test]
fn bends_beyond_the_turning_circle_are_known_by_station_and_radius() {
    let corner: String = (0..100).map(|i| format!("{},{}\n", i.min(50), (i - 50).max(0))).collect();
    let path = road(format!("x,y\n{corner}").as_bytes()).unwrap();
    let (station, radius, length) = path.tighter_than(4.0).expect("a corner");
    assert!((station - 50.0).abs() < 3.0 && radius < 2.0 && length < 6.0, "{station} {radius} {length}");
    let car = rfl_mpc::control::ControllerParameters::default();
    has(&car.too_tight(&path).expect("a warning"), &["station 5", "m radius", "turns"]);
    // A blunt corner, a sharp one, and a U-turn of 3 m radius.
    let leg = |angle: f64, i: i32| {
        let (before, after) = (f64::from(i.min(50)), f64::from((i - 50).max(0)));
        (before + after * angle.cos(), after * angle.sin())
    };
    let turn = |i: i32| {
        let angle = (f64::from(i - 50) / 3.0).clamp(0.0, std::f64::consts::PI);
        let after = (f64::from(i - 50) - 3.0 * angle).max(0.0);
        (f64::from(i.min(50)) + 3.0 * angle.sin() - after, 3.0 * (1.0 - angle.cos()))
    };
    let shapes: [&dyn Fn(i32) -> (f64, f64); 3] =
        [&|i| leg(45f64.to_radians(), i), &|i| leg(110f64.to_radians(), i), &turn];
    for (place, shape) in shapes.into_iter().enumerate() {
        let points: String = (0..100).map(shape).map(|(x, y)| format!("{x:.3},{y:.3}\n")).collect();
        let path = road(format!("x,y\n{points}").as_bytes()).unwrap();
        let (station, radius, _) = path.tighter_than(4.0).unwrap_or_else(|| panic!("shape {place}"));
        assert!((45.0..65.0).contains(&station) && radius < 4.0, "shape {place}: {station} {radius}");
        assert!(car.too_tight(&path).is_some(), "shape {place}");
    }
    assert_eq!(
        car.too_tight(&same_road(format!("x;y\n{}", rows(|x, y| format!("{x:.4};{y:.4}\n"))).as_bytes())),
        None
    );
}

#[test]
fn a_road_that_is_written_as_driven_is_the_same_road() {
    let samples: Vec<Sample> =
        points().into_iter().map(|(x, y)| Sample { friction: Some(0.7), ..Sample::at(x, y) }).collect();
    let path = Path::from_samples(samples, rfl_mpc::path::Closure::Open).unwrap();
    let again = road(rfl_mpc::path::to_csv(&path.samples(0.5)).as_bytes()).unwrap();
    assert!((path.length() - again.length()).abs() < 1e-3 && again.notes().is_empty(), "{:?}", again.notes());
    for s in 0..100 {
        let (a, b) = (path.at(f64::from(s)), again.at(f64::from(s)));
        assert!(
            (a.x - b.x).hypot(a.y - b.y) < 1e-3
                && (a.curvature - b.curvature).abs() < 1e-4
                && b.friction == 0.7
        );
    }
}

fn cases(folder: &str) -> Option<PathBuf> {
    let found = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("../shared/cases").join(folder);
    if found.is_dir() {
        return Some(found);
    }
    eprintln!("SKIPPED: no {}", found.display());
    None
}

#[test]
fn roads_that_failed() {
    let Some(folder) = cases("roads") else { return };
    let read = |name: &str| Path::read(&folder.join(name));
    for name in ["road_gps_10cm_noise.csv", "road_gps_1m_noise.csv"] {
        let path = read(name).unwrap();
        assert!(
            (path.length() - 318.0).abs() < 3.0 && path.notes()[0].text.contains("measured noise"),
            "{name}"
        );
        assert!(path.tighter_than(60.0).is_none(), "{name}");
    }
    for name in ["road_semicolon.csv", "road_semicolon_decimal_comma.csv"] {
        assert!((read(name).unwrap().length() - 317.7).abs() < 0.1, "{name}");
    }
    assert!(read("road_raceline_format.csv").unwrap().is_periodic());
    has(&read("road_friction0.csv").unwrap_err().to_string(), &["road_friction0.csv, line 2", "`friction`"]);
    assert!(read("road_corners90.csv").unwrap().tighter_than(4.0).is_some());
    if cfg!(feature = "cli") {
        let path = read("road_dup.csv.gz").unwrap();
        assert!(path.notes().iter().all(|note| !note.warning) && path.notes()[0].text.contains("dropped"));
    }
}

#[test]
fn logs_that_failed() {
    let Some(folder) = cases("logs") else { return };
    let read = |name: &str| DriveLog::read(&folder.join(name));
    let time = read("iso_time.csv").unwrap();
    let time = time.column("time").unwrap();
    assert!(time[0] == 0.0 && time.windows(2).all(|pair| (pair[1] - pair[0] - 0.02).abs() < 1e-6));
    assert!(read("latin1_header.csv").unwrap().column("ay").is_some());
    // Its columns have names of another tool, found between semicolons.
    has(
        &read("semicolon_decimal_comma_log.csv").unwrap_err().to_string(),
        &["time,SteerAngle,Speed,YawRate", "import_log"],
    );
    has(&read("motec_like.csv").unwrap_err().to_string(), &["Time,Steered Angle,Ground Speed"]);
    has(&read("underscore_time.csv").unwrap_err().to_string(), &["line 2, column time", "2024_04_23"]);
}

/// A good file of some kind.
fn good() -> Vec<Vec<u8>> {
    let semicolons = format!("x;y\r\n{}", comma(rows(|x, y| format!("{x:.4};{y:.4}\r\n"))));
    vec![
        utf16(&semicolons, true, true),
        semicolons.into_bytes(),
        format!("# s_m; x_m; y_m\n{}", rows(|x, y| format!("{x:.4}; {x:.4}; {y:.4}\n"))).into_bytes(),
        b"\"Format\",\"MoTeC\"\n\"time\",\"vx\"\n\"s\",\"km/h\"\n\n\"0.00\",\"36\"\n\"0.02\",\"72\"\n"
            .to_vec(),
        b"time;vx [km/h]\n2024-12-31 23:59:59,5;36,0\n2025-01-01 00:00:00,25;72,0\n".to_vec(),
    ]
}

fn read_all(bytes: &[u8]) {
    let _ = road(bytes);
    let _ = DriveLog::from_reader(bytes, FilePath::new("fuzz.csv"));
    for known in [true, false] {
        if let Ok(mut table) = Table::new(bytes, Limits::default(), &|_| known) {
            let mut last = 0;
            while let Ok(Some(row)) = table.next_row() {
                assert!(row.line >= last, "lines rise");
                last = row.line;
                let _ = (0..row.len() + 2).filter_map(|column| row.number(column)).count();
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 1000, ..ProptestConfig::default() })]

    #[test]
    fn no_bytes_stop_a_reader(bytes in proptest::collection::vec(any::<u8>(), 0..600)) {
        read_all(&bytes);
    }

    #[test]
    fn no_damage_stops_a_reader(
        kind in 0..5usize,
        damage in proptest::collection::vec((any::<proptest::sample::Index>(), 0..4u8, any::<u8>()), 1..12),
    ) {
        let mut bytes = good().swap_remove(kind);
        for (place, what, byte) in damage {
            if bytes.is_empty() {
                break;
            }
            let at = place.index(bytes.len());
            match what {
                0 => bytes[at] = byte,
                1 => bytes.truncate(at),
                2 => bytes.insert(at, byte),
                _ => bytes[at] = b"\",;\t\n#%_.-e0"[byte as usize % 12],
            }
        }
        read_all(&bytes);
    }
}
