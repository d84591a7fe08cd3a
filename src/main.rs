//! The program `rfl`; see `rfl --help`.

fn main() -> std::process::ExitCode {
    rfl_mpc::cli::main(std::env::args_os()).into()
}
