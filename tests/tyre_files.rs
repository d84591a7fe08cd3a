//! Reading `.tir` files: what is read, and what is said of those that cannot be.

use rfl_mpc::vehicle::tyre::{Coefficients, Contact, TirError, TyreModel as _};
use std::path::{Path, PathBuf};

const SOUND: &str = "! a tyre\n[UNITS]\nLENGTH = 'meter' $ m\nANGLE='radians'\n[MODEL]\nPROPERTY_FILE_FORMAT='PAC2002'\n\
    [DIMENSION]\nUNLOADED_RADIUS = 0.3\n[VERTICAL]\nFNOMIN = 4000\nVERTICAL_STIFFNESS = 2.0e5\n\
    [SHAPE]\n{radial width}\n1.0 0.0\n1.0 0.4\n[LONGITUDINAL_COEFFICIENTS]\nPCX1 = 1.6\nPDX1=1.1\nPKX1 = 22\n\
    [LATERAL_COEFFICIENTS]\npcy1 = 1.3\nPDY1 = 1.0\nPKY1 = -2.0D1\nPKY2 = 2\nUNHEARD_OF = 3\n";

fn parse(text: &str) -> Result<Coefficients, TirError> {
    Coefficients::parse(text, Path::new("test.tir"))
}

#[test]
fn comments_tables_strings_case_and_fortran_exponents_are_understood() {
    let tyre = parse(SOUND).unwrap();
    assert_eq!((tyre.r0, tyre.fz0, tyre.pcy1, tyre.pky1), (0.3, 4000.0, 1.3, -20.0));
    assert_eq!((tyre.lky, tyre.pey1, tyre.fzmax), (1.0, 0.0, f64::INFINITY), "the standard's defaults");
}

#[test]
fn what_is_wrong_is_named_with_file_line_key_and_remedy() {
    let change = |from: &str, to: &str| parse(&SOUND.replace(from, to)).unwrap_err().to_string();
    for (message, parts) in [
        (change("FNOMIN = 4000", "FNOMIN = 40x0"), ["line 10", "FNOMIN = 40x0", "number"]),
        (change("FNOMIN = 4000", "FNOMIN = NaN"), ["line 10", "FNOMIN", "finite"]),
        (change("PKY1 = -2.0D1\n", ""), ["test.tir", "missing PKY1", "complete"]),
        (change("'meter'", "'inch'"), ["line 3", "LENGTH = 'inch'", "convert the file to 'meter'"]),
        (change("'PAC2002'", "'MF_61'"), ["line 6", "'MF_61'", "5.2"]),
        (change("'PAC2002'", "'USER'\nFITTYP = 62"), ["line 7", "FITTYP = '62'", "MF-Tyre 5.2"]),
        (change("'PAC2002'", "'USER'"), ["line 6", "USER", "add FITTYP = 6"]),
        (change("'PAC2002'", "'FTIRE'"), ["line 6", "another tyre model", "PAC2002"]),
        (change("PDX1=1.1", "PDX1=1.1\nPDX1=1.2"), ["PDX1", "line 18", "line 19"]),
        (change("FNOMIN = 4000", "FNOMIN = -1"), ["line 10", "FNOMIN = -1", "greater than zero"]),
        (
            change("FNOMIN = 4000", "FNOMIN = 4000\nLONGVL = 0"),
            ["line 11", "LONGVL = 0", "greater than zero"],
        ),
        (change("RADIUS = 0.3", "RADIUS = 316"), ["line 8", "UNLOADED_RADIUS = 316", "in metres"]),
        (change("'PAC2002'", "'PAC2002'\nFITTYP = 6.2"), ["line 7", "FITTYP = '6.2'", "MF-Tyre 5.2"]),
        (change("-2.0D1", "20"), ["PKY1 = 20", "negative", "ISO"]),
    ] {
        for part in parts {
            assert!(message.contains(part), "'{part}' is not in: {message}");
        }
    }
    let cut_off = parse(&SOUND[..SOUND.len() / 2]).unwrap_err().to_string();
    assert!(cut_off.contains("PCX1") && cut_off.contains("PKY2"), "{cut_off}");
    let missing = Coefficients::read(Path::new("no/such.tir")).unwrap_err().to_string();
    assert!(missing.contains("no/such.tir") && missing.contains("cannot be read"), "{missing}");
    assert!(parse("").is_err());
}

#[test]
fn a_file_is_read_in_any_encoding() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("tyre.tir");
    let sound = parse(SOUND).unwrap();
    let wide = |mark: &[u8], bytes: fn(u16) -> [u8; 2]| {
        [mark, &SOUND.encode_utf16().flat_map(bytes).collect::<Vec<_>>()].concat()
    };
    for bytes in [
        wide(&[0xff, 0xfe], u16::to_le_bytes),
        wide(&[0xfe, 0xff], u16::to_be_bytes),
        wide(&[], u16::to_le_bytes),
        [&[0xef, 0xbb, 0xbf], SOUND.as_bytes()].concat(),
        SOUND.replace('\n', "\r").into_bytes(),
        SOUND.replace('\n', "\r\n").into_bytes(),
        // A comment in Latin-1.
        [b"$ M\xfcnchen\n", SOUND.as_bytes()].concat(),
    ] {
        std::fs::write(&file, bytes).unwrap();
        assert_eq!(Coefficients::read(&file).unwrap(), sound);
    }
}

/// Older files call themselves `USER`, and say by `FITTYP` what they are.
#[test]
fn a_file_of_the_magic_formula_5_2_is_known_by_its_fittyp() {
    let sound = parse(SOUND).unwrap();
    for model in ["'USER'\nFITTYP = 6", "'user'\nFITTYP=52 $ MF-Tyre 5.2", "'MF-TYRE'\nFITTYP = 21.0"] {
        assert_eq!(parse(&SOUND.replace("'PAC2002'", model)).unwrap(), sound, "{model}");
    }
}

/// The folder of tyre files from outside, where there is one.
fn outside() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/tyres");
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("SKIPPED: no tyre files in {}", folder.display());
    None
}

fn about(value: f64, expected: f64, tolerance: f64) {
    assert!((value / expected - 1.0).abs() < tolerance, "{value}, expected {expected}");
}

#[test]
fn the_public_sedan_tyre() {
    let Some(folder) = outside() else { return };
    let tyre = Coefficients::read(&folder.join("Sedan_Pac02Tire.tir")).unwrap();
    // The file scales its nominal load by LFZO = 0.81; the published 74.9 kN/rad and 0.52 m are without that factor.
    assert_eq!(tyre.lfzo, 0.81);
    let unscaled = Coefficients { lfzo: 1.0, ..tyre.clone() };
    about(unscaled.cornering_stiffness(4000.0, 0.0), 74.9e3, 1e-3);
    about(unscaled.lateral_relaxation(4000.0, 0.0), 0.523, 2e-3);
    // As the file stands: PKY1 Fz0' sin(2 atan(Fz / (PKY2 Fz0'))), Fz0' = 0.81 * 4850.
    let fz0: f64 = 0.81 * 4850.0;
    about(
        tyre.cornering_stiffness(4000.0, 0.0),
        21.92 * fz0 * (2.0 * (4000.0 / (2.0012 * fz0)).atan()).sin(),
        1e-12,
    );
    assert_eq!(tyre.rbx1, 0.0, "this file has no combined slip: the friction ellipse serves");
}

#[test]
fn the_public_truck_tyres() {
    let Some(folder) = outside() else { return };
    let bus = Coefficients::read(&folder.join("CityBus_Pac02Tire.tir")).unwrap();
    about(bus.cornering_stiffness(25e3, 0.0) / 25e3, 5.9, 5e-3);
    about(bus.cornering_stiffness(25e3, 0.0), 149e3, 1e-2);
    about(bus.lateral_relaxation(25e3, 0.0), 0.35, 1e-2);
    let goodyear = Coefficients::read(&folder.join("335_65R22_5_G275MSA_95psi.tir")).unwrap();
    assert!(goodyear.cornering_stiffness(25e3, 0.0) > 100e3);
}

/// Ply steer, conicity and asymmetric trail, all coefficients of them.
const ASYMMETRIC: &str = "RHX1 = 0.01\nQSX1 = 0.02\nPEY1 = -1\nPEY3 = 0.1\nPEY4 = -3\nPHY1 = 0.003\nPHY2 = 0.001\nPHY3 = 0.02\n\
    PVY1 = 0.02\nPVY2 = -0.01\nPVY3 = -0.3\nPDY3 = 2\nRBX1 = 12\nRBX2 = -10\nRCX1 = 1.1\nRBY1 = 6\nRBY2 = 4\nRBY3 = 0.03\nRCY1 = 1\n\
    RVY1 = 0.05\nRVY2 = -0.02\nRVY3 = 1\nRVY4 = 90\nRVY5 = 1.9\nRVY6 = 25\nQBZ1 = 9\nQBZ4 = 0.2\nQBZ5 = -0.3\nQCZ1 = 1.1\n\
    QDZ1 = 0.1\nQDZ3 = 0.8\nQDZ4 = -3\nQDZ6 = 0.004\nQDZ7 = -0.002\nQDZ8 = 0.1\nQBZ10 = 0.4\nQEZ1 = -2\nQEZ4 = 0.3\nQEZ5 = 2\n\
    QHZ1 = 0.005\nQHZ2 = 0.001\nQHZ3 = 0.1\nSSZ1 = 0.02\nSSZ2 = 0.01\nSSZ3 = 0.3\n";

#[test]
fn a_tyre_that_was_measured_on_the_right_is_mirrored() {
    let of = |side: &str| parse(&format!("{SOUND}{ASYMMETRIC}[MODEL]\nTYRESIDE = '{side}'\n")).unwrap();
    let (left, right) = (of("LEFT"), of("Right"));
    assert_eq!(left, of("UNKNOWN"));
    let contacts = [(0.0, 0.0, 0.0), (0.05, 0.06, 0.03), (-0.1, -0.15, 0.05), (0.02, 0.01, -0.04)];
    for ((kappa, alpha, gamma), load) in
        contacts.into_iter().flat_map(|c| [2000.0, 6000.0].map(|load| (c, load)))
    {
        let contact = Contact { kappa, alpha, gamma, load, friction: 0.9 };
        let (here, there) =
            (left.forces(&contact), right.forces(&Contact { alpha: -alpha, gamma: -gamma, ..contact }));
        for (here, there) in
            [(here.fx, there.fx), (here.fy, -there.fy), (here.mx, -there.mx), (here.mz, -there.mz)]
        {
            assert!((here - there).abs() <= 1e-9 * (1.0 + here.abs()), "{here} and {there} at {contact:?}");
        }
        let ply_steer = right.forces(&contact).fy - left.forces(&contact).fy;
        assert!(ply_steer.abs() > 1.0, "{ply_steer} N at {contact:?}");
    }
}
