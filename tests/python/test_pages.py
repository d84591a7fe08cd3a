"""The Python that pages print runs as printed; the notebooks run, with RFL_NOTEBOOKS=1."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "docs" / "python.md", ROOT / "python" / "README.md", ROOT / "docs" / "fleet.md"]
# Its example drives a whole road, and is diagnosed with all there is.
SLOW = [ROOT / "README.md"]
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("page", PAGES + SLOW, ids=lambda page: f"{page.parent.name}/{page.stem}")
def test_blocks_run_as_printed(rfl_mpc, page, tmp_path, monkeypatch):
    if page in SLOW and os.environ.get("RFL_DOCS") != "all":
        pytest.skip("takes a minute: RFL_DOCS=all runs it")
    if page.stem == "fleet":
        pytest.importorskip("distributed")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert blocks
    for block in blocks:
        exec(compile(block, str(page), "exec"), {"__name__": "block"})


def rows(page: Path, head: str) -> list[list[str]]:
    """Cells of the table below a head."""
    table = page.read_text(encoding="utf-8").split(head)[1].split("\n\n")[0].splitlines()[1:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table if line.startswith("|")]


def test_statuses_of_the_controller_are_listed_with_their_meaning():
    """As the FMU has them, whose description is made from the code."""
    text = (ROOT / "modelDescription" / "RflMpc.xml").read_text(encoding="utf-8")
    (of_status,) = [one for one in re.findall(r"<Enumeration.*?</Enumeration>", text, re.DOTALL) if "safe_hold" in one]
    items = re.findall(r'<Item name="(\w+)" value="\d+" description="([^"]+)"', of_status)
    assert rows(ROOT / "docs" / "python.md", "| `status` | meaning |\n|") == [
        [f"`{name}`", words] for name, words in items
    ]


def test_columns_of_the_vehicles_are_listed(rfl_mpc):
    tables = pytest.importorskip("rfl_mpc.fleet.tables")
    pytest.importorskip("pyarrow")
    page = ROOT / "docs" / "fleet.md"
    table = rows(page, "Columns of `vehicles.parquet`:\n\n| column | |\n|")
    assert re.findall(r"`(\w+)`", " ".join(name for name, _ in table)) == tables.change_schema().names


@pytest.mark.skipif(not os.environ.get("RFL_NOTEBOOKS"), reason="notebooks take minutes: RFL_NOTEBOOKS=1 runs them")
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda notebook: notebook.stem)
def test_notebooks_run(rfl_mpc, folder, notebook, tmp_path, monkeypatch):
    nbclient = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    monkeypatch.setenv("PYTHONPATH", str(folder or ""))
    read = nbformat.read(shutil.copy(notebook, tmp_path), as_version=4)
    client = nbclient.NotebookClient(read, timeout=1800, resources={"metadata": {"path": str(tmp_path)}})
    client.execute()
    # RFL_NOTEBOOKS=FOLDER keeps what they showed.
    keep = Path(os.environ["RFL_NOTEBOOKS"])
    if keep.is_dir():
        nbformat.write(read, keep / notebook.name)
