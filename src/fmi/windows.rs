//! A library's own function in the place of one of Windows.
//!
//! Rust's hash maps ask `ProcessPrng` of `bcryptprimitives.dll` for a random seed, which Windows before 10 and wine before 9
//! lack: a library that imports it is not loaded there. Nothing of an FMU needs that seed; a solver's maps of names are all that
//! ask. Defined in the library itself, the name is not imported.

/// The seed of hash maps, not random: zeros.
///
/// # Safety
/// `place` is valid for writes of `count` bytes.
pub unsafe extern "system" fn no_random_seed(place: *mut u8, count: usize) -> i32 {
    // SAFETY: by the caller's contract.
    unsafe { place.write_bytes(0, count) };
    1
}
