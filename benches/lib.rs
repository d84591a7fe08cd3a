//! Benchmarks of `rfl_mpc`, a package of their own: `cargo bench --bench NAME`.
