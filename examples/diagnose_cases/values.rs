//! Moderate and small values of each effect, as logs are made with.

/// Moderate and small values.
pub const VALUES: &[(&str, f64, f64)] = &[
    ("steer_delay", 0.10, 0.04),
    ("steer_lag", 0.15, 0.05),
    ("steer_rate_limit", 0.08, 0.15),
    ("steer_backlash", 0.02, 0.008),
    ("steer_offset", 0.017, 0.006),
    ("steer_gain", 1.12, 1.04),
    ("tyre_stiffness_front", 0.75, 0.88),
    ("tyre_stiffness_rear", 0.75, 0.88),
    ("road_friction", 0.55, 0.75),
    ("tyre_relaxation", 1.5, 0.9),
    ("payload", 400.0, 180.0),
    ("cg_shift", -0.15, -0.06),
    ("yaw_inertia", 1.4, 1.2),
    ("roll_stiffness", 0.6, 0.8),
    ("road_bank", 0.05, 0.02),
    ("road_grade", 0.05, 0.02),
    ("wind_x", 12.0, 6.0),
    ("wind_y", 12.0, 6.0),
    ("drag", 3.0, 1.6),
    ("drive_lag", 0.4, 0.15),
    ("drive_gain", 0.8, 0.92),
    ("brake_pull", 900.0, 350.0),
    ("yaw_rate_bias", 0.02, 0.006),
    ("lateral_accel_bias", 0.5, 0.15),
    ("sensor_delay", 0.10, 0.04),
    ("speed_scale", 1.06, 1.02),
    ("imu_lever_arm", 1.0, 0.4),
    ("heading_misalignment", 0.04, 0.012),
    ("trailer_payload", 6000.0, 2500.0),
    ("trailer_stiffness", 0.7, 0.85),
    ("hitch_offset", 0.4, 0.15),
    ("articulation_friction", 15000.0, 6000.0),
    ("articulation_bias", 0.03, 0.01),
];

/// A value for a truck: what goes with its mass is more there.
pub fn of_truck(id: &str, value: f64) -> f64 {
    match id {
        "payload" => 5.0 * value,
        "brake_pull" => 8.0 * value,
        _ => value,
    }
}
