"""The blind check: drives of vehicles that the diagnosis does not model, with effects that it is not told of.

Nothing here uses the project's plants: the generator has its own physics, driver, roads, actuators and sensors. See
README.md in this folder.
"""

import hashlib
import os
from pathlib import Path

# numba looks at a function's own file only to see whether its cached code is stale; compiled code here calls across
# files.
_HERE = Path(__file__).resolve().parent
_COMPILED = ("car.py", "truck.py", "truck_equations.py", "drive.py")
_HASH = hashlib.sha256(b"".join((_HERE / name).read_bytes() for name in _COMPILED if (_HERE / name).exists()))
os.environ.setdefault("NUMBA_CACHE_DIR", str(_HERE / "__pycache__" / f"numba-{_HASH.hexdigest()[:16]}"))
