"""The results in docs/results, written from what `rfl evaluate` measured: one module for each kind of vehicle."""
