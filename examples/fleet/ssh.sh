#!/bin/sh
# `rfl fleet` on machines that SSH reaches, with the same Python environment and the same files on each.
# sh ssh.sh drives.csv host1 host2 ...
set -eu
table=$1
shift
dask scheduler --port 8786 --no-dashboard &
scheduler=$!
trap 'kill $scheduler' EXIT
here=$(hostname -I | cut -d' ' -f1)
for host in "$@"; do
  # One worker a machine, a thread a processor: each thread has a child process that diagnoses.
  ssh "$host" "dask worker tcp://$here:8786 --nthreads \$(nproc) --no-nanny --no-dashboard" &
done
rfl fleet "$table" --dask "tcp://$here:8786" --out fleet
