//! Numbers of a vehicle file that contradict each other, though each is in its range: a unit that slipped, springs of
//! another vehicle.
//!
//! A quotient of numbers that is alike in all vehicles tells a slip of a unit by a factor `f`: the quotient is then nearer to
//! those of vehicles with the factor than without,
//!
//! ```text
//! q < low / sqrt(f)    or    q > high sqrt(f)
//! ```
//!
//! Springs and hitch contradict the rest by mechanics alone. Nothing is refused: a vehicle may be meant so.

use super::file::Doubt;
use super::parameters::{Axle, CarParameters, GRAVITY};
use super::truck_parameters::TruckParameters;

/// A quotient that is alike in all vehicles.
struct Quotient {
    /// Least and greatest of vehicles.
    range: (f64, f64),
    /// A slip that happens, as a factor of the quotient, and the unit that makes it.
    slip: (f64, Option<&'static str>),
    /// The quantity that is so large or small, in words, and its unit.
    of: &'static str,
    unit: &'static str,
}

/// Drive power for each kilogram. From a laden truck (at least 5 kW a tonne: directive 97/27/EC, Annex I, 7.10) to a racing car.
const POWER: Quotient = Quotient {
    range: (5.0, 600.0),
    slip: (1e3, Some("kW")),
    of: "for each kilogram of the vehicle",
    unit: "W",
};
/// Forces of drive and brakes for each kilogram: from a laden truck uphill (12 %) to racing tyres (2 g).
const FORCE: Quotient = Quotient {
    range: (1.0, 20.0),
    slip: (1e3, Some("kN")),
    of: "for each kilogram of the vehicle",
    unit: "N",
};
/// Yaw inertia over mass and squared wheelbase: a radius of inertia of 0.35 to 0.65 wheelbases. Source: Garrott, Monk and
/// Chrstos, Vehicle Inertial Parameters - Measured Values and Approximations, SAE 881767.
const INERTIA: Quotient =
    Quotient { range: (0.12, 0.42), slip: (10.0, None), of: "of mass times wheelbase squared", unit: "" };
/// Wheelbase over track: from a two-seater to a coach.
const WHEELBASE: Quotient = Quotient { range: (1.2, 3.5), slip: (10.0, None), of: "tracks", unit: "" };

/// Sag of the softest springs of vehicles, m: a natural frequency of 0.9 Hz. Source: Gillespie, Fundamentals of Vehicle
/// Dynamics, ch. 5.
const SOFTEST: f64 = 0.3;

impl Quotient {
    /// The doubt about a number with this quotient; none where vehicles have it, or where the number is none at all.
    fn doubt(&self, name: &'static str, what: &str, value: f64, unit: &str, quotient: f64) -> Option<Doubt> {
        let ((low, high), (slip, slipped)) = (self.range, self.slip);
        let far = slip.sqrt();
        if value == 0.0 || (low / far..=high * far).contains(&quotient) {
            return None;
        }
        // The power of ten that brings it among the vehicles'.
        let middle = (low * high).sqrt();
        let power = (middle / quotient).log10().round();
        let meant = value * 10_f64.powf(power);
        let in_unit = match slipped {
            Some(written) if (power - slip.log10()).abs() < 0.5 => {
                format!(", as if written in {written}")
            }
            _ => String::new(),
        };
        let Self { of, unit: per, .. } = self;
        let per = if per.is_empty() { String::new() } else { format!(" {per}") };
        Some(Doubt {
            name,
            words: format!(
                "{what} = {} {unit} is {quotient:.3}{per} {of}; vehicles have {low} to {high}{in_unit}. {} {unit} would \
                 be ordinary",
                short(value),
                short(meant)
            ),
        })
    }
}

/// A number without the rounding of its last digits.
fn short(value: f64) -> String {
    format!("{:.6e}", value).parse::<f64>().map_or_else(|_| value.to_string(), |value| value.to_string())
}

/// An axle with its key in the file and its load at rest, N.
type Loaded<'a> = (&'static str, &'a Axle, f64);

/// Springs that do not carry what lies on them: the body falls over at rest, or sinks to the road. `moment`: that of the
/// weight about the road for each radian of roll, N m/rad.
fn springs(axles: &[Loaded], moment: f64, cg_height: f64) -> Option<Doubt> {
    let sag = |(_, axle, load): &Loaded| (load - axle.unsprung_mass * GRAVITY) / (2.0 * axle.spring_rate);
    let softest = axles.iter().max_by(|a, b| sag(a).total_cmp(&sag(b)))?;
    let held: f64 = axles
        .iter()
        .map(|(_, axle, _)| 0.5 * axle.spring_rate * axle.track * axle.track + axle.anti_roll_bar)
        .sum();
    let (name, axle, _) = *softest;
    let sag = sag(softest);
    let what = if held < moment {
        let [held, moment] = [held, moment].map(|each| 1e-3 * each);
        format!(
            "springs and anti-roll bars hold the body with {held:.0} kN m for each radian of roll, and its weight tilts it \
             with {moment:.0}: it falls over at any speed"
        )
    } else if sag > cg_height {
        format!("the CG is {cg_height} m over the road: the body sinks to it")
    } else {
        return None;
    };
    let enough = short((axle.spring_rate * sag / SOFTEST / 1e3).ceil() * 1e3);
    Some(Doubt {
        name,
        words: format!(
            "{name} = {} N/m sags by {sag:.2} m under its load at rest. {what}. {enough} N/m would sag by {SOFTEST} m, as \
             soft vehicles do",
            short(axle.spring_rate)
        ),
    })
}

/// Doubt about a body's yaw inertia in kg m2, by its mass in kg and length in m.
fn turning(name: &'static str, inertia: f64, mass: f64, length: f64) -> Option<Doubt> {
    INERTIA.doubt(name, name, inertia, "kg m2", inertia / (mass * length * length))
}

impl CarParameters {
    pub(super) fn contradictions(&self) -> Vec<Doubt> {
        let (body, wheelbase) = (&self.vehicle, self.wheelbase());
        let (front, rear) = self.axle_loads();
        let axles = [
            ("axle.front.spring_rate", &self.axle.front, front),
            ("axle.rear.spring_rate", &self.axle.rear, rear),
        ];
        let long = WHEELBASE.doubt(
            "vehicle.cg_to_front_axle",
            "the wheelbase",
            wheelbase,
            "m",
            wheelbase / self.axle.front.track,
        );
        let moment = body.mass * GRAVITY * body.cg_height;
        let mut found = forces(self.drive.max_power, [self.drive.max_force, self.brake.max_force], body.mass);
        // A wrong wheelbase makes the inertia look wrong, too.
        found.extend(long.or(turning("vehicle.yaw_inertia", body.yaw_inertia, body.mass, wheelbase)));
        found.extend(springs(&axles, moment, body.cg_height));
        found
    }
}

impl TruckParameters {
    pub(super) fn contradictions(&self) -> Vec<Doubt> {
        let (tractor, trailer) = (&self.tractor, &self.trailer);
        let wheelbase = tractor.cg_to_front_axle + tractor.cg_to_rear_axle;
        let length = trailer.cg_to_hitch + trailer.cg_to_axle;
        let mass = tractor.mass + trailer.mass;
        let [front, rear, behind] = self.axle_loads();
        let axles = [
            ("axle.front.spring_rate", &self.axle.front, front),
            ("axle.rear.spring_rate", &self.axle.rear, rear),
            ("axle.trailer.spring_rate", &self.axle.trailer, behind),
        ];
        let mut found = forces(self.drive.max_power, [self.drive.max_force, self.brake.max_force], mass);
        let long = WHEELBASE.doubt(
            "tractor.cg_to_front_axle",
            "the tractor's wheelbase",
            wheelbase,
            "m",
            wheelbase / self.axle.front.track,
        );
        found.extend(long.or(turning("tractor.yaw_inertia", tractor.yaw_inertia, tractor.mass, wheelbase)));
        found.extend(turning("trailer.yaw_inertia", trailer.yaw_inertia, trailer.mass, length));
        let place = self.hitch.cg_to_hitch;
        if place < 0.0 {
            found.push(Doubt {
                name: "hitch.cg_to_hitch",
                words: format!(
                    "hitch.cg_to_hitch = {place} m puts the trailer in front of the tractor's CG, on its front axle; behind is \
                     positive: {} m",
                    -place
                ),
            });
        }
        let moment = GRAVITY * (tractor.mass * tractor.cg_height + trailer.mass * trailer.cg_height);
        found.extend(springs(&axles, moment, tractor.cg_height.min(trailer.cg_height)));
        found
    }
}

/// Doubts about power (W) and forces (N) of a vehicle's mass in kg.
fn forces(power: f64, [drive, brake]: [f64; 2], mass: f64) -> Vec<Doubt> {
    [
        POWER.doubt("drive.max_power", "drive.max_power", power, "W", power / mass),
        FORCE.doubt("drive.max_force", "drive.max_force", drive, "N", drive / mass),
        FORCE.doubt("brake.max_force", "brake.max_force", brake, "N", brake / mass),
    ]
    .into_iter()
    .flatten()
    .collect()
}
