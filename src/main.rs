//! The program `rfl`; see `rfl --help`.

fn main() -> std::process::ExitCode {
    rfl_mpc::cli::main()
}
