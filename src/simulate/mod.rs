//! (module simulate)
