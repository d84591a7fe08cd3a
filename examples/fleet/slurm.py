"""`rfl fleet` on a SLURM cluster: pip install 'rfl-mpc[fleet]' dask-jobqueue; python slurm.py drives.csv

Start it where the job's nodes can reach it, a login node or an interactive job. Change the numbers to your cluster's.
"""

import sys

from dask_jobqueue import SLURMCluster
from rfl_mpc import fleet


def main() -> None:
    """Workers come and go with the work; what is done is kept."""
    cluster = SLURMCluster(
        queue="normal",
        account=None,
        cores=16,  # of a job; a drive takes one
        processes=1,  # threads do: each has a child process that diagnoses
        memory="16GB",
        walltime="04:00:00",
        python=sys.executable,  # the same environment, on a file system that all nodes see
    )
    cluster.adapt(minimum_jobs=1, maximum_jobs=20)
    print(fleet.run(sys.argv[1:], dask=cluster.scheduler_address, out="fleet", quiet=False))


if __name__ == "__main__":
    main()
