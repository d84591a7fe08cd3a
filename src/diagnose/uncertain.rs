//! Uncertain parameters: the uncertain parameters of a simulator. Every effect, and numbers of the vehicle known within a tolerance
//! only.
//!
//! An uncertain parameter's coordinate is 0 where it is neutral and 1 at its `unit`; its tolerance is the standard deviation in
//! ordinary simulators. Tolerances are those of careful measurement: a weighed car (3 % with fuel and people), axle
//! stiffnesses from a test rig (4 %), a clock (10 ms), a level road (0.25 deg).

use super::calibration::Calibration;
use super::form::FORMS;
use super::replay::{Channel, LEAK, ReplayDrive, ReplayVehicle, Trace};
use crate::vehicle::{Effect, TruckEffects};

/// Action of an uncertain parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Transform {
    /// An effect by its id: neutral + unit * x.
    Effect,
    /// The rate limit: unit / x.
    RateLimit,
    /// The relaxation length: the file's times 1 + x, about unit * (1 + x).
    Relaxation,
    /// A number of the vehicle by its name: times exp(unit * x), so that none changes its sign.
    Factor,
    /// The same: plus unit * x.
    Shift,
    /// A sensor's scale: times 1 + unit * x.
    Scale(Channel),
    /// A sensor's bias: plus unit * x.
    Bias(Channel),
    /// Point at which sideways velocities are given: unit * x forward of the reference point.
    Arm,
    /// Height of that point over the one that the model means: unit * x, m.
    ReferenceHeight,
    /// Lateness by the low pass of the inertial sensors: unit * x, s.
    InertialLag,
    /// Lateness of a satellite receiver's columns: unit * x, s.
    ReceiverLate,
    /// Height of the accelerometer over the vehicle's CG: unit * x, m.
    ImuHeight,
    /// An error of the model's form, by its place in [`FORMS`]: unit * x of its shape.
    Form(usize),
    /// Curve of all tyres between slope and peak: shape factor times exp(unit * x); curvature factor plus unit * x.
    TyreShape,
    TyreCurvature,
    /// Lateral peak of all tyres, whose slope stays: times exp(unit * x).
    TyrePeak,
    /// Early softening of all tyres, as brushes have it: plus unit * x.
    TyreSoftening,
    /// Fall of the tyres' stiffness with load, 1 / PKY2: plus unit * x; the stiffness at the nominal load stays.
    TyreLoad,
}

/// One uncertain parameter.
#[derive(Debug, Clone)]
pub struct UncertainParameter {
    /// The effect's id, the parameter's name, or `sensor.<what>`.
    pub id: &'static str,
    turns: Transform,
    /// Value of one unit of the coordinate, in the uncertain parameter's own unit.
    pub unit: f64,
    /// Standard deviation of the background, in units of the coordinate; 0: no background has it.
    pub tolerance: f64,
    /// Least coordinate.
    pub least: f64,
    /// Least coordinate of a named effect: the effect's own range.
    pub named_least: f64,
    /// Greatest coordinate.
    pub greatest: f64,
    /// Coordinates from which a fit starts.
    pub starts: &'static [f64],
    /// The declaration, if it is an effect of the library.
    pub effect: Option<&'static Effect>,
    /// Companion: another uncertain parameter that is free with it, and the standard deviation of that.
    pub companion: Option<(&'static str, f64)>,
    /// True if it may be named: false where the user leaves the effect out.
    nameable: bool,
}

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
    ("axle.front.roll_steer", "axle.front.roll_steer", 0.015, false),
    ("axle.rear.roll_steer", "axle.rear.roll_steer", 0.015, false),
    ("axle.front.spring_rate", "", 0.10, true),
    // A tractor's frame twists: its torsional stiffness is that of an axle in roll, some 600 kN m/rad, so that the front
    // axle's share of the roll moment is not that of the springs (Sampson, Active Roll Control of Articulated Heavy
    // Vehicles, Cambridge 2000, appendix).
    ("", "axle.front.spring_rate", 0.25, true),
];

/// Masses of a car, of a tractor, of its trailer, and the effects that load them.
pub(super) const LOADED: [(&str, &str); 3] =
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
const INERTIAL: [Channel; 3] = [Channel::YawRate, Channel::Ay, Channel::Ax];
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
const TYRE_LOAD: &str = "form.tyre.load";
/// Least and greatest fall of stiffness with load, 1 / PKY2: none, and the greatest stiffness at half the nominal load.
const FALL: (f64, f64) = (1e-3, 2.0);

/// Standard deviation of the payload's place when a payload is fitted, in units of its coordinate (0.5 m).
const PAYLOAD_PLACE: f64 = 1.6;
/// Deviation of the wind's other component where no heading separates the two, in units of its coordinate (3 m/s).
const WIND_ACROSS: f64 = 3.0;
/// Share of the vehicle's mass that is one unit of payload.
const PAYLOAD_UNIT: f64 = 0.05;

/// Effects between command and wheel angle: none of them is seen where no command was logged.
const BEFORE_THE_ANGLE: [&str; 4] = ["steer_delay", "steer_lag", "steer_rate_limit", "steer_backlash"];

/// All uncertain parameters of a vehicle on a drive; `without`: effects that may not be named. Within their tolerances these stay: a
/// road has a little bank even if the library has no bank.
#[must_use]
pub fn uncertain_parameters<V: ReplayVehicle>(
    vehicle: &V,
    drive: &ReplayDrive,
    without: &[String],
) -> Vec<UncertainParameter> {
    let (mass, _) = vehicle.mass_and_drag();
    let mut uncertain = Vec::new();
    for &(id, unit, tolerance, least, most, starts) in EFFECTS {
        let Some(effect) = TruckEffects::all().find(|effect| effect.id == id) else { continue };
        let of_trailer = crate::vehicle::Effects::find(id).is_none();
        let unseen = !drive.commanded && BEFORE_THE_ANGLE.contains(&id);
        if of_trailer && !V::TRUCK || unseen {
            continue;
        }
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
        let high = (effect.range.1 - effect.neutral) / unit;
        let greatest = if matches!(turns, Transform::Effect) { high.min(most) } else { most };
        let least = if matches!(turns, Transform::Effect)
            && !matches!(id, "steer_delay" | "sensor_delay" | "steer_lag" | "drive_lag")
        {
            least.max((effect.range.0 - effect.neutral) / unit)
        } else {
            least
        };
        // Against a measured angle only the difference of the clocks is seen: the angle may be the late one.
        let either_way = id == "sensor_delay" && !drive.commanded;
        let named_least = if matches!(turns, Transform::Effect) && !either_way {
            least.max((effect.range.0 - effect.neutral) / unit)
        } else {
            least
        };
        let starts = if either_way { &[1.0, 4.0, -4.0] } else { starts };
        // Without a compass the wind is one cause: how strong, and from where by the heading at the log's start.
        let any_wind = !drive.compass && id == "wind_x";
        let left_out = |id: &str| without.iter().any(|left_out| left_out == id);
        let companion = match id {
            "payload" => Some(("payload_x", PAYLOAD_PLACE)),
            "wind_x" if any_wind => Some(("wind_y", WIND_ACROSS)),
            _ => None,
        };
        let accompanies = id == "payload_x" || !drive.compass && id == "wind_y";
        uncertain.push(UncertainParameter {
            id,
            turns,
            unit,
            tolerance,
            least,
            named_least,
            greatest,
            starts,
            effect: Some(effect),
            companion,
            nameable: !(accompanies || left_out(id) || any_wind && left_out("wind_y")),
        });
    }
    let further = |id, turns, unit| UncertainParameter {
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
    };
    for &(car, truck, tolerance, factor) in PARAMETERS {
        let id = if V::TRUCK { truck } else { car };
        if !id.is_empty() {
            uncertain.push(further(id, if factor { Transform::Factor } else { Transform::Shift }, tolerance));
        }
    }
    if drive.channels.contains(&Channel::Vy) {
        uncertain.push(further(REFERENCE_X, Transform::Arm, 0.05));
    }
    if [Channel::Vy, Channel::Across].iter().any(|channel| drive.channels.contains(channel)) {
        uncertain.push(further(REFERENCE_Z, Transform::ReferenceHeight, REFERENCE_HEIGHT));
    }
    if INERTIAL.iter().any(|channel| drive.channels.contains(channel)) {
        uncertain.push(further(FILTERED, Transform::InertialLag, INERTIAL_LAG));
    }
    // Where all that is compared comes by the receiver, its lateness is that of the sensors.
    if drive.channels.iter().any(|channel| channel.by_receiver())
        && INERTIAL.iter().any(|channel| drive.channels.contains(channel))
    {
        uncertain.push(further(RECEIVER, Transform::ReceiverLate, RECEIVER_LATE));
    }
    if drive.channels.contains(&Channel::Ay) {
        uncertain.push(further(HEIGHT, Transform::ImuHeight, IMU_HEIGHT));
    }
    let form = &Calibration::built_in().form;
    let [shape, curvature, peak, softening, load] = form.tyre(V::TRUCK);
    for (id, turns, size) in [
        (TYRE_SHAPE, Transform::TyreShape, shape),
        (TYRE_CURVATURE, Transform::TyreCurvature, curvature),
        (TYRE_PEAK, Transform::TyrePeak, peak),
        (TYRE_SOFTENING, Transform::TyreSoftening, softening),
        (TYRE_LOAD, Transform::TyreLoad, load),
    ] {
        if size > 0.0 {
            uncertain.push(further(id, turns, size));
        }
    }
    for (place, (id, channel, kind)) in FORMS.iter().enumerate() {
        let size = form.of(*channel, *kind);
        let seen = match channel {
            Channel::Vy => &[Channel::Vy, Channel::Across][..],
            Channel::Ax => &[Channel::Ax, Channel::Vx],
            other => std::slice::from_ref(other),
        };
        if size > 0.0 && seen.iter().any(|channel| drive.channels.contains(channel)) {
            uncertain.push(further(id, Transform::Form(place), size));
        }
    }
    for &(id, channel, tolerance, scale) in SENSORS {
        if drive.channels.contains(&channel) {
            uncertain.push(further(
                id,
                if scale { Transform::Scale(channel) } else { Transform::Bias(channel) },
                tolerance,
            ));
        }
    }
    as_the_file_says(&mut uncertain, vehicle);
    uncertain
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

impl UncertainParameter {
    /// A coordinate within its bounds; `named`: within the effect's own range (a negative delay is a tolerance, no effect).
    #[must_use]
    pub fn within(&self, x: f64, named: bool) -> f64 {
        x.clamp(if named { self.named_least } else { self.least }, self.greatest)
    }

    /// Change of the coordinate over which a slope is taken.
    #[must_use]
    pub fn stride(&self) -> f64 {
        if self.tolerance > 0.0 { self.tolerance.clamp(0.1, 1.0) } else { 0.2 }
    }

    /// True if it may be named.
    #[must_use]
    pub fn is_candidate(&self) -> bool {
        self.nameable
    }

    /// True if its value replaces the given one instead of adding to it.
    #[must_use]
    pub fn stands_for_the_given(&self) -> bool {
        matches!(self.turns, Transform::RateLimit | Transform::Relaxation)
    }

    /// True if it acts on the sensors' signals, and not on the motion.
    #[must_use]
    pub fn is_sensed(&self) -> bool {
        matches!(
            self.turns,
            Transform::Scale(_)
                | Transform::Bias(_)
                | Transform::Arm
                | Transform::ReferenceHeight
                | Transform::InertialLag
                | Transform::ImuHeight
        )
    }

    /// True for an error of the model's form: no number of the vehicle, and nothing that a simulator can be given.
    #[must_use]
    pub fn is_form(&self) -> bool {
        matches!(
            self.turns,
            Transform::Form(_)
                | Transform::TyreShape
                | Transform::TyreCurvature
                | Transform::TyrePeak
                | Transform::TyreSoftening
                | Transform::TyreLoad
        )
    }

    /// True for a number of the vehicle, which its file has right within a tolerance.
    #[must_use]
    pub fn is_of_the_file(&self) -> bool {
        !self.is_form() && !self.is_sensed() && self.turns != Transform::ReceiverLate
    }

    /// Its row in [`FORMS`], if it is an error that is added to the replay.
    #[must_use]
    pub fn form(&self) -> Option<&'static super::form::FormError> {
        if let Transform::Form(place) = self.turns { FORMS.get(place) } else { None }
    }

    /// Its value at a coordinate, in its own unit; factors and shifts of the vehicle as such.
    #[must_use]
    pub fn value(&self, x: f64) -> f64 {
        match self.turns {
            Transform::Effect => self.effect.map_or(0.0, |effect| effect.neutral) + self.unit * x,
            Transform::RateLimit if x <= 0.0 => crate::vehicle::NO_RATE_LIMIT,
            Transform::RateLimit => self.unit / x,
            Transform::Relaxation if x == 0.0 => 0.0,
            Transform::Relaxation => self.unit * (1.0 + x),
            Transform::Factor | Transform::TyreShape | Transform::TyrePeak => (self.unit * x).exp(),
            Transform::Scale(_) => 1.0 + self.unit * x,
            Transform::Shift
            | Transform::Bias(_)
            | Transform::Arm
            | Transform::ReferenceHeight
            | Transform::InertialLag
            | Transform::ReceiverLate
            | Transform::ImuHeight
            | Transform::Form(_)
            | Transform::TyreCurvature
            | Transform::TyreSoftening
            | Transform::TyreLoad => self.unit * x,
        }
    }

    /// Standard deviation in its own unit for one of the coordinate.
    #[must_use]
    pub fn spread(&self, x: f64, deviation: f64) -> f64 {
        match self.turns {
            Transform::RateLimit => self.unit / x.max(0.1).powi(2) * deviation,
            _ => self.unit * deviation,
        }
    }

    /// Puts a value on the vehicle or its effects.
    fn put<V: ReplayVehicle>(&self, x: f64, vehicle: &mut V, effects: &mut TruckEffects) {
        if x == 0.0 {
            return;
        }
        match self.turns {
            Transform::Relaxation => effects.vehicle.tyre_relaxation = self.value(x),
            Transform::Effect | Transform::RateLimit => {
                if let Some(place) = effects.get_mut(self.id) {
                    *place = self.value(x);
                }
            }
            Transform::Factor | Transform::Shift => {
                if let Some(parameter) = V::TABLE.iter().find(|parameter| parameter.name == self.id) {
                    let before = parameter.get(vehicle);
                    let factor = matches!(self.turns, Transform::Factor);
                    parameter
                        .set(vehicle, if factor { before * self.value(x) } else { before + self.value(x) });
                }
            }
            Transform::TyreShape
            | Transform::TyreCurvature
            | Transform::TyrePeak
            | Transform::TyreSoftening
            | Transform::TyreLoad => {
                for file in vehicle.tyres().into_iter().filter_map(|(_, tyre)| tyre.coefficients.as_mut()) {
                    match self.turns {
                        Transform::TyreShape => file.pcy1 = (file.pcy1 * self.value(x)).clamp(0.9, 1.9),
                        Transform::TyrePeak => file.lmuy *= self.value(x),
                        Transform::TyreSoftening => {
                            file.softening = (file.softening + self.value(x)).clamp(-0.5, 3.0)
                        }
                        Transform::TyreLoad => {
                            let before = 1.0 / file.pky2;
                            let fall = (before + self.value(x)).clamp(FALL.0, FALL.1);
                            // As of a sine of twice an arc tangent: 2 f / (1 + f^2).
                            let at_nominal = |fall: f64| fall / (1.0 + fall * fall);
                            file.pky1 *= at_nominal(before) / at_nominal(fall);
                            file.pky2 = 1.0 / fall;
                        }
                        _ => file.pey1 = (file.pey1 + self.value(x)).clamp(-10.0, 1.0),
                    }
                }
            }
            Transform::Scale(_)
            | Transform::Bias(_)
            | Transform::Arm
            | Transform::ReferenceHeight
            | Transform::InertialLag
            | Transform::ReceiverLate
            | Transform::ImuHeight
            | Transform::Form(_) => {}
        }
    }

    /// Applies a sensor's uncertain parameter to a replay.
    fn sense(&self, x: f64, drive: &ReplayDrive, trace: &mut Trace) {
        let (channel, factor, shift) = match self.turns {
            Transform::Scale(channel) => (channel, self.value(x), 0.0),
            Transform::Bias(channel) => (channel, 1.0, self.value(x)),
            Transform::Arm => {
                let arm = self.value(x);
                let rate = trace.columns[Channel::YawRate as usize].clone();
                trace.columns[Channel::Vy as usize]
                    .iter_mut()
                    .zip(rate)
                    .for_each(|(vy, rate)| *vy += arm * rate);
                return;
            }
            Transform::ReferenceHeight => {
                let (height, keep) = (self.value(x), (-drive.step / LEAK).exp());
                let Trace { columns, roll, .. } = trace;
                for &(from, to) in &drive.stretches {
                    let (mut across, mut before) = (0.0, roll[from]);
                    for (row, &roll) in roll.iter().enumerate().take(to).skip(from) {
                        let moved = -height * (roll - before);
                        before = roll;
                        across = keep * (across + moved);
                        for (channel, by) in [(Channel::Vy, moved / drive.step), (Channel::Across, across)] {
                            if let Some(value) = columns[channel as usize].get_mut(row) {
                                *value += by;
                            }
                        }
                    }
                }
                return;
            }
            Transform::InertialLag => {
                let rows = self.value(x) / drive.step;
                for column in INERTIAL.map(|channel| channel as usize) {
                    let column = &mut trace.columns[column];
                    for &(from, to) in &drive.stretches {
                        for i in (from + 1..to.min(column.len())).rev() {
                            column[i] -= rows * (column[i] - column[i - 1]);
                        }
                    }
                }
                return;
            }
            Transform::ImuHeight => {
                let feels = -self.value(x) / drive.step.powi(2);
                let roll = &trace.roll;
                let ay = &mut trace.columns[Channel::Ay as usize];
                for &(from, to) in &drive.stretches {
                    for i in from + 1..to.min(ay.len()).saturating_sub(1) {
                        ay[i] += feels * (roll[i - 1] - 2.0 * roll[i] + roll[i + 1]);
                    }
                }
                return;
            }
            _ => return,
        };
        trace.columns[channel as usize].iter_mut().for_each(|value| *value = factor * *value + shift);
    }

    /// The parameter's name in a vehicle file or of a plant, for a recalibration.
    #[must_use]
    pub fn parameter(&self) -> String {
        if self.effect.is_some() { format!("effect.{}", self.id) } else { self.id.to_owned() }
    }

    /// Values of the uncertain parameter before and at a coordinate, as the vehicle file or the plant has them.
    #[must_use]
    pub fn adjusted<V: ReplayVehicle>(&self, x: f64, vehicle: &V) -> (f64, f64) {
        match V::TABLE.iter().find(|parameter| parameter.name == self.id) {
            Some(parameter) => {
                let given = parameter.get(vehicle);
                let factor = matches!(self.turns, Transform::Factor);
                (given, if factor { given * self.value(x) } else { given + self.value(x) })
            }
            // The file's length; the effect's own neutral value, 0, only stands for it.
            None if matches!(self.turns, Transform::Relaxation) => (self.unit, self.unit * (1.0 + x)),
            None => (self.value(0.0), self.value(x)),
        }
    }

    /// Symbol of its unit.
    #[must_use]
    pub fn symbol<V: ReplayVehicle>(&self) -> String {
        let parameter = V::TABLE.iter().find(|parameter| parameter.name == self.id).map(|p| p.unit.symbol);
        let of_sensor = match self.turns {
            Transform::Bias(channel) => crate::signal::find(channel.name()).map(|signal| signal.unit.symbol),
            Transform::Arm | Transform::ReferenceHeight | Transform::ImuHeight => Some("m"),
            Transform::InertialLag | Transform::ReceiverLate => Some("s"),
            _ => None,
        };
        self.effect.map(|effect| effect.unit.symbol).or(parameter).or(of_sensor).unwrap_or("1").to_owned()
    }

    /// A standard deviation as the vehicle file or the plant has it.
    #[must_use]
    pub fn deviation<V: ReplayVehicle>(&self, deviation: f64, vehicle: &V) -> f64 {
        let (given, _) = self.adjusted(0.0, vehicle);
        let of_factor = matches!(self.turns, Transform::Factor) && self.effect.is_none();
        let factor = if of_factor { given.abs().max(1e-12) } else { 1.0 };
        self.spread(1.0, deviation) * factor
    }

    /// True if the coordinate is one over the value.
    #[must_use]
    pub fn is_reciprocal(&self) -> bool {
        matches!(self.turns, Transform::RateLimit)
    }

    /// Increase of the value for one of the coordinate, as the vehicle file or the plant has it, or to one over the value.
    #[must_use]
    pub fn step_of_one<V: ReplayVehicle>(&self, vehicle: &V) -> f64 {
        if self.is_reciprocal() { 1.0 / self.unit } else { self.deviation(1.0, vehicle) }
    }
}

/// The vehicle and its effects at coordinates.
#[must_use]
pub fn at<V: ReplayVehicle>(uncertain: &[UncertainParameter], x: &[f64], vehicle: &V) -> (V, TruckEffects) {
    let (mut vehicle, mut effects) = (vehicle.clone(), TruckEffects::default());
    for (uncertain, &x) in uncertain.iter().zip(x) {
        uncertain.put(x, &mut vehicle, &mut effects);
    }
    (vehicle, effects)
}

/// Lateness of a receiver's columns relative to all others, s.
#[must_use]
pub fn receiver_late(uncertain: &[UncertainParameter], x: &[f64]) -> f64 {
    let place = uncertain.iter().position(|uncertain| uncertain.turns == Transform::ReceiverLate);
    place.map_or(0.0, |i| uncertain[i].value(x[i]))
}

/// Applies the sensors' uncertain parameters to a replay.
pub fn sense(uncertain: &[UncertainParameter], x: &[f64], drive: &ReplayDrive, trace: &mut Trace) {
    for (uncertain, &x) in uncertain.iter().zip(x) {
        if x != 0.0 {
            uncertain.sense(x, drive, trace);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::simulated::{Conditions, drive};
    use crate::vehicle::builtin;

    #[test]
    fn what_load_does_to_a_tyre_changes_no_stiffness_at_the_nominal_load() {
        let car = builtin("c_class").unwrap();
        let conditions = Conditions { seed: 3, duration: 10.0, step: 0.02, ..Conditions::default() };
        let log = drive(&car, &TruckEffects::default(), &conditions).unwrap();
        let uncertain = uncertain_parameters(&car, &ReplayDrive::new(&log, false), &[]);
        let place = uncertain.iter().position(|uncertain| uncertain.id == TYRE_LOAD).unwrap();
        let stiffness = |x: f64, share: f64| {
            let mut all = vec![0.0; uncertain.len()];
            all[place] = x;
            let tyre = at(&uncertain, &all, &car).0.tyre.front.coefficients.unwrap();
            tyre.cornering_stiffness(share * tyre.fz0, 0.0)
        };
        for x in [-9.0, -1.0, 1.0, 4.0] {
            let (nominal, changed) = (stiffness(0.0, 1.0), stiffness(x, 1.0));
            assert!((changed / nominal - 1.0).abs() < 1e-9, "{x}: {changed} {nominal}");
        }
        // Twice the load gives twice the stiffness of a linear tyre, and less of others.
        let twice = |x: f64| stiffness(x, 2.0) / stiffness(x, 1.0);
        assert!((twice(-9.0) - 2.0).abs() < 1e-4, "{}", twice(-9.0));
        assert!(twice(0.0) > twice(1.0) && twice(-1.0) > twice(0.0));
    }
}
