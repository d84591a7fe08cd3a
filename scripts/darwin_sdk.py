"""What a library for macOS is linked against on another system: the stub of the system library that zig brings.

Rust's own linker (lld) links for macOS and exports no more than it is told, as zig's does not; it lacks the stub. That
names processors that lld does not know yet; they are left out.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

# As the compiler asks for it: the C library and the mathematical one are parts of it.
NAMES = ("System", "c", "m", "iconv")


def stage(folder: Path) -> Path:
    """Lays the stub into a folder, as an SDK has it; SDKROOT names the folder to the compiler."""
    try:
        import ziglang
    except ImportError:
        raise SystemExit("darwin_sdk: the package ziglang is missing: run scripts/setup, or set SDKROOT") from None
    stub = Path(ziglang.__file__).parent / "lib" / "libc" / "darwin" / "libSystem.tbd"
    unknown = r"arm64e\.x1-\w+"
    text = re.sub(rf",\s*{unknown}|{unknown},\s*", "", stub.read_text(encoding="utf-8"))
    libraries = folder / "usr" / "lib"
    libraries.mkdir(parents=True, exist_ok=True)
    for name in NAMES:
        (libraries / f"lib{name}.tbd").write_text(text, encoding="utf-8")
    return folder


def linker(folder: Path) -> Path:
    """lld for who calls it as a C compiler's driver is called (`-Wl,A,B` for `A B`), as maturin does."""
    sysroot = subprocess.run(["rustc", "--print", "sysroot"], capture_output=True, text=True, check=True).stdout.strip()
    found = sorted(Path(sysroot).glob("lib/rustlib/*/bin/gcc-ld/ld64.lld"))
    if not found:
        raise SystemExit("darwin_sdk: this Rust brings no lld: install it by rustup")
    script = folder / "ld64.lld"
    # The flavour is in the linker's own name, and newer compilers give it once more.
    script.write_text(
        "#!/usr/bin/env bash\n"
        "arguments=()\n"
        "while [ $# -gt 0 ]; do\n"
        '  case "$1" in\n'
        "    -flavor) shift ;;\n"
        '    -Wl,*) IFS=, read -ra split <<<"${1#-Wl,}"; arguments+=("${split[@]}") ;;\n'
        '    *) arguments+=("$1") ;;\n'
        "  esac\n"
        "  shift\n"
        "done\n"
        f'exec "{found[0]}" "${{arguments[@]}}"\n',
        encoding="utf-8",
    )
    script.chmod(0o755)
    return script


if __name__ == "__main__":
    print(stage(Path(sys.argv[1])))
