//! The command-line program; everything it does is in the library.

use std::process::ExitCode;

/// A diagnosis allocates and frees megabytes at a time; the system's allocator returns them to the kernel each time.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    coilwright::cli::run()
}
