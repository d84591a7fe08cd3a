//! `rfl completions`: scripts with which a shell completes commands and options.

use super::Cli;
use clap::{Args, CommandFactory};
use clap_complete::Shell;
use std::error::Error;
use std::io::Write;

/// Prints a completion script for a shell
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  rfl completions bash > ~/.local/share/bash-completion/completions/rfl
  rfl completions zsh > ~/.zfunc/_rfl           with ~/.zfunc in fpath
  rfl completions fish > ~/.config/fish/completions/rfl.fish")]
pub struct CompletionsArgs {
    /// The shell
    shell: Shell,
}

/// Runs the command.
///
/// # Errors
/// Standard output that cannot be written.
pub fn run(args: &CompletionsArgs) -> Result<(), Box<dyn Error>> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "rfl", &mut script);
    Ok(std::io::stdout().write_all(&script)?)
}
