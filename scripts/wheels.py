"""Wheels of the Python package, built by maturin and looked into: what each holds, exports and needs.

A wheel carries the FMUs of target/fmu (built by scripts/build-fmus; `--fmus` names another folder), the vehicles, the
roads and the licences of what is linked in. Linux wheels run on glibc 2.17 and later, and are linked by zig, those for
macOS by Rust's lld; those for Windows by mingw-w64. Another platform's compiler comes from `rustup target add`.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))
import darwin_sdk  # noqa: E402
import programs  # noqa: E402 (built as the tests build them)

DATA = ROOT / "python" / "rfl_mpc" / "data"
# Files of a wheel whose time is not told are of this second: the same bits at any time.
EPOCH = "1767225600"


@dataclass(frozen=True)
class Platform:
    """A platform that wheels are built for."""

    triple: str
    """Rust's name of it."""
    targets: tuple[str, ...]
    """What `rustup target add` has to have brought."""
    options: tuple[str, ...]
    tag: str
    """The platform in the wheel's name."""
    library: str


PLATFORMS = {
    "linux-x86_64": Platform(
        "x86_64-unknown-linux-gnu",
        ("x86_64-unknown-linux-gnu",),
        ("--zig", "--compatibility", "manylinux2014"),
        "manylinux_2_17_x86_64",
        "_native.abi3.so",
    ),
    "linux-aarch64": Platform(
        "aarch64-unknown-linux-gnu",
        ("aarch64-unknown-linux-gnu",),
        ("--zig", "--compatibility", "manylinux2014"),
        "manylinux_2_17_aarch64",
        "_native.abi3.so",
    ),
    "windows-x86_64": Platform("x86_64-pc-windows-gnu", ("x86_64-pc-windows-gnu",), (), "win_amd64", "_native.pyd"),
    "macos-universal2": Platform(
        "universal2-apple-darwin",
        ("x86_64-apple-darwin", "aarch64-apple-darwin"),
        (),
        "universal2",
        "_native.abi3.so",
    ),
}


class WheelError(Exception):
    """A wheel that cannot be built, or is not what it should be."""


def run(command: list[str], **environment: str) -> str:
    """Runs a command of the project; what it writes to standard output."""
    done = subprocess.run(
        command, cwd=ROOT, env=os.environ | environment, stdout=subprocess.PIPE, text=True, check=False
    )
    if done.returncode != 0:
        raise WheelError(f"`{' '.join(command)}` failed; its messages stand above")
    return done.stdout


def stage(fmus: Path) -> None:
    """Lays what the wheels carry into the package's folder."""
    if not (fmus / "RflMpc.fmu").is_file():
        raise WheelError(f"there are no FMUs in {fmus}: run scripts/build-fmus, or name their folder with --fmus")
    shutil.rmtree(DATA, ignore_errors=True)
    for folder in ("", "fmi3"):
        (DATA / "fmu" / folder).mkdir(parents=True)
        for file in sorted([*(fmus / folder).glob("*.fmu"), *(fmus / folder).glob("*.ssp")]):
            shutil.copy(file, DATA / "fmu" / folder)
    for name in ("vehicles", "paths"):
        shutil.copytree(ROOT / name, DATA / name)
    run([str(programs.program("fmu-build")), "--licenses", "rfl-mpc-python", "--out", str(DATA / "licenses")])


def flags() -> str:
    """Compiler flags that take this machine's folders out of the library."""
    cargo = Path(os.environ.get("CARGO_HOME", Path.home() / ".cargo")) / "registry" / "src"
    given = os.environ.get("RUSTFLAGS", "").split()
    return "\x1f".join([*given, f"--remap-path-prefix={cargo}=crates", f"--remap-path-prefix={ROOT}=rfl-mpc"])


def build(platform: Platform, out: Path) -> Path:
    """Builds a platform's wheel."""
    installed = run(["rustup", "target", "list", "--installed"]).split()
    if missing := [target for target in platform.targets if target not in installed]:
        raise WheelError(f"its compiler is missing: rustup target add {' '.join(missing)}")
    if platform.triple.endswith("windows-gnu") and shutil.which("x86_64-w64-mingw32-gcc") is None:
        raise WheelError("mingw-w64 is missing: sudo apt-get install gcc-mingw-w64-x86-64")
    fresh = ROOT / "target" / "wheels" / platform.triple
    shutil.rmtree(fresh, ignore_errors=True)
    zig = ROOT / "target" / "zig"
    environment = {
        "CARGO_ENCODED_RUSTFLAGS": flags(),
        "SOURCE_DATE_EPOCH": os.environ.get("SOURCE_DATE_EPOCH", EPOCH),
        "CARGO_ZIGBUILD_CACHE_DIR": str(zig / "links"),
        "ZIG_GLOBAL_CACHE_DIR": str(zig),
    }
    if "apple" in platform.triple:
        sdk = darwin_sdk.stage(ROOT / "target" / "darwin-sdk")
        environment |= {"SDKROOT": os.environ.get("SDKROOT", str(sdk))}
        environment |= {
            f"CARGO_TARGET_{target.replace('-', '_').upper()}_LINKER": str(darwin_sdk.linker(sdk))
            for target in platform.targets
        }
        environment["CARGO_ENCODED_RUSTFLAGS"] += "\x1f-Clinker-flavor=ld64.lld"
    command = ["maturin", "build", "-m", "python/Cargo.toml", "--profile", "wheel", "--target", platform.triple]
    run([*command, *platform.options, "-o", str(fresh)], **environment)
    made = list(fresh.glob("*.whl"))
    if len(made) != 1:
        raise WheelError(f"maturin made {len(made)} wheels in {fresh}")
    out.mkdir(parents=True, exist_ok=True)
    return Path(shutil.copy(made[0], out))


def contents(wheel: Path) -> set[str]:
    """Files of a wheel, the library and what names the platform left out."""
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if not name.endswith("/")}
    return {name for name in names if "/_native." not in name or name.endswith(".pyi")}


def look_into(wheel: Path, platform: Platform) -> str:
    """Checks a wheel's tag, its contents and its library; what it needs, in a line."""
    import lief

    if "-cp310-abi3-" not in wheel.name or platform.tag not in wheel.name:
        raise WheelError(f"{wheel.name}: its tag is not that of {platform.tag}")
    wanted = {f"rfl_mpc/{name}" for name in ("__init__.py", "py.typed", "_native.pyi", "program.py", platform.library)}
    names = ("PassengerCar", "RflMpc", "SemiTrailerTruck", "TruckRflMpc")
    wanted |= {f"rfl_mpc/data/fmu/{folder}{name}.fmu" for folder in ("", "fmi3/") for name in names}
    wanted |= {"rfl_mpc/data/vehicles/c_class.toml", "rfl_mpc/data/paths/sudoku_test.csv"}
    with zipfile.ZipFile(wheel) as archive:
        if missing := wanted - set(archive.namelist()):
            raise WheelError(f"{wheel.name} lacks {', '.join(sorted(missing))}")
        data = archive.read(f"rfl_mpc/{platform.library}")
    for folder in (str(ROOT), str(Path.home() / ".cargo")):
        if folder.encode() in data:
            raise WheelError(f"{wheel.name}: the library names a folder of this machine, {folder}")
    exported, needs = library(lief, data)
    if exported != {"PyInit__native"}:
        raise WheelError(f"{wheel.name}: the library exports {sorted(exported)}, and PyInit__native is all it should")
    return f"{wheel.name}, {wheel.stat().st_size / 1e6:.1f} MB, needs {', '.join(sorted(needs))}"


def library(lief, data: bytes) -> tuple[set[str], set[str]]:
    """What a library exports, and the libraries that it needs; of a universal one all its parts."""
    if (fat := lief.MachO.parse(list(data))) is not None:
        parts = [fat.at(index) for index in range(fat.size)]
        exported = {symbol.name.removeprefix("_") for part in parts for symbol in part.exported_symbols}
        return exported, {needed.name for part in parts for needed in part.libraries}
    binary = lief.parse(list(data))
    if isinstance(binary, lief.PE.Binary):
        exports = binary.get_export()
        return {entry.name for entry in exports.entries}, {needed.name for needed in binary.imports}
    return {symbol.name for symbol in binary.exported_symbols}, set(binary.libraries)


def check_tools(wheels: Iterable[Path]) -> None:
    """The checkers of others, where they are installed."""
    for wheel in wheels:
        for command in (["abi3audit", "--strict"], ["auditwheel", "show"]):
            if command[0] == "auditwheel" and "manylinux" not in wheel.name:
                continue
            if shutil.which(command[0]) is None:
                print(f"  {command[0]} is not installed: not run", file=sys.stderr)
                continue
            done = subprocess.run([*command, str(wheel)], capture_output=True, text=True, check=False)
            if done.returncode != 0:
                raise WheelError(f"{command[0]} on {wheel.name}: {done.stdout}{done.stderr}")
            print(f"  {command[0]}: {' '.join(done.stdout.split())[:200] or 'nothing found'}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("platforms", nargs="*", help=f"{', '.join(PLATFORMS)}, or all [default: linux-x86_64]")
    parser.add_argument(
        "--fmus", type=Path, help="folder of the FMUs to carry [default: target/fmu, built by scripts/build-fmus first]"
    )
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder for the wheels")
    parser.add_argument("--check", action="store_true", help="build nothing: look into the wheels that are there")
    arguments = parser.parse_args()
    named = list(PLATFORMS) if arguments.platforms == ["all"] else arguments.platforms or ["linux-x86_64"]
    if unknown := set(named) - set(PLATFORMS):
        parser.error(f"unknown platform {', '.join(sorted(unknown))}; there are {', '.join(PLATFORMS)}, all")
    failed, wheels = [], {}
    try:
        if not arguments.check:
            if arguments.fmus is None:
                # Those that are there may be of this machine alone (scripts/demo), or of another version.
                run([str(ROOT / "scripts" / "build-fmus")])
            stage(arguments.fmus or ROOT / "target" / "fmu")
    except WheelError as error:
        print(f"wheels: {error}", file=sys.stderr)
        return 1
    for name in named:
        platform = PLATFORMS[name]
        try:
            if arguments.check:
                found = [file for file in sorted(arguments.out.glob("*.whl")) if platform.tag in file.name]
                if not found:
                    raise WheelError(f"there is no wheel in {arguments.out}")
                wheel = found[-1]
            else:
                wheel = build(platform, arguments.out)
            print(look_into(wheel, platform))
            wheels[name] = wheel
        except WheelError as error:
            print(f"wheels: {name}: {error}", file=sys.stderr)
            failed.append(name)
    try:
        check_tools(wheels.values())
        held = {name: contents(wheel) for name, wheel in wheels.items()}
        for name in list(held)[1:]:
            first = next(iter(held))
            if other := {one for one in held[first] ^ held[name] if ".dist-info/" not in one}:
                raise WheelError(f"{first} and {name} do not hold the same: {', '.join(sorted(other))}")
    except WheelError as error:
        print(f"wheels: {error}", file=sys.stderr)
        return 1
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
