//! The constants of one unit: its parameters with the effects applied.

use super::axle::UnitAxle;
use crate::path::Path;
use crate::vehicle::effects::Effects;
use crate::vehicle::parameters::{self, GRAVITY};
use crate::vehicle::surface::Surface;
use crate::vehicle::tyre::TyreModel;
use nalgebra::Matrix3;

/// Masses and inertias of an unladen unit with all wheels, but roll and pitch inertia, which are the body's.
#[derive(Debug, Clone, Copy)]
pub(in crate::vehicle) struct Masses {
    pub mass: f64,
    pub yaw_inertia: f64,
    pub roll_inertia: f64,
    pub pitch_inertia: f64,
    pub cg_height: f64,
}

/// Change of a unit's masses by effects; the load at the height of the CG.
#[derive(Debug, Clone, Copy)]
pub(in crate::vehicle) struct Load {
    pub mass: f64,
    /// Forward of the unladen CG of the file, m.
    pub x: f64,
    /// Shift of the unladen CG, forward, m.
    pub shift: f64,
    /// Factor on the unladen yaw inertia.
    pub yaw_inertia: f64,
}

/// Gravity in body axes of the road plane for a unit heading `yaw` (rad), at a station of the road.
pub(in crate::vehicle) fn gravity(effects: &Effects, yaw: f64, road: Option<&Path>, station: f64) -> Gravity {
    let Effects { road_grade, road_bank, .. } = *effects;
    let level = Gravity { x: 0.0, y: 0.0, z: GRAVITY };
    let (yaw, bank, grade) = match road {
        // Nearly all roads are: no angle matters then.
        _ if road_grade == 0.0 && road_bank == 0.0 && road.is_none_or(Path::is_level) => return level,
        None => (0.0, road_bank, road_grade),
        Some(road) => {
            let here = road.at(station);
            (yaw - here.yaw, here.bank + road_bank, here.grade + road_grade)
        }
    };
    tilted(yaw, bank, grade)
}

impl Load {
    /// The load that effects put on the unit that is steered.
    pub fn of(effects: &Effects) -> Self {
        Self {
            mass: effects.payload,
            x: effects.payload_x,
            shift: effects.cg_shift,
            yaw_inertia: effects.yaw_inertia,
        }
    }
}

/// A unit with its load.
#[derive(Debug, Clone, Copy)]
pub(in crate::vehicle) struct Laden {
    empty: Masses,
    load: Load,
    /// kg
    pub mass: f64,
    /// Place of the CG forward of the file's, m.
    pub cg: f64,
    yaw_inertia: f64,
}

impl Laden {
    pub fn new(empty: Masses, load: Load) -> Self {
        let mass = empty.mass + load.mass;
        let cg = (empty.mass * load.shift + load.mass * load.x) / mass;
        let yaw_inertia = empty.yaw_inertia * load.yaw_inertia
            + empty.mass * square(load.shift - cg)
            + load.mass * square(load.x - cg);
        Self { empty, load, mass, cg, yaw_inertia }
    }
}

/// Parts of an axle.
pub(in crate::vehicle) struct AxleParts<'a, T> {
    pub axle: &'a parameters::Axle,
    pub tyre: T,
    /// Sideways shift of the contact patch for each newton of lateral force, m/N.
    pub lateral_compliance: f64,
    /// Forward of the laden CG, m.
    pub x: f64,
    /// Load of one side at rest, N.
    pub static_load: f64,
    /// Tyres that share the load of one side.
    pub tyres: f64,
    pub steered: bool,
    /// Factor on the cornering stiffness.
    pub stiffness: f64,
    /// Share of the axle in the drive force and in the brake force.
    pub drive_share: f64,
    pub brake_share: f64,
}

/// The constants of one unit.
pub(in crate::vehicle) struct UnitConstants<T, const A: usize> {
    pub axles: [UnitAxle<T>; A],
    pub mass: f64,
    pub sprung_mass: f64,
    pub pitch_inertia: f64,
    /// Place of the sprung mass's CG forward of the unit's, m.
    pub x_sprung: f64,
    /// Height of the sprung mass's CG over the road and over the roll axis, m.
    pub sprung_height: f64,
    pub roll_arm: f64,
    /// Inverse of the inertia matrix of (lateral specific force, yaw and roll acceleration).
    pub inverse_inertia: [[f64; 3]; 3],
    /// Place of the reference point (the CG of the file, where the sensors are) forward of the CG, m.
    pub reference_x: f64,
}

fn square(x: f64) -> f64 {
    x * x
}

impl<T: TyreModel, const A: usize> UnitConstants<T, A> {
    /// A unit from its parts; `roll_axis` is the height of the roll axis at a place forward of the CG. `relaxation` is
    /// the length (m) that `tyre_relaxation` replaces; none: it is that of all tyres, whatever their load.
    pub fn new(
        laden: &Laden,
        parts: &[AxleParts<T>; A],
        effects: &Effects,
        relaxation: Option<f64>,
        roll_axis: impl Fn(f64) -> f64,
    ) -> Self {
        let wanted = Some(effects.tyre_relaxation).filter(|&length| length > 0.0);
        let Laden { empty, load, mass, cg, yaw_inertia } = *laden;
        let radii = parts.each_ref().map(|parts| parts.tyre.rolling_radius());
        let sum = |of: &dyn Fn(usize) -> f64| (0..A).map(of).reduce(|sum, of| sum + of).unwrap_or(0.0);
        let unsprung = sum(&|i| parts[i].axle.unsprung_mass);
        let (sprung_empty, sprung_mass) = (empty.mass - unsprung, mass - unsprung);
        // The wheels' CG is at the axle's height; what is left of the unit's CG height is the body's.
        let moment = (0..A)
            .fold(empty.mass * empty.cg_height, |moment, i| moment - parts[i].axle.unsprung_mass * radii[i]);
        let height_empty = moment / sprung_empty;
        let height = (sprung_empty * height_empty + load.mass * empty.cg_height) / sprung_mass;
        let raised =
            sprung_empty * square(height_empty - height) + load.mass * square(empty.cg_height - height);
        let x_sprung = -sum(&|i| parts[i].axle.unsprung_mass * parts[i].x) / sprung_mass;
        let roll_arm = height - roll_axis(x_sprung);

        let axles = std::array::from_fn(|i| {
            let AxleParts { axle, x, static_load, steered, stiffness, .. } = parts[i];
            let springs = 0.5 * square(axle.track) * axle.spring_rate;
            let more = (effects.roll_stiffness - 1.0) * (springs + axle.anti_roll_bar);
            let mut tyre = parts[i].tyre.clone();
            tyre.scale_cornering_stiffness(stiffness);
            if let (Some(wanted), Some(own)) = (wanted, relaxation) {
                tyre.scale_lateral_relaxation(wanted / own);
            }
            UnitAxle {
                tyre,
                tyres: parts[i].tyres,
                x,
                x_sprung: x - x_sprung,
                half_track: 0.5 * axle.track,
                unsprung_mass: axle.unsprung_mass,
                spring: axle.spring_rate,
                damper: axle.damping,
                anti_roll_bar: axle.anti_roll_bar + more,
                roll_centre: axle.roll_centre_height,
                camber_gain: axle.camber_gain,
                roll_steer: axle.roll_steer,
                sway: -axle.sway * roll_arm,
                steered: if steered { 1.0 } else { 0.0 },
                wheel_inertia: axle.wheel_inertia,
                radius: radii[i],
                lateral_compliance: parts[i].lateral_compliance / parts[i].tyres,
                static_load,
                relaxation: wanted.filter(|_| relaxation.is_none()).unwrap_or(0.0),
                drive_share: 0.5 * parts[i].drive_share,
                brake_share: 0.5 * parts[i].brake_share,
            }
        });

        let over = |i: usize| (height - parts[i].axle.roll_centre_height) * parts[i].axle.unsprung_mass;
        let inertia = Matrix3::new(
            mass,
            0.0,
            -sprung_mass * roll_arm,
            0.0,
            yaw_inertia,
            -sprung_mass * x_sprung * roll_arm,
            sum(&over),
            sum(&|i| over(i) * parts[i].x),
            empty.roll_inertia + raised,
        );
        // Regular: masses and inertias are positive, and the body's share of the mass is less than all of it.
        let inverse = inertia.try_inverse().unwrap_or_else(Matrix3::identity);
        let row = |i: usize| [inverse[(i, 0)], inverse[(i, 1)], inverse[(i, 2)]];
        Self {
            axles,
            mass,
            sprung_mass,
            pitch_inertia: empty.pitch_inertia + raised,
            x_sprung,
            sprung_height: height,
            roll_arm,
            inverse_inertia: [row(0), row(1), row(2)],
            reference_x: -cg,
        }
    }
}

/// The same for a unit driven straight along a surface.
pub(in crate::vehicle) fn gravity_on(effects: &Effects, surface: Surface) -> Gravity {
    tilted(0.0, surface.bank + effects.road_bank, surface.grade + effects.road_grade)
}

/// The same for a unit at an angle to a road so banked and steep, rad.
fn tilted(yaw: f64, bank: f64, grade: f64) -> Gravity {
    let along = -GRAVITY * grade.sin();
    let across = -GRAVITY * grade.cos() * bank.sin();
    let (sin, cos) = yaw.sin_cos();
    Gravity {
        x: along * cos + across * sin,
        y: -along * sin + across * cos,
        z: GRAVITY * grade.cos() * bank.cos(),
    }
}

/// Gravity in body axes in the plane of the road, and into it, m/s2.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::vehicle) struct Gravity {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}
