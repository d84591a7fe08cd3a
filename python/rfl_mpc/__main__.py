"""``python -m rfl_mpc`` is the program ``rfl``."""

import sys

from rfl_mpc.program import main

sys.exit(main())
