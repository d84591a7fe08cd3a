"""Text tables of any layout: delimiters, decimal commas, encodings, what stands above the numbers."""

from __future__ import annotations

import gzip
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import PLAIN, VX, YAW_RATE, close, imported, mapping, rows
from import_log import ImportFailed, convert, open_log


def write(tmp_path: Path, lines: list[str], encoding: str = "utf-8", end: str = "\n", name: str = "log.csv") -> Path:
    file = tmp_path / name
    file.write_bytes((end.join(lines) + end).encode(encoding))
    return file


def check(file: Path, tmp_path: Path, text: str = PLAIN) -> None:
    columns = imported(file, mapping(tmp_path, text), tmp_path)
    assert len(columns["time"]) == 300
    close(columns, vx=VX, yaw_rate=YAW_RATE)


SEMICOLON = [line.replace(".", ",") for line in rows(fields="{t:.3f};{v:.6f};{r:.8f}")]
QUOTED_COMMA = [
    '"' + line.replace(".", ",").replace(";", '","') + '"' for line in rows(fields="{t:.3f};{v:.6f};{r:.8f}")
]

LAYOUTS = {
    "semicolon": ["t;v;r", *rows(fields="{t:.3f};{v:.6f};{r:.8f}")],
    "semicolon, decimal comma": ["t;v;r", *SEMICOLON],
    "semicolon, decimal comma, blanks": ["t ; v ; r", *[line.replace(";", " ; ") for line in SEMICOLON]],
    "comma, quoted decimal comma": ["t,v,r", *QUOTED_COMMA],
    "tab": ["t\tv\tr", *rows(fields="{t:.3f}\t{v:.6f}\t{r:.8f}")],
    "tab, decimal comma": ["t\tv\tr", *[line.replace(";", "\t") for line in SEMICOLON]],
    "blanks": ["  t      v      r", *rows(fields="  {t:8.3f}   {v:9.6f}   {r:.8f}")],
    "bar": ["t|v|r", *rows(fields="{t:.3f}|{v:.6f}|{r:.8f}")],
    "comma and blank": ["t, v, r", *rows(fields="{t:.3f}, {v:.6f}, {r:.8f}")],
    "exponents": ["t,v,r", *rows(fields="{t:.4e},{v:+.7E},{r:.8e}")],
    "quoted names": ['"t","v","r"', *rows()],
    "all quoted": ['"t","v","r"', *rows(fields='"{t:.3f}","{v:.6f}","{r:.8f}"')],
    "delimiter at the end": ["t,v,r,", *rows(fields="{t:.3f},{v:.6f},{r:.8f},")],
    "delimiter at the end of numbers": ["t;v;r", *rows(fields="{t:.3f};{v:.6f};{r:.8f};")],
    "units below the names": ["t,v,r", "s,km/h,rad/s", *rows()],
    "units in brackets below the names": ["t;v;r", "[s];[km/h];[rad/s]", *SEMICOLON],
    "units and a blank line": ["t,v,r", "s,km/h,rad/s", "", *rows()],
    "comments": ["# made by a logger, of 2024", "# second; line", "t,v,r", "# units unknown", *rows(), "# end"],
    "names in a comment": ["# t, v, r", *rows()],
    "names in a comment of numpy": ["# t v r", *rows(fields="{t:.6e} {v:.6e} {r:.8e}")],
    "percent comments": ["% MATLAB says", "% t;v;r", *rows(fields="{t:.3f};{v:.6f};{r:.8f}")],
    "keys and values above": ["Driver;A", "Rate;100", "Car;7;B", "", "t;v;r", *SEMICOLON],
    "keys and numbers above": ["Version,3", "Rate,100.0", "Mass,1500,kg", "t,v,r", *rows()],
    "block of as many fields above": ["Format,CSV,2", "Car,A,B", "Rate,100,Hz", "t,v,r", "s,km/h,rad/s", *rows()],
    "descriptions below the names": ["t,v,r", "time of day,speed over ground,yaw rate", "s,km/h,rad/s", *rows()],
    "text column": ["t,state,v,r", *rows(fields="{t:.3f},ACTIVE,{v:.6f},{r:.8f}")],
    "unnamed first column": [",t,v,r", *rows(fields="7,{t:.3f},{v:.6f},{r:.8f}")],
    "last line cut off": ["t,v,r", *rows(300), "3.0"],
    "footer": ["t,v,r", *rows(), "", "End of file"],
    "names and units in one field": ["t [s],v [km/h],r [rad/s]", *rows()],
    "names and units in round brackets": ["t (s);v (km/h);r (rad/s)", *SEMICOLON],
    "names and units in comments": ["# t, v, r", "# s, km/h, rad/s", *rows()],
    "Excel's line": ["sep=;", "t;v;r", *SEMICOLON],
    "lines between": ["t,v,r", "", *[part for line in rows() for part in (line, "")]],
    "zero bytes at the end": ["t,v,r", *rows(), "\0" * 2000],
    "single quotes": ["'t','v','r'", *rows(fields="'{t:.3f}',{v:.6f},{r:.8f}")],
    "a word for gaps": [
        "t,x,v,r",
        *[line.replace(",", ",SNA," if i % 3 else ",1.0,", 1) for i, line in enumerate(rows())],
    ],
    "one long line": ["t,v,r", *rows(150), "1.495,1,2,3,4", *rows()[150:]],
    "a column of comments without a field": ["t,v,r,Comment", *rows()],
    "numbers of the columns below the units": [
        "t,v,r,n",
        "s,km/h,rad/s,",
        "1,2,3,4",
        *rows(fields="{t:.3f},{v:.6f},{r:.8f},7"),
    ],
    "LabVIEW": [
        "***End_of_Header***\t\t\t",
        "Y_Unit_Label\tkm/h\trad/s",
        "t\tv\tr\tComment",
        *rows(fields="{t:.3f}\t{v:.6f}\t{r:.8f}"),
    ],
    "names over two lines": ['"t\n[s]","v\n[km/h]","r\n[rad/s]"', *rows()],
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_layout_is_read(tmp_path, layout):
    lines = LAYOUTS[layout]
    file = write(tmp_path, lines)
    if layout == "last line cut off":
        columns = imported(file, mapping(tmp_path, PLAIN), tmp_path)
        close(columns, vx=VX)
    else:
        check(file, tmp_path)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1", "cp1252", "utf-32"]
)
def test_an_encoding_is_read(tmp_path, encoding, end):
    lines = ["t;v;r;Außentemperatur [°C]", *[f"{line};20,5" for line in SEMICOLON]]
    file = write(tmp_path, lines, encoding, end)
    check(file, tmp_path)
    assert "Außentemperatur [°C]" in open_log(file).names


@pytest.mark.parametrize("name", ["log.csv.gz", "log.txt", "log.tsv", "LOG.CSV"])
def test_an_ending_is_known(tmp_path, name):
    file = write(tmp_path, ["t\tv\tr", *rows(fields="{t:.3f}\t{v:.6f}\t{r:.8f}")], name=name)
    if name.endswith(".gz"):
        file.write_bytes(gzip.compress(file.read_bytes()))
    check(file, tmp_path)


def test_few_rows_are_read(tmp_path):
    lines = ["Car,A", "Rate,50", "t,v,r", "s,km/h,rad/s", *rows(3)]
    columns = imported(write(tmp_path, lines), mapping(tmp_path, PLAIN), tmp_path)
    assert np.allclose(columns["vx"], VX[:3])


def test_a_motec_export_is_read(tmp_path):
    lines = ['"Format","MoTeC CSV File",,,"Workbook",""', '"Sample Rate","100","Hz"', "", '"t","v","r"',
             '"s","km/h","rad/s"', "", *rows(fields='"{t:.3f}","{v:.6f}","{r:.8f}"')]  # fmt: skip
    check(write(tmp_path, lines, end="\r\n"), tmp_path)
    lines[0] = '"Format","MoTeC CSV File",""'
    check(write(tmp_path, lines[:3] + lines[3:]), tmp_path)


@pytest.mark.parametrize(
    ("above", "names", "units"),
    [
        (["Format,CSV,2"], "t,v,a", ""),
        (["Format,CSV,2"], "t,v,a", "s,km/h,m/s2"),
        ([], "s,m,g", ""),
        ([], "s,m,g", "m,kg,g"),
        (["a,b,c"], "time,speed,rate", "ms,V,A"),
        ([], "time,speed,rate", "[s],[-],[foo]"),
        ([], "Time,Ground Speed,Yaw Rate", "s,km/h,deg/s"),
    ],
)
def test_names_and_units_are_told_apart(tmp_path, above, names, units):
    log = open_log(write(tmp_path, [*above, names, *([units] if units else []), *rows()]))
    assert log.names == names.split(",")
    assert [log.units.get(name, "") for name in log.names] == [unit.strip("[]") for unit in (units or ",,").split(",")]


def test_a_vbox_file_has_its_units_in_sections(tmp_path):
    above = [
        "File created on 01/05/2024", "", "[header]", "satellites", "t", "velocity kmh", "heading", "YawRate", "",
        "[channel units]", "deg/s", "", "[comments]", "VBOX", "", "[column names]", "sats t v heading r", "", "[data]",
    ]  # fmt: skip
    lines = rows(fields="012 {t:.3f} {v:+.6f} 090.05 {r:.8f}")
    log = open_log(write(tmp_path, [*above, *lines], name="log.vbo"))
    assert log.names == ["sats", "t", "v", "heading", "r"]
    assert log.units == {"v": "kmh", "heading": "deg", "r": "deg/s"}


def test_a_name_that_holds_the_delimiter_is_refused(tmp_path):
    file = write(tmp_path, ["t,v, GPS,r", *rows()])
    with pytest.raises(ImportFailed, match="line 2 has 3 fields and the line of names, 1, has 4"):
        open_log(file)


def test_gaps_are_gaps(tmp_path):
    lines = ["t,v,r", *rows()]
    for row, gap in enumerate(["", "nan", "NaN", "NA", "null", "-", "inf", "#N/A"], 10):
        lines[row] = lines[row].rsplit(",", 1)[0] + "," + gap
    columns = imported(write(tmp_path, lines), mapping(tmp_path, PLAIN), tmp_path)
    assert np.isfinite(columns["vx"]).all()
    close(columns, vx=VX, yaw_rate=YAW_RATE)


def test_a_unit_of_the_file_is_taken_and_said(tmp_path):
    file = write(tmp_path, ["t [ms],v [kph],r [°/s]", *rows(fields="{t:.6f},{v:.6f},{r:.8f}")])
    text = PLAIN.replace('unit = "km/h"\n', "")
    said = convert(file, mapping(tmp_path, text), tmp_path / "out.csv")
    assert "'v [kph]' is in km/h, as the file says" in said
    assert "'r [°/s]' is in deg/s" in said
    assert "in ms, as the file says" in said
    with pytest.raises(
        ImportFailed, match=r"columns.yaw_rate.*is in deg/s, as the file says, and the mapping has a fac"
    ):
        convert(file, mapping(tmp_path, text + "factor = 2.0\n"), tmp_path / "out.csv")


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        # A number with an underscore is none, though Python takes it for one.
        (
            ["t,v,r", *rows(fields="{t:.3f},1_{v:.3f},{r:.8f}")],
            r'\[columns.vx\] column = "v".*1_43.*line 2 is no number',
        ),
        (["t,v,r", *rows(fields="1_000.{t:.0f},{v:.6f},{r:.8f}")], r"\[time\] column = 't'.*1_000"),
        # Thousands and a decimal comma in a file with points: which one cannot be told.
        (["t;v;r", *rows(fields="{t:.3f};1,234;{r:.8f}")], r'\[columns.vx\] column = "v".*1,234.*is no number'),
        (["t;v;r", *rows(fields="{t:.3f};1.234,5;{r:.8f}")], r'\[columns.vx\] column = "v"'),
        (["t,v,r", *[line.replace(";", ",") for line in SEMICOLON]], "decimal comma"),
        (["t,v,r", *rows(fields="{t:.3f},{v:.6f},{r:.8f},5")], "line 2 has 4 fields"),
        (["t,v,v,r", *rows(fields="{t:.3f},{v:.6f},{v:.6f},{r:.8f}")], r'\[columns.vx\].*there is "v#1", "v#2"'),
        (["t,v,r", *rows(fields="{t:.3f},fast,{r:.8f}")], r"\[columns.vx\].*'fast' in line 2 is no number"),
        (
            ["time s v r", *rows(fields="{t:.3f} {v:.6f} {r:.8f}")],
            "line 2 has 3 fields and the line of names, 1, has 4",
        ),
        (["t|v|r", *rows()], "line 2 has 3 fields and the line of names, 1, has 1"),
        (["t,v,r", *rows(fields="{t:.3f} s,{v:.6f},{r:.8f}")], r"\[time\] column = 't'.*'0.000 s' in line 2"),
        (["t,v,r", *rows(fields=",{v:.6f},{r:.8f}")], r'\[time\] column = "t" of .* holds 0 times'),
        (["t,v,r", *rows(fields="{t:.3f},,{r:.8f}")], r'\[columns.vx\] column = "v": it holds 0 numbers'),
        (["t,v,r"], "no rows of numbers"),
        ([""], "it is empty"),
        (["hello", "world"], "no rows of numbers"),
        (["t,v,r", *rows(200), *rows(100)], "starts anew is another drive"),
    ],
)
def test_what_cannot_be_told_is_refused(tmp_path, lines, words):
    with pytest.raises(ImportFailed, match=words):
        convert(write(tmp_path, lines), mapping(tmp_path, PLAIN), tmp_path / "out.csv")
    assert not (tmp_path / "out.csv").exists()


def packed(kind: str) -> bytes:
    if kind == "zip":
        data = io.BytesIO()
        with zipfile.ZipFile(data, "w") as archive:
            archive.writestr("log.csv", "t,v,r\n" + "\n".join(rows()))
        return data.getvalue()
    return {"xls": b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600), "parquet": b"PAR1" + bytes(600)}[kind]


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("zip", "a spreadsheet or a zip archive: save the table as CSV"),
        ("xls", "a spreadsheet: save the table as CSV"),
        ("parquet", "a Parquet file: call it .parquet"),
    ],
)
@pytest.mark.parametrize("name", ["log.csv", "log.csv.gz"])
def test_a_file_of_another_kind_is_named(tmp_path, kind, words, name):
    file = tmp_path / name
    file.write_bytes(gzip.compress(packed(kind)) if name.endswith(".gz") else packed(kind))
    with pytest.raises(ImportFailed) as refused:
        convert(file, mapping(tmp_path, PLAIN), tmp_path / "out.csv")
    assert str(refused.value) == f"{file}: it is no text but {words}"


def test_short_rows_are_counted(tmp_path):
    lines = ["t,v,r", *rows()]
    lines.insert(101, "0.999")
    lines.insert(201, "1.989,43.2")
    said = convert(write(tmp_path, lines), mapping(tmp_path, PLAIN), tmp_path / "out.csv")
    assert "2 lines with fewer fields than there are names, whose others are gaps; the first is line 102" in said
    assert "fewer fields" not in convert(
        write(tmp_path, ["t,v,r", *rows()]), mapping(tmp_path, PLAIN), tmp_path / "o.csv"
    )


def test_a_name_that_stands_twice_is_numbered(tmp_path):
    file = write(tmp_path, ["t,v,v,r", *rows(fields="{t:.3f},0,{v:.6f},{r:.8f}")])
    check(file, tmp_path, PLAIN.replace('"v"', '"v#2"'))


@pytest.mark.parametrize("start", [0, 1])
def test_a_row_of_indices_holds_names(tmp_path, start):
    text = PLAIN
    for place, name in enumerate("tvr", start):
        text = text.replace(f'"{name}"', f'"{place}"')
    check(write(tmp_path, [",".join(str(start + i) for i in range(3)), *rows()]), tmp_path, text)


def test_a_word_for_gaps_is_said(tmp_path):
    lines = ["t,v,r", *rows()]
    lines[1::3] = [line.rsplit(",", 1)[0] + ",SNA" for line in lines[1::3]]
    said = convert(write(tmp_path, lines), mapping(tmp_path, PLAIN), tmp_path / "out.csv")
    assert "'r': 100 fields are no numbers and left out: 'SNA' in line 2" in said


def test_a_table_without_names_is_numbered(tmp_path):
    text = PLAIN.replace('"t"', '"1"').replace('"v"', '"2"').replace('"r"', '"3"')
    check(write(tmp_path, rows()), tmp_path, text)


@pytest.mark.parametrize("place", ["option", "mapping"])
def test_a_constant_rate_stands_for_a_time_column(tmp_path, place):
    file = write(tmp_path, ["v,r", *rows(fields="{v:.6f},{r:.8f}")])
    text = PLAIN.replace('[time]\ncolumn = "t"\n', "" if place == "option" else "[time]\nrate = 100\n")
    columns = imported(file, mapping(tmp_path, text), tmp_path, rate=100.0 if place == "option" else None)
    assert np.allclose(np.diff(columns["time"]), 0.01)
    close(columns, vx=VX, yaw_rate=YAW_RATE)


def test_a_rate_for_one_column_and_gaps(tmp_path):
    lines = ["v", *rows(fields="{v:.6f}")]
    lines[50] = "nan"
    columns = imported(
        write(tmp_path, lines), mapping(tmp_path, "[columns.vx]\ncolumn='v'\nunit='km/h'"), tmp_path, rate=100.0
    )
    close(columns, vx=VX)


def test_one_column_with_a_decimal_comma(tmp_path):
    lines = ["v", *[line.replace(".", ",") for line in rows(fields="{v:.6f}")]]
    text = "[time]\nrate = 100\n[columns.vx]\ncolumn='v'\nunit='km/h'"
    close(imported(write(tmp_path, lines), mapping(tmp_path, text), tmp_path), vx=VX)


def test_a_rate_beside_a_clock_is_refused(tmp_path):
    file = write(tmp_path, ["t,v,r", *rows()])
    with pytest.raises(ImportFailed, match="it is one of both"):
        convert(file, mapping(tmp_path, PLAIN), tmp_path / "out.csv", rate=50.0)
    with pytest.raises(
        ImportFailed, match=r'no clock: name the column of time in \[time\] \(there is "t"\).*--rate HZ'
    ):
        convert(file, mapping(tmp_path, "[columns.vx]\ncolumn='v'"), tmp_path / "out.csv")
