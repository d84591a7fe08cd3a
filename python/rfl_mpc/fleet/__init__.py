"""A fleet's drives: what differs in which vehicle from its sisters, and since when.

Each drive is diagnosed (on Dask: here or on a cluster); its report's summary is a Gaussian likelihood of all
parameters, and these are joined: over the drives of a vehicle, and over the vehicles of a type.

=================  =======================================================================
``manifest.py``    which drives there are
``store.py``       what is done already
``child.py``       a process that diagnoses
``work.py``        a drive in a worker, with a time limit
``engine.py``      the drives on Dask
``summary.py``     summaries as arrays
``hierarchy.py``   how parameters are spread over types, vehicles and drives
``changes.py``     what changed in a vehicle, since which drive
``findings.py``    faults of logs by their kinds
``reduce.py``      from summaries to types and vehicles; what is said
``tables.py``      the Parquet files
``page.py``        the page
``command.py``     the command ``rfl fleet``
``evaluate.py``    ``rfl evaluate`` on Dask
=================  =======================================================================

>>> from rfl_mpc import fleet
>>> found = fleet.run("logs/", out="fleet")  # doctest: +SKIP
>>> found.vehicles  # doctest: +SKIP
"""

from __future__ import annotations

from rfl_mpc.fleet.run import Fleet, run

__all__ = ["Fleet", "run"]
