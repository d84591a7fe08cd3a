"""What is a number in a table: ASCII figures, and thousands where a decimal mark tells them from decimals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_logs import PLAIN, VX, close, imported, mapping, rows
from import_log import ImportFailed, convert
from importing.clock import is_stamp
from importing.number import number


@pytest.mark.parametrize(
    ("cell", "comma", "value"),
    [
        ("-1,234.5", False, -1234.5),
        ("1,234,567.25", False, 1234567.25),
        ("1.234,5", True, 1234.5),
        ("-1.234.567,25", True, -1234567.25),
        ("1234.5", False, 1234.5),
        ("1234,5", True, 1234.5),
        ("1,5e3", True, 1500.0),
        ("1'000", False, 1000.0),
        ("-1\u2019234\u2019567.5", False, -1234567.5),
        ("1'234,5", True, 1234.5),
        ("12'34", False, None),
        ("1'000\u2019000", False, None),
        ("1,234", True, 1.234),
        # A mark that may part thousands or decimals, or parts neither.
        ("1,234", False, None),
        ("12,34.5", False, None),
        ("1234,567.5", False, None),
        ("1.234", True, None),
        ("1.2,3", True, None),
        # Figures of other scripts.
        ("\uff11\uff12", False, None),
        ("\uff11\uff12,\uff15", True, None),
        ("\u0661\u0662", False, None),
        ("1\u0968", False, None),
        ("1_000", False, None),
    ],
)
def test_a_field_is_a_number_or_none(cell, comma, value):
    assert number(cell, comma) == value


def test_a_time_stamp_has_ascii_figures():
    assert is_stamp("12:00:00.020") and is_stamp("2024-05-01\u00a012:00:00")
    assert not is_stamp("\uff11\uff12:00:00.020") and not is_stamp("\uff12\uff10\uff12\uff14-05-01 12:00:00")


def test_a_long_field_is_looked_at_once():
    # Its time grows with its length, not with the square of it.
    assert number("1" * 100_000 + "x", False) is None


def written(tmp_path: Path, lines: list[str]) -> Path:
    file = tmp_path / "log.csv"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


def thousands(value: str, comma: bool) -> str:
    """A number with its thousands apart."""
    text = f"{float(value):,.4f}"
    return text.translate(str.maketrans(",.", ".,")) if comma else text


@pytest.mark.parametrize(("delimiter", "comma"), [(";", False), (";", True), ("\t", False), (",", False), (",", True)])
def test_thousands_are_read(tmp_path, delimiter, comma):
    lines = []
    for t, v, r in (line.split(",") for line in rows(fields="{t:.3f},{v:.6f},{r:.8f}")):
        cells = [thousands(str(float(t) + 1000), comma), thousands(str(100 * float(v)), comma)]
        cells.append(r.replace(".", ",") if comma else r)
        lines.append(delimiter.join(f'"{cell}"' if delimiter == "," else cell for cell in cells))
    file = written(tmp_path, [delimiter.join("tvr"), *lines])
    columns = imported(
        file, mapping(tmp_path, PLAIN.replace('unit = "km/h"', 'unit = "km/h"\nfactor = 0.01')), tmp_path
    )
    assert len(columns["time"]) == 300 and np.allclose(np.diff(columns["time"]), 0.01)
    close(columns, vx=VX)


def test_a_point_among_decimal_commas_may_be_one_of_thousands(tmp_path):
    lines = [line.replace(".", ",") for line in rows(2000, "{t:.3f};{v:.6f};{r:.8f}")]
    for place in range(1500, 1600):
        t, _, r = lines[place].split(";")
        lines[place] = f"{t};1.234;{r}"
    with pytest.raises(ImportFailed, match=r"'1\.234' in line 1502 is no number"):
        convert(written(tmp_path, ["t;v;r", *lines]), mapping(tmp_path, PLAIN), tmp_path / "out.csv")


def test_the_column_with_points_is_blamed_where_the_others_have_decimal_commas(tmp_path):
    lines = [line.replace(".", ",") for line in rows(200, "{v:.6f};{r:.8f}")]
    lines = [f"{10 * place:,};".replace(",", ".") + line for place, line in enumerate(lines)]
    with pytest.raises(
        ImportFailed, match=r"\[time\] column = 't': '1\.000' in line 102 .* may be decimal or part thous"
    ):
        convert(written(tmp_path, ["t;v;r", *lines]), mapping(tmp_path, PLAIN), tmp_path / "out.csv")


def test_figures_of_other_scripts_are_no_numbers(tmp_path):
    wide = str.maketrans({str(figure): chr(0xFF10 + figure) for figure in range(10)})
    lines = []
    for line in rows():
        t, v, r = line.split(",")
        lines.append(f"{t},{v.translate(wide)},{r}")
    first = "43.200000".translate(wide)
    with pytest.raises(ImportFailed, match=f"'{first}' in line 2 is no number"):
        convert(written(tmp_path, ["t,v,r", *lines]), mapping(tmp_path, PLAIN), tmp_path / "out.csv")
