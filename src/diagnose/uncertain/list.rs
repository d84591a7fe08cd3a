//! The uncertain parameters of a vehicle on a drive, and their tolerances.

use super::parameter::{Transform, UncertainParameter};
use crate::diagnose::calibration::Calibration;
use crate::diagnose::form::FORMS;
use crate::diagnose::library::{Library, OwnEffect};
use crate::diagnose::replay::{Channel, ReplayDrive, ReplayVehicle};
use crate::vehicle::{TrailerEffects, TruckEffects};

type EffectRow = (&'static str, f64, f64, f64, f64, &'static [f64]);

/// Effects: id, unit of the coordinate, tolerance (both in the effect's unit), least and greatest coordinate, starts.
/// No wind is stronger than a gale, no tyre is three times as stiff as its file: a larger value is another effect.
const EFFECTS: &[EffectRow] = &[
    ("steer_delay", 0.02, 0.010, -10.0, 60.0, &[1.0, 4.0, 9.0]),
    ("steer_lag", 0.03, 0.010, -10.0, 60.0, &[1.0, 4.0, 9.0]),
    ("steer_rate_limit", 0.0, 0.0, 0.0, 60.0, &[1.2, 2.0, 4.0]),
    ("steer_backlash", 0.005, 0.0, 0.0, 60.0, &[0.5, 2.0, 6.0]),
    ("steer_offset", 0.005, 0.0017, -40.0, 60.0, &[0.0]),
    ("steer_gain", 0.05, 0.010, -10.0, 60.0, &[0.0]),
    ("tyre_stiffness_front", 0.1, 0.040, -7.0, 7.0, &[0.0]),
    ("tyre_stiffness_rear", 0.1, 0.040, -7.0, 7.0, &[0.0]),
    ("road_friction", 0.1, 0.040, -8.5, 4.0, &[0.0, -3.0, -5.5]),
    ("tyre_relaxation", 0.0, 0.25, -0.85, 60.0, &[0.0, 1.0, 4.0]),
    ("payload", 0.0, 0.0, 0.0, 60.0, &[1.0, 4.0]),
    ("payload_x", 0.5, 0.0, -20.0, 60.0, &[0.0]),
    ("cg_shift", 0.05, 0.020, -7.0, 7.0, &[0.0]),
    ("yaw_inertia", 0.1, 0.050, -7.0, 10.0, &[0.0]),
    ("roll_stiffness", 0.1, 0.070, -7.0, 60.0, &[0.0]),
    ("road_bank", 0.01, 0.0044, -30.0, 60.0, &[0.0]),
    ("road_grade", 0.01, 0.0044, -30.0, 60.0, &[0.0]),
    ("wind_x", 3.0, 0.7, -7.0, 7.0, &[0.0, 2.5, -2.5]),
    ("wind_y", 3.0, 0.7, -7.0, 7.0, &[0.0, 2.5, -2.5]),
    ("drag", 0.2, 0.10, -5.0, 60.0, &[0.0]),
    ("drive_lag", 0.05, 0.030, -10.0, 60.0, &[1.0, 4.0]),
    ("drive_gain", 0.05, 0.020, -15.0, 60.0, &[0.0]),
    ("brake_pull", 0.0, 0.1, -30.0, 60.0, &[0.0]),
    ("yaw_rate_bias", 0.005, 0.0012, -40.0, 60.0, &[0.0]),
    ("lateral_accel_bias", 0.1, 0.030, -30.0, 60.0, &[0.0]),
    ("sensor_delay", 0.02, 0.005, -10.0, 60.0, &[1.0, 4.0]),
    ("speed_scale", 0.02, 0.005, -20.0, 60.0, &[0.0]),
    ("imu_lever_arm", 0.2, 0.050, -20.0, 60.0, &[0.0]),
    ("heading_misalignment", 0.01, 0.003, -40.0, 60.0, &[0.0]),
    ("trailer_payload", 0.0, 0.0, 0.0, 60.0, &[1.0, 4.0]),
    ("trailer_stiffness", 0.1, 0.040, -7.0, 7.0, &[0.0]),
    ("hitch_offset", 0.05, 0.020, -15.0, 60.0, &[0.0]),
    ("articulation_friction", 2000.0, 300.0, 0.0, 60.0, &[1.0, 4.0]),
    ("articulation_bias", 0.005, 0.002, -40.0, 60.0, &[0.0]),
];

/// Numbers of the vehicle: name in cars, in trucks; tolerance as a factor, or as a shift.
const PARAMETERS: &[(&str, &str, f64, bool)] = &[
    ("vehicle.mass", "tractor.mass", 0.03, true),
    ("", "trailer.mass", 0.03, true),
    ("", "trailer.yaw_inertia", 0.05, true),
    ("vehicle.cg_height", "tractor.cg_height", 0.05, true),
    ("tyre.rear.friction_scale", "tyre.rear.friction_scale", 0.03, true),
    // Few files have it measured, and the vehicle has no steer by lateral force of its own: 0.05 degrees for each kN, some 0.15
    // degrees at 4 m/s2 and 2 degrees of roll, act like 0.07 of roll steer (both in Gillespie, Fundamentals of Vehicle
    // Dynamics, 1992, ch. 6).
    ("axle.front.roll_steer", "axle.front.roll_steer", 0.05, false),
    ("axle.rear.roll_steer", "axle.rear.roll_steer", 0.05, false),
    ("axle.front.spring_rate", "", 0.10, true),
    // A tractor's frame twists: its torsional stiffness is that of an axle in roll, some 600 kN m/rad, so that the front
    // axle's share of the roll moment is not that of the springs (Sampson, Active Roll Control of Articulated Heavy
    // Vehicles, Cambridge 2000, appendix).
    ("", "axle.front.spring_rate", 0.25, true),
];

/// Masses of a car, of a tractor, of its trailer, and the effects that load them.
pub const LOADED: [(&str, &str); 3] =
    [("vehicle.mass", "payload"), ("tractor.mass", "payload"), ("trailer.mass", "trailer_payload")];

/// Sensors: name, channel, tolerance, and true for a scale.
const SENSORS: &[(&str, Channel, f64, bool)] = &[
    ("sensor.yaw_rate_scale", Channel::YawRate, 0.004, true),
    ("sensor.ay_scale", Channel::Ay, 0.008, true),
    ("sensor.ax_bias", Channel::Ax, 0.05, false),
    ("sensor.roll_bias", Channel::Roll, 0.003, false),
];

/// Channels that pass the low pass of the inertial sensors, and the tolerance of its lateness, s: of second order at 20
/// to 40 Hz. Place, speed and heading do not pass it, so it is no `sensor_delay`.
pub(super) const INERTIAL: [Channel; 3] = [Channel::YawRate, Channel::Ay, Channel::Ax];
const INERTIAL_LAG: f64 = 0.010;

/// Tolerance of the lateness of a satellite receiver or navigation unit, which has a clock and a latency of its own, s.
const RECEIVER_LATE: f64 = 0.05;

/// Tolerances of the height of the accelerometer in the body, and in a navigation unit, m. At `z` over the CG it feels
/// `-z` times the roll acceleration besides. No vehicle file holds that height; a navigation unit measures at a point
/// of its user's choice, which may lie on the road.
const IMU_HEIGHT: f64 = 0.15;
const UNIT_HEIGHT: f64 = 0.5;
/// Tolerance of the height at which a sideways velocity and a place are given, m: the body's CG, or the road's point
/// below.
const REFERENCE_HEIGHT: f64 = 0.3;

/// Bound of coordinates that are no effects: six standard deviations of the widest prior. A fit that went further was
/// lost, in a minimum of its own with a spring eleven times as stiff.
const FARTHEST: f64 = 12.0;
const REFERENCE_X: &str = "sensor.reference_x";
const REFERENCE_Z: &str = "sensor.reference_z";
const FILTERED: &str = "sensor.inertial_lag";
const RECEIVER: &str = "sensor.receiver_late";
const HEIGHT: &str = "sensor.imu_height";
const OTHER_SENSORS: [&str; 5] = [REFERENCE_X, REFERENCE_Z, FILTERED, RECEIVER, HEIGHT];
const TYRE_SHAPE: &str = "form.tyre.shape";
const TYRE_CURVATURE: &str = "form.tyre.curvature";
const TYRE_PEAK: &str = "form.tyre.peak";
const TYRE_SOFTENING: &str = "form.tyre.softening";
pub(super) const TYRE_LOAD: &str = "form.tyre.load";

/// Standard deviation of the payload's place when a payload is fitted, in units of its coordinate (0.5 m).
const PAYLOAD_PLACE: f64 = 1.6;
/// Deviation of the wind's other component where no heading separates the two, in units of its coordinate (3 m/s).
const WIND_ACROSS: f64 = 3.0;
/// Share of the vehicle's mass that is one unit of payload.
const PAYLOAD_UNIT: f64 = 0.05;

/// Effects between command and wheel angle: none of them is seen where no command was logged.
const BEFORE_THE_ANGLE: [&str; 4] = ["steer_delay", "steer_lag", "steer_rate_limit", "steer_backlash"];

/// All uncertain parameters of a vehicle on a drive; `library`: what may be named. What is left out stays within its tolerance: a
/// road has a little bank even if the library has no bank.
#[must_use]
pub fn uncertain_parameters<V: ReplayVehicle>(
    vehicle: &V,
    drive: &ReplayDrive,
    library: Library<'_>,
) -> Vec<UncertainParameter> {
    let effects = EFFECTS.iter().filter_map(|row| of_effect(row, vehicle, drive, library));
    let own = library.own.iter().enumerate().map(|(place, own)| of_own(place, own.as_ref(), library));
    let mut uncertain: Vec<_> = effects.chain(own).chain(of_file::<V>()).collect();
    uncertain.extend(of_mounting(drive));
    uncertain.extend(of_form::<V>(drive));
    uncertain.extend(of_sensors(drive));
    as_the_file_says(&mut uncertain, vehicle);
    uncertain
}

/// An effect of the library; none where it cannot act or cannot be seen.
fn of_effect<V: ReplayVehicle>(
    &(id, unit, tolerance, least, most, starts): &EffectRow,
    vehicle: &V,
    drive: &ReplayDrive,
    library: Library<'_>,
) -> Option<UncertainParameter> {
    let effect = TruckEffects::all().find(|effect| effect.id == id)?;
    let of_trailer = TrailerEffects::find(id).is_some();
    let unseen = !drive.commanded && BEFORE_THE_ANGLE.contains(&id);
    if of_trailer && !V::TRUCK || unseen {
        return None;
    }
    let (mass, _) = vehicle.mass_and_drag();
    let (turns, unit, tolerance) = match id {
        "steer_rate_limit" => (Transform::RateLimit, quickest(drive), 0.0),
        // A quarter, and no less than 8 cm: files without a relaxation length know nothing of it.
        "tyre_relaxation" => {
            let length = vehicle.relaxation();
            (Transform::Relaxation, length, f64::max(tolerance, 0.08 / length))
        }
        "payload" | "trailer_payload" => (Transform::Effect, PAYLOAD_UNIT * mass, 0.0),
        // As much as one wheel's rolling resistance; a dragging brake gives many times of it.
        "brake_pull" => (Transform::Effect, 0.03 * mass, tolerance),
        _ => (Transform::Effect, unit, tolerance / unit),
    };
    // A load lies on the vehicle: no farther from the unladen CG than what is steered is long.
    let reach = vehicle.reach() / unit;
    let (least, most) = if id == "payload_x" { (-reach, reach) } else { (least, most) };
    let [low, high] = [effect.range.0, effect.range.1].map(|end| (end - effect.neutral) / unit);
    // Against a measured angle only the difference of the clocks is seen: the angle may be the late one.
    let either_way = id == "sensor_delay" && !drive.commanded;
    let plain = matches!(turns, Transform::Effect);
    // The file's own delay may be too long, though none is negative.
    let of_time = matches!(id, "steer_delay" | "sensor_delay" | "steer_lag" | "drive_lag");
    let least = if plain && !of_time { least.max(low) } else { least };
    // Without a compass the wind is one cause: how strong, and from where by the heading at the log's start.
    let any_wind = !drive.compass && id == "wind_x";
    let companion = match id {
        "payload" => Some(("payload_x", PAYLOAD_PLACE)),
        "wind_x" if any_wind => Some(("wind_y", WIND_ACROSS)),
        _ => None,
    };
    let accompanies = id == "payload_x" || !drive.compass && id == "wind_y";
    Some(UncertainParameter {
        id,
        turns,
        unit,
        tolerance,
        least,
        named_least: if plain && !either_way { least.max(low) } else { least },
        greatest: if plain { high.min(most) } else { most },
        starts: if either_way { &[1.0, 4.0, -4.0] } else { starts },
        effect: Some(effect),
        companion,
        nameable: !(accompanies || library.leaves_out(id) || any_wind && library.leaves_out("wind_y")),
    })
}

/// An effect of one's own.
fn of_own(place: usize, own: &dyn OwnEffect, library: Library<'_>) -> UncertainParameter {
    let (effect, unit) = (own.declaration(), own.clear());
    let [low, high] = [effect.range.0, effect.range.1].map(|end| (end - effect.neutral) / unit);
    UncertainParameter {
        id: effect.id,
        turns: Transform::Own(place),
        unit,
        tolerance: own.tolerance() / unit,
        least: low.min(high),
        named_least: low.min(high),
        greatest: low.max(high),
        starts: own.starts(),
        effect: Some(effect),
        companion: None,
        nameable: !library.leaves_out(effect.id),
    }
}

/// A parameter that is no effect; its unit is its tolerance.
fn further(id: &'static str, turns: Transform, unit: f64) -> UncertainParameter {
    UncertainParameter {
        id,
        turns,
        unit,
        tolerance: 1.0,
        least: -FARTHEST,
        named_least: -FARTHEST,
        greatest: FARTHEST,
        starts: &[],
        effect: None,
        companion: None,
        nameable: false,
    }
}

/// Numbers of the vehicle file.
fn of_file<V: ReplayVehicle>() -> impl Iterator<Item = UncertainParameter> {
    PARAMETERS.iter().filter_map(|&(car, truck, tolerance, factor)| {
        let id = if V::TRUCK { truck } else { car };
        let turns = if factor { Transform::Factor } else { Transform::Shift };
        (!id.is_empty()).then(|| further(id, turns, tolerance))
    })
}

/// Places and clocks of the sensors.
fn of_mounting(drive: &ReplayDrive) -> impl Iterator<Item = UncertainParameter> {
    let has = |channel: &Channel| drive.channels.contains(channel);
    let inertial = INERTIAL.iter().any(has);
    // Where all that is compared comes by the receiver, its lateness is that of the sensors.
    let by_receiver = inertial && drive.channels.iter().any(|channel| channel.by_receiver());
    let sideways = [Channel::Vy, Channel::Across].iter().any(has);
    [
        (has(&Channel::Vy), REFERENCE_X, Transform::Arm, 0.05),
        (sideways, REFERENCE_Z, Transform::ReferenceHeight, REFERENCE_HEIGHT),
        (inertial, FILTERED, Transform::InertialLag, INERTIAL_LAG),
        (by_receiver, RECEIVER, Transform::ReceiverLate, RECEIVER_LATE),
        (has(&Channel::Ay), HEIGHT, Transform::ImuHeight, IMU_HEIGHT),
    ]
    .into_iter()
    .filter(|(there, ..)| *there)
    .map(|(_, id, turns, tolerance)| further(id, turns, tolerance))
}

/// Errors of the model's form: those of the tyres' curve, and those that are added to signals.
fn of_form<V: ReplayVehicle>(drive: &ReplayDrive) -> impl Iterator<Item = UncertainParameter> {
    let form = &Calibration::built_in().form;
    let [shape, curvature, peak, softening, load] = form.tyre(V::TRUCK);
    let of_tyres = [
        (TYRE_SHAPE, Transform::TyreShape, shape),
        (TYRE_CURVATURE, Transform::TyreCurvature, curvature),
        (TYRE_PEAK, Transform::TyrePeak, peak),
        (TYRE_SOFTENING, Transform::TyreSoftening, softening),
        (TYRE_LOAD, Transform::TyreLoad, load),
    ];
    let of_signals = FORMS.iter().enumerate().filter_map(|(place, (id, channel, kind))| {
        let seen = match channel {
            Channel::Vy => &[Channel::Vy, Channel::Across][..],
            Channel::Ax => &[Channel::Ax, Channel::Vx],
            other => std::slice::from_ref(other),
        };
        let is_seen = seen.iter().any(|channel| drive.channels.contains(channel));
        is_seen.then(|| (*id, Transform::Form(place), form.of(*channel, *kind)))
    });
    let all = of_tyres.into_iter().chain(of_signals);
    all.filter(|(.., size)| *size > 0.0).map(|(id, turns, size)| further(id, turns, size))
}

/// Scales and biases of the sensors.
fn of_sensors(drive: &ReplayDrive) -> impl Iterator<Item = UncertainParameter> {
    let there = SENSORS.iter().filter(|(_, channel, ..)| drive.channels.contains(channel));
    there.map(|&(id, channel, tolerance, scale)| {
        let turns = if scale { Transform::Scale(channel) } else { Transform::Bias(channel) };
        further(id, turns, tolerance)
    })
}

/// Tolerances that the vehicle file tells.
fn as_the_file_says<V: ReplayVehicle>(uncertain: &mut [UncertainParameter], vehicle: &V) {
    for uncertain in uncertain {
        if let Some(deviation) = vehicle.tolerances().of(&uncertain.parameter()) {
            uncertain.tolerance = deviation / uncertain.deviation(1.0, vehicle).abs().max(f64::MIN_POSITIVE);
        }
    }
}

/// Tolerances where the lateral acceleration is that of a level frame.
pub fn level<V: ReplayVehicle>(uncertain: &mut [UncertainParameter], vehicle: &V) {
    if let Some(height) = uncertain.iter_mut().find(|uncertain| uncertain.id == HEIGHT) {
        height.tolerance = UNIT_HEIGHT / IMU_HEIGHT;
    }
    as_the_file_says(uncertain, vehicle);
}

/// True if something of this name may have a tolerance, on some log of some vehicle.
#[must_use]
pub fn is_known(name: &str) -> bool {
    let effect = |id: &str| EFFECTS.iter().any(|row| row.0 == id);
    name.strip_prefix("effect.").is_some_and(effect)
        || PARAMETERS.iter().any(|row| row.0 == name || row.1 == name)
        || SENSORS.iter().any(|row| row.0 == name)
        || OTHER_SENSORS.contains(&name)
}

/// Rate of the command that is rarely exceeded, rad/s.
fn quickest(drive: &ReplayDrive) -> f64 {
    let over = (0.05 / drive.step).ceil().max(1.0) as usize;
    let mut rates: Vec<f64> = Vec::new();
    for &(from, to) in &drive.stretches {
        rates.extend(
            (from..to.saturating_sub(over))
                .map(|i| (drive.steer[i + over] - drive.steer[i]).abs() / (over as f64 * drive.step)),
        );
    }
    rates.sort_unstable_by(f64::total_cmp);
    rates.get(rates.len() * 99 / 100).copied().unwrap_or(1.0).max(0.01)
}
