"""The program ``rfl``, as the package installs it."""

from __future__ import annotations

import signal
import sys

from rfl_mpc import _native


def main() -> int:
    """Runs the command line; gives the exit status."""
    if sys.argv[1:2] == ["fleet"]:
        from rfl_mpc.fleet.command import main as fleet

        return fleet(sys.argv[2:])
    if sys.argv[1:2] == ["evaluate"] and any(word.split("=")[0] == "--dask" for word in sys.argv):
        try:
            from rfl_mpc.fleet.evaluate import main as evaluate

            return evaluate(sys.argv[2:])
        except ImportError as error:
            print(f"error: {error.name} is missing: pip install 'rfl-mpc[fleet]'", file=sys.stderr)
            return 1
    # Ctrl-C ends the program at once, as it does outside Python.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _native.program(["rfl", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
