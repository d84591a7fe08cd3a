"""A release: what is built, whose work is inside, and its checksums.

    dist/fmu/*.fmu, *.ssp   libraries of all platforms named
    dist/*.whl              the Python package, with these FMUs
    dist/licenses/          ours, and those of what is linked in
    dist/sbom.cdx.json      bill of materials (CycloneDX)
    dist/SHA256SUMS         of all of it

The same sources and compilers give the same bits; `--again` builds all a second time, in other folders, and compares.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import uuid
from datetime import datetime, timezone
from pathlib import Path

import wheels
from wheels import PLATFORMS, ROOT, WheelError, run

FMU_PLATFORMS = {
    "linux64": "linux-x86_64",
    "win64": "windows-x86_64",
    "darwin64": "macos-universal2",
    "aarch64-linux": "linux-aarch64",
}


def version() -> str:
    """The project's version."""
    packages = json.loads(run(["cargo", "metadata", "--locked", "--no-deps", "--format-version", "1"]))["packages"]
    return next(package["version"] for package in packages if package["name"] == "rfl-mpc")


def bill(crates: list[dict], files: dict[str, str]) -> str:
    """The bill of materials: the project, what is linked into it, and the files with their hashes."""
    from cyclonedx.model import HashAlgorithm, HashType
    from cyclonedx.model.bom import Bom
    from cyclonedx.model.component import Component, ComponentType
    from cyclonedx.model.license import LicenseExpression
    from cyclonedx.output import make_outputter
    from cyclonedx.schema import OutputFormat, SchemaVersion
    from packageurl import PackageURL

    def reference(component: str) -> str:
        return f"pkg:cargo/{component}"

    whole = Component(
        name="rfl-mpc",
        version=version(),
        type=ComponentType.APPLICATION,
        bom_ref=reference(f"rfl-mpc@{version()}"),
        licenses=[LicenseExpression("Apache-2.0")],
    )
    bom = Bom()
    bom.metadata.component = whole
    epoch = int(os.environ.get("SOURCE_DATE_EPOCH", wheels.EPOCH))
    bom.metadata.timestamp = datetime.fromtimestamp(epoch, tz=timezone.utc)
    linked = []
    for crate in crates:
        # Older crates write `MIT/Apache-2.0`; a note beside the expression is no part of it.
        licence = crate["license"].split(";")[0].replace("/", " OR ")
        component = Component(
            name=crate["name"],
            version=crate["version"],
            type=ComponentType.LIBRARY,
            bom_ref=reference(f"{crate['name']}@{crate['version']}"),
            purl=PackageURL("cargo", None, crate["name"], crate["version"]),
            licenses=[LicenseExpression(licence)] if licence else [],
        )
        bom.components.add(component)
        linked.append(component)
    bom.register_dependency(whole, linked)
    for name, digest in files.items():
        bom.components.add(
            Component(
                name=name,
                type=ComponentType.FILE,
                bom_ref=f"file:{name}",
                hashes=[HashType(alg=HashAlgorithm.SHA_256, content=digest)],
            )
        )
    bom.serial_number = uuid.uuid5(uuid.NAMESPACE_URL, json.dumps([crates, files], sort_keys=True))
    return make_outputter(bom, OutputFormat.JSON, SchemaVersion.V1_6).output_as_string(indent=2) + "\n"


def digests(out: Path, suffixes: tuple[str, ...] | None = None) -> dict[str, str]:
    """SHA-256 of the files of a folder, by name."""
    files = sorted(file for file in out.rglob("*") if file.is_file() and (not suffixes or file.suffix in suffixes))
    return {file.relative_to(out).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def make(out: Path, fmu_platforms: list[str], wheel_platforms: list[str]) -> None:
    """Builds everything into a folder."""
    packer = str(wheels.programs.program("fmu-build"))
    run([packer, "--target", ",".join(fmu_platforms), "--out", str(out / "fmu")])
    wheels.stage(out / "fmu")
    for name in wheel_platforms:
        print(wheels.look_into(wheels.build(PLATFORMS[name], out), PLATFORMS[name]))
    licences = out / "licenses"
    shutil.copytree(wheels.DATA / "licenses", licences, dirs_exist_ok=True)
    crates = json.loads((licences / "crates.json").read_text(encoding="utf-8"))
    files = digests(out, (".fmu", ".ssp", ".whl"))
    (out / "sbom.cdx.json").write_text(bill(crates, files), encoding="utf-8")
    sums = "".join(f"{digest}  {name}\n" for name, digest in digests(out).items() if name != "SHA256SUMS")
    (out / "SHA256SUMS").write_text(sums, encoding="utf-8")


def again(out: Path, options: list[str]) -> None:
    """Builds all a second time, from a copy of the sources in another folder, and compares."""
    with tempfile.TemporaryDirectory(prefix="rfl-release-") as folder:
        copy = Path(folder) / "rfl-mpc"
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            cwd=ROOT,
            capture_output=True,
            check=True,
        )
        for name in filter(None, listed.stdout.decode().split("\0")):
            if (ROOT / name).exists():
                (copy / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / name, copy / name, follow_symlinks=False)
        (copy / ".venv").symlink_to(ROOT / ".venv")
        command = [sys.executable, str(copy / "scripts" / "release.py"), *options]
        if subprocess.run(command, cwd=copy, check=False).returncode != 0:
            raise WheelError("the second build failed; its messages stand above")
        first, second = digests(out), digests(copy / "dist")
        if other := sorted(name for name in first.keys() | second.keys() if first.get(name) != second.get(name)):
            kept = out.with_name("dist-again")
            shutil.rmtree(kept, ignore_errors=True)
            shutil.copytree(copy / "dist", kept)
            raise WheelError(f"the second build, which lies in {kept}, gave other bits: {', '.join(other)}")
        print(f"built twice, {len(first)} files, the same bits")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, known in {"fmus": FMU_PLATFORMS, "wheels": PLATFORMS}.items():
        listed = ",".join(known)
        parser.add_argument(f"--{name}", default=listed, metavar="PLATFORMS", help=f"of the {name} [default: {listed}]")
    parser.add_argument("--again", action="store_true", help="build all a second time, and compare")
    arguments = parser.parse_args()
    out = ROOT / "dist"
    fmus, platforms = arguments.fmus.split(","), [name for name in arguments.wheels.split(",") if name]
    if unknown := (set(fmus) - set(FMU_PLATFORMS)) | (set(platforms) - set(PLATFORMS)):
        known = ", ".join([*FMU_PLATFORMS, *PLATFORMS])
        parser.error(f"unknown platform {', '.join(sorted(unknown))}; there are {known}")
    shutil.rmtree(out, ignore_errors=True)
    try:
        make(out, fmus, platforms)
        if arguments.again:
            again(out, [f"--fmus={arguments.fmus}", f"--wheels={arguments.wheels}"])
    except WheelError as error:
        print(f"release: {error}", file=sys.stderr)
        return 1
    print(f"{out}: {len(digests(out))} files, checksums in SHA256SUMS")
    return 0


if __name__ == "__main__":
    sys.exit(main())
